"""The fields of any result as a flat list: for exports, plain tables and comparisons."""

from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

from pydantic import BaseModel

from labrig.results.measured import Measured
from labrig.results.run_result import RunResult

#: Ends of the names of fields, longest first, and the unit that they stand for.
_UNITS = {
    "_dn_per_s": "DN/s",
    "_per_s": "1/s",
    "_nm": "nm",
    "_dn": "DN",
    "_px": "pixel",
    "_ms": "ms",
    "_k": "K",
    "_c": "degC",
    "_s": "s",
}
#: What stands for the only one of things that have no name.
ONLY = "only"

Path = tuple[str, ...]


def leaves(value: Any, path: Path = ()) -> Iterator[tuple[Path, Any]]:
    """Every plain value in a result and where it is: names of fields, keys, or numbers from 1.

    A plain value is a number, a text, an array, a `Measured` or a sequence of such. Results within
    a result, such as the parts of a chain, are left out.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> @dataclass(frozen=True)
    ... class Peak:
    ...     wavelength_nm: float
    ...     height: Measured
    >>> [path for path, _ in leaves({"first": Peak(450.0, Measured(1.0, 0.1))})]
    [('first', 'wavelength_nm'), ('first', 'height')]
    """
    inner = _inner(value)
    if inner is None:
        yield path, value
        return
    for name, one in inner:
        if not isinstance(one, RunResult):
            yield from leaves(one, (*path, name))


def unit_of(name: str) -> str:
    """The unit that the name of a field ends with, that of a σ being its value's; empty if none."""
    base = name.removesuffix("_sigma").replace("_sigma_", "_")
    return next((unit for end, unit in _UNITS.items() if base.endswith(end)), "")


def _inner(value: Any) -> list[tuple[str, Any]] | None:
    """What is in a value; None for a plain one."""
    if isinstance(value, Measured):
        return None
    if isinstance(value, BaseModel):
        return [(name, getattr(value, name)) for name in type(value).model_fields]
    if is_dataclass(value) and not isinstance(value, type):
        return [(one.name, getattr(value, one.name)) for one in fields(value)]
    if isinstance(value, Mapping):
        return [(str(key) or ONLY, one) for key, one in value.items()]
    if isinstance(value, tuple | list) and any(_inner(one) is not None for one in value):
        return [(str(number), one) for number, one in enumerate(value, start=1)]
    return None
