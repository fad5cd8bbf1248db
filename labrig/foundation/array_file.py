"""Arrays in NumPy's files, held to what their headers state before memory is taken."""

import io
import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO
from zipfile import BadZipFile, ZipFile

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.errors import UsageError
from labrig.foundation.input_file import open_regular
from labrig.foundation.output_file import write_durably

#: Arrays that need no more are read whatever their packing; larger ones need no more than
#: `MAX_UNPACKING` times their file, which no measurement is packed to.
MAX_UNPACKED_BYTES, MAX_UNPACKING = 250_000_000, 4


def read_arrays(path: Path) -> dict[str, NDArray[Any]]:
    """Read the arrays of an `.npz` file by name.

    Raises
    ------
    UsageError
        The file cannot be read, is damaged, has objects, or its arrays need far more memory than
        the file is large.
    """
    with open_regular(path) as stream:
        try:
            with ZipFile(stream) as archive:
                file_bytes = os.fstat(stream.fileno()).st_size
                _hold_to_budget(archive, max(MAX_UNPACKED_BYTES, MAX_UNPACKING * file_bytes))
            stream.seek(0)
            with np.load(stream, allow_pickle=False) as content:
                return {name: content[name] for name in content.files}
        except (
            OSError, KeyError, ValueError, TypeError, AttributeError, EOFError, BadZipFile,
            NotImplementedError, RuntimeError,
        ) as error:  # fmt: skip
            reason = " ".join(str(error).split())
            raise UsageError(f"{path}: expected arrays in a .npz file ({reason})") from None


def write_arrays(path: Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write arrays by name into an `.npz` file, without objects.

    Raises
    ------
    DiskError
        The file cannot be written.
    """
    content = io.BytesIO()
    named: dict[str, Any] = dict(arrays)
    np.savez(content, allow_pickle=False, **named)
    write_durably(path, content.getvalue())


def map_array(path: Path) -> NDArray[Any]:
    """Return the array of an `.npy` file, of which only what is used is read.

    Raises
    ------
    UsageError
        The file cannot be read, is damaged, or has objects.
    """
    open_regular(path).close()
    try:
        array: NDArray[Any] = np.load(path, mmap_mode="r", allow_pickle=False)
    except (OSError, ValueError, TypeError, EOFError) as error:
        raise UsageError(
            f"{path}: expected an array in a .npy file ({' '.join(str(error).split())})"
        ) from None
    return array


def map_numbers(
    path: Path, kind: np.dtype[Any], offset: int, shape: tuple[int, ...]
) -> NDArray[Any]:
    """Return plain numbers of a file, of which only what is used is read.

    Parameters
    ----------
    path
        The file.
    kind
        Kind of the numbers.
    offset
        Bytes before the first one.
    shape
        Shape of their array.

    Raises
    ------
    UsageError
        The file cannot be read, or is shorter.
    """
    with open_regular(path) as stream:
        file_bytes = os.fstat(stream.fileno()).st_size
        expected = offset + math.prod(shape) * kind.itemsize
        if file_bytes < expected:
            raise UsageError(f"{path}: expected {expected} bytes of numbers, got {file_bytes}")
        return np.memmap(stream, kind, "r", offset, shape)


def _hold_to_budget(archive: ZipFile, most_bytes: int) -> None:
    """Refuse arrays that are too large, or larger than the data behind their headers."""
    members = archive.infolist()
    total = sum(member.file_size for member in members)
    if total > most_bytes:
        raise ValueError(f"{total} bytes are more than the {most_bytes} that are read")
    for member in members:
        with archive.open(member) as data:
            header_bytes, array_bytes = _sizes(data)
        if header_bytes + array_bytes > member.file_size:
            raise ValueError(
                f"{member.filename[:40]!r} has {member.file_size} bytes, its header states more"
            )


def _sizes(data: Any) -> tuple[int, int]:
    """Return the sizes in bytes of an array's header and of its numbers."""
    stream: BinaryIO = data
    version = np.lib.format.read_magic(stream)
    read = {
        (1, 0): np.lib.format.read_array_header_1_0,
        (2, 0): np.lib.format.read_array_header_2_0,
    }
    if version not in read:
        raise ValueError(f"an array of version {version}")
    shape, _, kind = read[version](stream)
    if kind.hasobject:
        raise ValueError("objects, which could run code when they are read")
    return stream.tell(), math.prod(shape) * kind.itemsize
