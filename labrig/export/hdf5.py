"""NeXus in HDF5: groups with a class, fields with units; the same content gives the same bytes."""

from collections.abc import Sequence

import h5py
import numpy as np
from numpy.typing import ArrayLike

TEXT = h5py.string_dtype()


def add_group(parent: h5py.Group, name: str, nx_class: str) -> h5py.Group:
    """A new group of that NeXus class."""
    group = parent.create_group(name)
    group.attrs["NX_class"] = nx_class
    return group


def add_number(
    group: h5py.Group, name: str, value: ArrayLike, units: str = "", long_name: str = ""
) -> h5py.Dataset:
    """A new field of numbers, without units a pure one.

    Parameters
    ----------
    long_name
        What a plot writes at its axis.
    """
    field = group.create_dataset(name, data=np.asarray(value), track_times=False)
    field.attrs["units"] = units
    if long_name:
        field.attrs["long_name"] = long_name
    return field


def add_text(group: h5py.Group, name: str, value: str | Sequence[str]) -> h5py.Dataset:
    """A new field of one text or several."""
    data = value if isinstance(value, str) else np.array(value, dtype=object)
    return group.create_dataset(name, data=data, dtype=TEXT, track_times=False)


def add_note(parent: h5py.Group, name: str, text: str, kind: str, file_name: str = "") -> None:
    """A new NXnote: a text with its media type, and the file that it is."""
    note = add_group(parent, name, "NXnote")
    add_text(note, "type", kind)
    if file_name:
        add_text(note, "file_name", file_name)
    add_text(note, "data", text)
