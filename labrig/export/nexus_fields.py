"""Any result in a NeXus file, field by field: numbers with their units, and texts."""

from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import h5py
import numpy as np
from pydantic import BaseModel

from labrig.export.hdf5 import add_group, add_number, add_text
from labrig.export.nexus_decay import valid_names
from labrig.results import Measured, RunResult

#: Ends of the names of fields, longest first, and the unit that they stand for.
UNITS = {
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


def add_fields(entry: h5py.Group, result: RunResult, name: str, version: str) -> None:
    """An NXprocess `name` with the fields of a result; those of fields in groups of their own."""
    (valid,) = valid_names([name])
    process = add_group(entry, valid, "NXprocess")
    add_text(process, "program", "labrig")
    add_text(process, "version", version)
    _add(process, "result", result)


def _add(parent: h5py.Group, name: str, value: Any) -> None:
    if isinstance(value, Measured):
        add_number(parent, name, value.value, value.unit)
        add_number(parent, f"{name}_errors", value.sigma, value.unit)
    elif (inner := _inner(value)) is not None:
        group = add_group(parent, name, "NXcollection")
        for valid, (_, one) in zip(valid_names([key for key, _ in inner]), inner, strict=True):
            _add(group, valid, one)
    elif isinstance(value, str):
        add_text(parent, name, value)
    elif value is not None:
        _add_values(parent, name, value)


def _inner(value: Any) -> list[tuple[str, Any]] | None:
    """Fields of a value that has some; None for a plain one."""
    if isinstance(value, RunResult) and hasattr(value, "parts"):
        return [pair for pair in _fields(value) if pair[0] != "parts"]
    if is_dataclass(value) or isinstance(value, BaseModel):
        return list(_fields(value))
    if isinstance(value, Mapping):
        return [(str(key) or "only", one) for key, one in value.items()]
    if isinstance(value, tuple | list) and any(
        is_dataclass(one) or isinstance(one, BaseModel | Mapping) for one in value
    ):
        return [(str(number), one) for number, one in enumerate(value, start=1)]
    return None


def _fields(value: Any) -> Iterator[tuple[str, Any]]:
    names = type(value).model_fields if isinstance(value, BaseModel) else None
    for name in names or [one.name for one in fields(value)]:
        yield name, getattr(value, name)


def _add_values(parent: h5py.Group, name: str, value: Any) -> None:
    """Numbers or texts of any shape; what is neither is written as text."""
    try:
        numbers = np.asarray(value)
    except ValueError:
        numbers = np.asarray(None)
    if numbers.dtype.kind in "iuf":
        unit = next((unit for end, unit in UNITS.items() if _base(name).endswith(end)), "")
        add_number(parent, name, numbers, unit)
    elif numbers.dtype.kind == "b":
        add_number(parent, name, numbers.astype(np.int8))
    elif isinstance(value, tuple | list):
        add_text(parent, name, [str(one) for one in value])
    else:
        add_text(parent, name, str(value))


def _base(name: str) -> str:
    """The field that a σ belongs to."""
    return name.removesuffix("_sigma").replace("_sigma_", "_")
