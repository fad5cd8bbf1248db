"""Reading of pictures, held to the size that their headers state before memory is taken."""

import io
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.errors import UsageError
from labrig.foundation.input_file import MAX_PICTURE_BYTES, read_bytes

#: Formats that are read, as Pillow calls them.
FORMATS = ("PNG", "JPEG", "TIFF", "BMP", "WEBP")
#: Pixels of the largest cameras; three bytes of each are taken some times over.
MAX_PIXELS = 60_000_000


def read_picture(path: Path, purpose: str) -> NDArray[np.uint8]:
    """Read a picture as a screen shows it.

    Parameters
    ----------
    path
        Path of the file.
    purpose
        Need for the picture, for messages, such as `for 'appearance_file'`.

    Returns
    -------
    ndarray
        Bytes of R, G and B, shape (height, width, 3), top row first.

    Raises
    ------
    UsageError
        There is no such file, it is no picture, or a larger one than is read.
    """
    content = read_bytes(path, MAX_PICTURE_BYTES)
    try:
        width, height = _stated_size(content)
    except Exception:  # a damaged file can fail anywhere in Pillow, with any exception
        raise UsageError(
            f"{path}: expected a picture {purpose} ({', '.join(FORMATS)}), got another file or a "
            "damaged one"
        ) from None
    if width * height > MAX_PIXELS:
        raise UsageError(
            f"{path}: expected a picture of at most {MAX_PIXELS} pixels {purpose}, its header "
            f"states {width} × {height}"
        )
    picture = decoded(content)
    if picture is None:
        raise UsageError(f"{path}: expected a picture {purpose}, got a damaged one")
    return picture


def decoded(content: bytes) -> NDArray[np.uint8] | None:
    """Return R, G and B of a picture of known size, shape (height, width, 3); None if damaged."""
    import cv2  # slow to load

    try:
        picture: Any = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR)
    except cv2.error:  # such as of nothing, or of more than it reads
        return None
    return None if picture is None else np.asarray(picture[..., ::-1], dtype=np.uint8)


def _stated_size(content: bytes) -> tuple[int, int]:
    """Return width and height in pixels that a picture's header states."""
    from PIL import Image

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of many pixels, which are judged by the caller
        with Image.open(io.BytesIO(content), formats=FORMATS) as picture:
            size: tuple[int, int] = picture.size
    return size
