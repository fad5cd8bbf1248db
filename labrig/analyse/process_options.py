"""Options of `labrig process` that belong to measurements, as models that each registers."""

import re
from collections.abc import Mapping
from typing import Any, TypeVar

from pydantic import ConfigDict, Field

from labrig.foundation.errors import UsageError
from labrig.foundation.models import FrozenModel, Positive
from labrig.foundation.plugins import measurement
from labrig.foundation.yaml_file import validate

OptionsT = TypeVar("OptionsT", bound="ProcessOptions")


def flag(name: str) -> str:
    """Return the option of a field on the command line.

    Parameters
    ----------
    name
        Name of the field.

    Returns
    -------
    str
        The option.

    Examples
    --------
    >>> from labrig.analyse import flag
    >>> flag("per_led")
    '--per-led'
    """
    return f"--{name.replace('_', '-')}"


class ProcessOptions(FrozenModel):
    """Base of a measurement's own options; without fields, those of one that has none.

    A field's description is the option's help. A tuple is an option that may be repeated, a bool
    one without a value.
    """

    model_config = ConfigDict(alias_generator=flag, populate_by_name=True)


class StatesOption(ProcessOptions):
    """Options of a fit with several states."""

    states: int | None = Field(None, ge=1, le=3, description="Number of states to fit.")


class RateOption(ProcessOptions):
    """Options of a fit in which rates may be known from elsewhere."""

    rate: tuple[Positive, ...] = Field(
        (), description="Rate in 1/s that is held fixed, as one of the states. Repeatable."
    )


class IntervalsOption(ProcessOptions):
    """Options of a fit whose parameters have limits by profile likelihood."""

    intervals: bool = Field(
        False,
        description="Limits of every rate and order at 68 and 95 % by profile likelihood, not only "
        "where σ misleads.",
    )


def options_of(protocol: Any) -> list[type[ProcessOptions]]:
    """Return the options of a protocol and, of a chain, of its parts.

    Parameters
    ----------
    protocol
        Model of the protocol.

    Returns
    -------
    list of type
        Models of the options; empty where nothing can be chosen.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.acquire import read_run_protocol
    >>> from labrig.analyse import options_of
    >>> [options.__name__ for options in options_of(read_run_protocol(Path("runs/decay")))]
    ['DecayOptions']
    """
    chain = [part.protocol for part in protocol.chain()] if hasattr(protocol, "chain") else []
    loaded = (measurement(each.protocol).load("options") for each in (protocol, *chain))
    return list({options: None for options in loaded if options is not None})


def check_options(given: Mapping[str, Any], protocol: Any) -> None:
    """Refuse options that a protocol does not have, and values that they cannot have.

    Parameters
    ----------
    given
        Values of options by their fields' names.
    protocol
        Model of the protocol.

    Raises
    ------
    UsageError
        The message names the option.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.acquire import read_run_protocol
    >>> from labrig.analyse import check_options
    >>> decay = read_run_protocol(Path("runs/decay"))
    >>> check_options({"states": 2}, decay)
    >>> check_options({"order": 2}, decay)
    Traceback (most recent call last):
    labrig.foundation.errors.UsageError: --order: expected an option of decay, ...
    """
    models = options_of(protocol)
    fields = {name for model in models for name in model.model_fields}
    if unknown := sorted(set(given) - fields):
        has = f"it has {', '.join(map(flag, sorted(fields)))}" if fields else "it has none"
        raise UsageError(
            f"{flag(unknown[0])}: expected an option of {protocol.protocol}, {has}; leave it out"
        )
    for model in models:
        chosen_options(model, given)


def chosen_options(model: type[OptionsT], given: Mapping[str, Any]) -> OptionsT:
    """Return the options of one measurement among those given.

    Parameters
    ----------
    model
        Model of the measurement's options.
    given
        Values of options by their fields' names, also of other measurements.

    Returns
    -------
    ProcessOptions
        Its own options, with defaults for those that were not given.

    Raises
    ------
    UsageError
        A value is one that the option cannot have.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.acquire import read_run_protocol
    >>> from labrig.analyse import chosen_options, options_of
    >>> (options,) = options_of(read_run_protocol(Path("runs/decay")))
    >>> chosen_options(options, {"states": 2, "order": "free"}).states
    2
    """
    own = {flag(name): value for name, value in given.items() if name in model.model_fields}
    try:
        return validate(own, model, "options")
    except UsageError as error:
        # On a command line the values of an option that is repeated have no numbers.
        raise UsageError(re.sub(r"^options: (--[\w-]+)(\.\d+)?", r"\1", str(error))) from None
