"""Any result in a NeXus file, field by field: numbers with their units, and texts."""

from typing import Any

import h5py
import numpy as np

from labrig.export.hdf5 import add_group, add_number, add_text
from labrig.export.nexus_decay import valid_names
from labrig.results import Measured, RunResult, leaves, unit_of


def add_fields(entry: h5py.Group, result: RunResult, name: str, version: str) -> None:
    """An NXprocess `name` with the fields of a result; those of fields in groups of their own."""
    (valid,) = valid_names([name])
    process = add_group(entry, valid, "NXprocess")
    add_text(process, "program", "labrig")
    add_text(process, "version", version)
    for path, value in leaves(result):
        group = process
        *groups, last = _valid("result", *path)
        for one in groups:
            group = group[one] if one in group else add_group(group, one, "NXcollection")
        if value is not None:
            _add(group, last, path[-1], value)


def _valid(*names: str) -> list[str]:
    """Each as NeXus allows it; names on one path may be the same."""
    return [valid_names([name])[0] for name in names]


def _add(group: h5py.Group, name: str, field: str, value: Any) -> None:
    """Numbers or texts of any shape; what is neither is written as text."""
    if isinstance(value, Measured):
        add_number(group, name, value.value, value.unit)
        add_number(group, f"{name}_errors", value.sigma, value.unit)
        return
    if isinstance(value, str):
        add_text(group, name, value)
        return
    try:
        numbers = np.asarray(value)
    except ValueError:
        numbers = np.asarray(None)
    if numbers.dtype.kind in "iuf":
        add_number(group, name, numbers, unit_of(field))
    elif numbers.dtype.kind == "b":
        add_number(group, name, numbers.astype(np.int8))
    elif isinstance(value, tuple | list):
        add_text(group, name, [str(one) for one in value])
    else:
        add_text(group, name, str(value))
