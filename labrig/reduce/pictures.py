"""RAW frames binned to small pictures."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from labrig.reduce.linear_frame import LinearFrame, cell_means_dn, saturated_cells
from labrig.reduce.raw import RawFrame

Picture = NDArray[np.float32]

JPEG_QUALITY = 88


def is_grey(raw: RawFrame) -> bool:
    """Return whether the sensor is monochrome.

    Parameters
    ----------
    raw
        The RAW frame.

    Returns
    -------
    bool
        True if the sensor has no colour filters.

    Examples
    --------
    >>> from pathlib import Path
    >>> import labrig
    >>> from labrig.reduce import is_grey
    >>> raw = labrig.read_raw("frame.dng")
    >>> raw.cfa, is_grey(raw)
    ('RGGB', False)
    """
    return len(raw.channels) == 1


def binned(raw: RawFrame) -> Picture:
    """Bin a RAW frame to one RGB value for each cell of the colour filter.

    Parameters
    ----------
    raw
        The RAW frame.

    Returns
    -------
    ndarray of float32
        R, G and B above black as fractions of the saturation level; (height / 2, width / 2, 3) of a
        Bayer sensor. A monochrome sensor has three equal values.

    Examples
    --------
    >>> from pathlib import Path
    >>> import labrig
    >>> from labrig.reduce import binned
    >>> picture = binned(labrig.read_raw("frame.dng"))
    >>> picture.shape
    (32, 48, 3)
    >>> [f"{fraction:.0%}" for fraction in picture[16, 24]]
    ['1%', '4%', '2%']
    """
    picture = cell_means_dn(raw)
    picture /= np.float32(raw.white - max(raw.black))
    return np.repeat(picture, 3, axis=-1) if is_grey(raw) else picture


def small(picture: Picture, width: int) -> Picture:
    """Average a picture down to a width.

    Parameters
    ----------
    picture
        Picture of any unit, shape (height, width, 3).
    width
        Width of the smaller picture in pixels; a picture of this width or less stays as it is.

    Returns
    -------
    ndarray of float32
        The picture at the same aspect ratio, `width` pixels wide at most.

    Examples
    --------
    >>> from pathlib import Path
    >>> import labrig
    >>> from labrig.reduce import binned, small
    >>> picture = binned(labrig.read_raw("frame.dng"))
    >>> picture.shape, small(picture, width=24).shape
    ((32, 48, 3), (16, 24, 3))
    """
    import cv2  # takes a tenth of a second to load

    height_in, width_in = picture.shape[:2]
    if width_in <= width:
        return picture
    size = (width, max(1, round(height_in * width / width_in)))
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA))


def jpeg(rgb: NDArray[np.uint8]) -> bytes:
    """Encode a picture as JPEG.

    Parameters
    ----------
    rgb
        Picture with 8 bits a channel, shape (height, width, 3).

    Returns
    -------
    bytes
        The content of a JPEG file.

    Raises
    ------
    RuntimeError
        OpenCV cannot encode the picture.

    Examples
    --------
    >>> from pathlib import Path
    >>> import numpy as np
    >>> import labrig
    >>> from labrig.reduce import binned, jpeg
    >>> picture = binned(labrig.read_raw("frame.dng"))
    >>> content = jpeg(np.uint8(255 * np.clip(picture, 0, 1)))
    >>> content[6:10]
    b'JFIF'
    """
    import cv2

    return _encoded(rgb, ".jpg", [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])


def png(rgb: NDArray[np.uint8]) -> bytes:
    """Encode a picture as PNG.

    Parameters
    ----------
    rgb
        Picture with 8 bits a channel, shape (height, width, 3).

    Returns
    -------
    bytes
        The content of a PNG file.

    Raises
    ------
    RuntimeError
        OpenCV cannot encode the picture.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.reduce import png
    >>> png(np.zeros((2, 3, 3), np.uint8))[1:4]
    b'PNG'
    """
    return _encoded(rgb, ".png", [])


def _encoded(rgb: NDArray[np.uint8], suffix: str, settings: Sequence[int]) -> bytes:
    import cv2

    good, data = cv2.imencode(suffix, rgb[..., ::-1], settings)
    if not good:
        raise RuntimeError(f"OpenCV could not encode a picture as {suffix}")
    return data.tobytes()


@dataclass(frozen=True, eq=False)
class Thumbnail:
    """A small picture of a frame.

    Attributes
    ----------
    rgb
        R, G and B above black as fractions of the saturation level, shape (rows, columns, 3). Half
        precision, 11 bits at any brightness, is finer than what a screen shows.
    is_saturated
        Whether most cells in each pixel are saturated, shape (rows, columns).
    is_grey
        Whether the sensor is monochrome.
    width, height
        Size of the frame in pixels.
    make, model
        Camera by EXIF; None where absent.
    """

    rgb: NDArray[np.float16]
    is_saturated: NDArray[np.bool_]
    is_grey: bool
    width: int
    height: int
    make: str | None
    model: str | None


@dataclass(frozen=True)
class MakeThumbnail:
    """Averaging of a frame to a small picture.

    Attributes
    ----------
    columns
        Width of the picture in pixels.
    """

    columns: int

    def __call__(self, frames: Iterator[RawFrame]) -> Thumbnail:
        """Average the frame to a small picture."""
        raw = next(frames)
        return Thumbnail(
            small(binned(raw), self.columns).astype(np.float16),
            small(saturated_cells(raw).astype(np.float32), self.columns) > 0.5,
            is_grey(raw),
            raw.width,
            raw.height,
            raw.make,
            raw.model,
        )


@dataclass(frozen=True)
class SaturatedFraction:
    """Count of the saturated pixels of a frame."""

    def __call__(self, frames: Iterator[RawFrame]) -> float:
        """Return the fraction of the frame's pixels that are saturated."""
        return float(LinearFrame(next(frames)).is_saturated().mean())
