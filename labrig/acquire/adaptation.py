"""Adaptation of a protocol to a rig: values that nobody chose become those that the rig offers.

A key takes part by an `Offer` in the annotation of its type. Values that a person chose are never
changed: those that the rig does not offer are refused.
"""

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import Any, TypeVar, get_args

from pydantic import BaseModel

from labrig.acquire.rig import Rig
from labrig.foundation.errors import ProtocolError, UsageError
from labrig.foundation.yaml_file import validate

ModelT = TypeVar("ModelT", bound=BaseModel)


class Offer(ABC):
    """Annotation of a key whose value has to be one of those that a rig offers.

    Attributes
    ----------
    is_required
        Whether a chosen value that is not offered is refused, rather than left to the plan.
    """

    is_required: bool = True

    @abstractmethod
    def fitted(self, value: Any, rig: Rig) -> Any:
        """Return the offered value nearest to `value`; `value` itself if the rig offers it."""

    @abstractmethod
    def reason(self, rig: Rig) -> str:
        """Return what the rig offers, as a clause for messages."""

    def text(self, value: Any) -> str:
        """Return a value as it is written in a protocol."""
        values = value if isinstance(value, tuple) else (value,)
        return ", ".join(f"{each:g}" if isinstance(each, float) else f"{each}" for each in values)


@dataclass(frozen=True)
class Adaptation:
    """A value that was changed because the rig does not offer the one of the protocol.

    Attributes
    ----------
    key
        Dotted key in the protocol, such as `camera.f_number`; of a chain with the part before it.
    before, after
        Values as they are written in a protocol.
    reason
        What the rig offers.
    """

    key: str
    before: str
    after: str
    reason: str

    def __str__(self) -> str:
        reason = "" if self.after in self.reason else f" ({self.reason})"
        return f"{self.key}: {self.after} in place of {self.before}{reason}"


def adapted(
    model: ModelT, rig: Rig, chosen: Collection[str] | None
) -> tuple[ModelT, list[Adaptation]]:
    """Return a model with all values that nobody chose among those that a rig offers.

    Parameters
    ----------
    model
        Model of a protocol, or of keys within one.
    rig
        Open devices, or stand-ins of a plan.
    chosen
        Dotted keys whose values a person chose; None: those that were set when `model` was read.

    Returns
    -------
    ModelT
        The model; the same one if nothing was changed.
    list of Adaptation
        All changes, in the order of the keys.

    Raises
    ------
    ProtocolError
        The rig does not offer a value that was chosen, or those that it offers do not go with the
        other keys; the message names the key.

    Examples
    --------
    >>> import labrig
    >>> from labrig.acquire import adapted, planned_rig
    >>> rig = planned_rig(labrig.read_rig_file("runs/decay/rig.yaml"), "rig.yaml")
    >>> protocol = labrig.read_protocol("runs/decay/protocol.yaml")
    >>> adapted(protocol, rig, chosen=())[1]
    []
    """
    changes: list[Adaptation] = []
    fitted = _adapted(model, rig, chosen, "", changes)
    if not changes:
        return model, changes
    source = f"adapted to the rig ({'; '.join(map(str, changes))})"
    try:
        content = fitted.model_dump(mode="json", by_alias=True)
        return validate(content, type(model), source), changes
    except UsageError as error:
        raise ProtocolError(str(error)) from None


def _adapted(
    model: ModelT,
    rig: Rig,
    chosen: Collection[str] | None,
    within: str,
    changes: list[Adaptation],
) -> ModelT:
    update: dict[str, Any] = {}
    for name, field in type(model).model_fields.items():
        value, key = getattr(model, name), f"{within}{field.alias or name}"
        is_set = name in model.model_fields_set
        is_chosen = is_set if chosen is None else not _outer_keys(key).isdisjoint(chosen)
        if isinstance(value, BaseModel):
            # The keys of a default were set by no person.
            inner_chosen = () if chosen is None and not is_chosen else chosen
            inner = _adapted(value, rig, inner_chosen, f"{key}.", changes)
            if inner is not value:
                update[name] = inner
            continue
        offer = next(_offers((field.annotation, *field.metadata)), None)
        if offer is None or (fitted := offer.fitted(value, rig)) == value:
            continue
        if not is_chosen:
            reason = offer.reason(rig)
            changes.append(Adaptation(key, offer.text(value), offer.text(fitted), reason))
            update[name] = fitted
        elif offer.is_required:
            raise ProtocolError(
                f"{key}: the rig does not offer {offer.text(value)}; {offer.reason(rig)}"
            )
    return model.model_copy(update=update) if update else model


def _outer_keys(key: str) -> set[str]:
    """Return a dotted key and all keys that it lies within."""
    parts = key.split(".")
    return {".".join(parts[:count]) for count in range(1, len(parts) + 1)}


def _offers(annotation: tuple[Any, ...]) -> Iterator[Offer]:
    """Yield the offers in a type; an annotated one has its metadata behind."""
    for part in annotation:
        if isinstance(part, Offer):
            yield part
        elif part is not None:
            yield from _offers(get_args(part))
