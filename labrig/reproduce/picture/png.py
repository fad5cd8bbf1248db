"""PNG files that say how their colours came about."""

import struct
import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.errors import UsageError
from labrig.foundation.output_file import write_durably

Bytes = NDArray[np.uint8]

#: Signature and the chunk IHDR, which has to be the first.
_HEAD_BYTES = 33
#: Rendering intent of the chunk sRGB: relative colorimetric.
_RELATIVE_COLORIMETRIC = b"\x01"


def write_png(path: Path, picture: Bytes, texts: Mapping[str, str]) -> None:
    """Write a picture with texts, such as its display transform.

    Parameters
    ----------
    path
        Path of the file; it is replaced at once, so that no half of a picture is left.
    picture
        Bytes of sRGB, shape (height, width, 3), top row first.
    texts
        Text of each keyword, such as `Comment`; keywords have 1 to 79 Latin letters.

    Raises
    ------
    UsageError
        The picture has another shape, or a keyword is not possible.
    DiskError
        The file cannot be written.

    Examples
    --------
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from PIL import Image
    >>> from labrig.reproduce import Display, write_png
    >>> transform = Display(white_luminance=80.0).statement
    >>> write_png(Path("dark.png"), np.zeros((2, 3, 3), np.uint8), {"Display transform": transform})
    >>> with Image.open("dark.png") as image:
    ...     image.info["Display transform"][:42]
    'sRGB (IEC 61966-2-1), D65 of luminance 80 '
    """
    # slow to load
    import cv2

    if picture.ndim != 3 or picture.shape[2] != 3 or picture.dtype != np.uint8 or not picture.size:
        raise UsageError(
            f"{path}: expected bytes of shape (height, width, 3), got {picture.dtype} of "
            f"{picture.shape}"
        )
    good, encoded = cv2.imencode(".png", picture[..., ::-1])
    if not good:
        raise RuntimeError("OpenCV could not encode a PNG")
    content = encoded.tobytes()
    chunks = [_chunk(b"sRGB", _RELATIVE_COLORIMETRIC)]
    chunks += [_chunk(b"iTXt", _text(*pair)) for pair in texts.items()]
    write_durably(path, content[:_HEAD_BYTES] + b"".join(chunks) + content[_HEAD_BYTES:])


def _chunk(kind: bytes, data: bytes) -> bytes:
    checksum = zlib.crc32(kind + data)
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", checksum)


def _text(keyword: str, text: str) -> bytes:
    """Return the data of a chunk iTXt: uncompressed UTF-8, no language."""
    if not 1 <= len(keyword) <= 79 or not keyword.isascii() or not keyword.isprintable():
        raise UsageError(f"expected a keyword of 1 to 79 Latin letters, got '{keyword}'")
    return keyword.encode("ascii") + b"\0\0\0\0\0" + text.replace("\0", "").encode()
