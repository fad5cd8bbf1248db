"""OpenEXR images, held to what their headers state before memory is taken."""

import contextlib
import io
import os
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from labrig.foundation.errors import UsageError
from labrig.foundation.input_file import open_regular
from labrig.foundation.output_file import replaced

#: Pixels that need no more are read whatever their packing: three channels of a 4K picture. Others
#: need no more than `MAX_UNPACKING` times their file, which no rendered picture is packed to.
MAX_UNPACKED_BYTES, MAX_UNPACKING = 100_000_000, 20
_BYTES_OF_NUMBER = 4
#: File descriptor of the process's standard error.
STDERR = 2


def read_exr_header(path: Path) -> dict[str, Any]:
    """Return the attributes of an image of one part, its pixels unread.

    Raises
    ------
    UsageError
        The file cannot be read, is no such image, or its pixels would need far more memory than
        the file is large.
    """
    # The library is loaded when it is needed.
    import OpenEXR

    with open_regular(path) as stream:
        file_bytes = os.fstat(stream.fileno()).st_size
    try:
        with _silenced():
            file = OpenEXR.File(str(path), separate_channels=True, header_only=True)
            headers = [file.header(part) for part in range(len(file.parts))]
        sizes = [_unpacked_bytes(header) for header in headers]
    except (RuntimeError, ValueError, TypeError, MemoryError, KeyError):
        raise UsageError(f"{path}: not an OpenEXR image, or a broken one") from None
    if len(headers) != 1:
        raise UsageError(f"{path}: expected an image of one part, got {len(headers)}")
    most_bytes = max(MAX_UNPACKED_BYTES, MAX_UNPACKING * file_bytes)
    if not 0 < sizes[0] <= most_bytes:
        raise UsageError(
            f"{path}: expected pixels of at most {most_bytes} bytes, its header states {sizes[0]}"
        )
    header: dict[str, Any] = headers[0]
    return header


def read_exr(path: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the attributes of an image of one part, and its channels by name.

    Raises
    ------
    UsageError
        The file is refused by `read_exr_header`, or its pixels are cut or broken.
    """
    import OpenEXR

    header = read_exr_header(path)
    try:
        with _silenced():
            channels: dict[str, Any] = OpenEXR.File(str(path), separate_channels=True).channels()
    except (RuntimeError, ValueError, TypeError, MemoryError, IndexError):
        raise UsageError(
            f"{path}: the image's pixels cannot be read; the file is cut or broken"
        ) from None
    return header, channels


def write_exr(path: Path, header: Mapping[str, Any], channels: Mapping[str, Any]) -> None:
    """Write an image of scan lines in 32-bit numbers, packed without loss.

    Raises
    ------
    DiskError
        The file cannot be written.
    """
    import OpenEXR

    whole = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **header}
    pixels = {
        name: np.ascontiguousarray(values, dtype=np.float32) for name, values in channels.items()
    }
    with replaced(path) as draft:
        try:
            OpenEXR.File(whole, pixels).write(str(draft))
        except RuntimeError as error:
            raise OSError(str(error).partition("\n")[0]) from None


def _unpacked_bytes(header: Mapping[str, Any]) -> int:
    """Return the memory that an image's pixels, or one of its tiles, take; 0 if it has none."""
    low, high = ([int(place) for place in corner] for corner in header["dataWindow"])
    sides = [end - begin + 1 for begin, end in zip(low, high, strict=True)]
    if min(sides) < 1:
        return 0
    pixels = sides[0] * sides[1]
    if (tiles := header.get("tiles")) is not None:
        pixels = max(pixels, int(tiles.xSize) * int(tiles.ySize))
    return pixels * len(header["channels"]) * _BYTES_OF_NUMBER


@contextlib.contextmanager
def _silenced() -> Iterator[None]:
    """Keep back what the library writes of broken pixels, in the midst of what labrig says.

    Pixels are compressed: that some are broken is known only while the library reads them. It
    writes to Python's standard output, and past Python to the process's standard error.
    """
    sys.stderr.flush()
    kept = os.dup(STDERR)
    try:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, STDERR)
        os.close(nowhere)
        with contextlib.redirect_stdout(io.StringIO()):
            yield
    finally:
        os.dup2(kept, STDERR)
        os.close(kept)
