"""Filter colours and black levels of a DNG file, by its own tags (DNG 1.6, chapter 4).

LibRaw reads DNG, too, but moves an odd corner of the active area to an even one and then pairs
black levels with the wrong pixels; it replaces the file's black level by the mean of masked
borders, supports one black level per colour, and misreads patterns larger than it supports.
"""

import io
import logging
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, TypeAlias, TypeVar

import numpy as np
import numpy.typing as npt

from labrig.foundation.errors import FrameError
from labrig.reduce.plane_noise import Floats

Letters: TypeAlias = npt.NDArray[np.str_]
Scalar = TypeVar("Scalar", np.str_, np.float64)

#: The one channel of a sensor without colour filters.
MONOCHROME = "L"
#: Largest period: X-Trans repeats after 6 pixels; beyond 12, too few pixels share a position.
_MAX_SIDE = 12


def side_of(cfa: str) -> int:
    """Return the side, in pixels, of the square that `cfa` spells row by row."""
    return math.isqrt(len(cfa))


def channels_of(cfa: str) -> tuple[str, ...]:
    """Return the names of the channels in `cfa`: R, G, B in this order, or L."""
    return (MONOCHROME,) if set(cfa) == {MONOCHROME} else ("R", "G", "B")


def smallest_square(colours: Letters, black: Floats) -> tuple[str, tuple[float, ...]]:
    """Return letters and black levels of the smallest square that repeats both, row by row.

    Parameters
    ----------
    colours
        One letter per pixel, repeating from the first visible pixel, shape (rows, columns).
    black
        Black levels in DN; their numbers of rows and columns may differ from those of `colours`.

    Raises
    ------
    FrameError
        The period of both together is too large to be reduced.
    """
    side = math.lcm(*colours.shape, *black.shape)
    if side > _MAX_SIDE:
        raise FrameError(
            f"expected colours and black levels that repeat after {_MAX_SIDE} pixels or fewer, "
            f"got {side}; labrig cannot reduce this kind of sensor"
        )
    letters, levels = _repeat(colours, side), _repeat(black, side)
    for shorter in (length for length in range(1, side) if side % length == 0):
        corner = (slice(shorter), slice(shorter))
        if np.array_equal(_repeat(letters[corner], side), letters) and np.array_equal(
            _repeat(levels[corner], side), levels
        ):
            letters, levels = letters[corner], levels[corner]
            break
    return "".join(letters.ravel().tolist()), tuple(levels.ravel().tolist())


def _repeat(tile: npt.NDArray[Scalar], side: int) -> npt.NDArray[Scalar]:
    return np.tile(tile, (side // tile.shape[0], side // tile.shape[1]))


#: PhotometricInterpretation of mosaics, and of images with all their colours in every pixel:
#: of one, from a sensor without filters.
_CFA, _LINEAR_RAW = 32803, 34892
_REPEAT, _PATTERN, _LAYOUT = 33421, 33422, 50711
_BLACK_REPEAT, _BLACK, _BLACK_BY_COLUMN, _BLACK_BY_ROW = 50713, 50714, 50715, 50716
_ACTIVE_AREA = 50829
#: Letters of the codes in CFAPattern: red to white. Only the first three can be reduced.
_COLOURS = "RGBCMYW"
_RECTANGULAR = 1
#: TIFF's types of fractions.
_FRACTIONS = (5, 10)


@dataclass(frozen=True, eq=False)
class DngPattern:
    """Repeating pattern of a sensor.

    Parameters
    ----------
    corner
        Row and column of the sensor where the repeats begin.
    colours
        Letter of each pixel's colour, shape (rows, columns).
    black
        Black levels in DN, whose shape (rows, columns) may differ from that of `colours`; None if
        the file has none.
    """

    corner: tuple[int, int]
    colours: Letters
    black: Floats | None


def read_dng(content: bytes, height: int, width: int) -> DngPattern | None:
    """Read the pattern of the raw image of a DNG, masked borders included.

    Parameters
    ----------
    content
        The bytes of the file.
    height, width
        Size of the raw image in pixels.

    Returns
    -------
    DngPattern or None
        Colours and black levels; None if the file has no such image.

    Raises
    ------
    FrameError
        The rows of the sensor are staggered.
    """
    import tifffile  # exifread does not look into the sub-images, where many a DNG has its raw one

    # tifffile warns through logging of every odd tag; the relevant ones are checked here.
    logging.getLogger("tifffile").setLevel(logging.CRITICAL)
    # tifffile's objects refer to one another and would keep the bytes of data that are not closed.
    with io.BytesIO(content) as data, tifffile.TiffFile(data) as file:
        for page in _pages(file):
            if (page.imagelength, page.imagewidth) == (height, width):
                if page.photometric == _CFA:
                    return _pattern(page.tags, _mosaic_colours(page.tags))
                if page.photometric == _LINEAR_RAW and page.samplesperpixel == 1:
                    return _pattern(page.tags, np.array([[MONOCHROME]]))
    return None


def _pages(file: Any) -> Iterator[Any]:
    """Iterate over the first image of an open file, often a preview, and those inside it."""
    yield file.pages[0]
    yield from file.pages[0].pages or ()


def _mosaic_colours(tags: Any) -> Letters:
    if _numbers(tags, _LAYOUT, [_RECTANGULAR]) != [_RECTANGULAR]:
        raise FrameError(
            "expected pixels in rows and columns, got staggered ones (Super CCD); "
            "labrig cannot reduce this kind of sensor"
        )
    rows, columns = (int(number) for number in _numbers(tags, _REPEAT))
    letters = [_COLOURS[int(code)] for code in _numbers(tags, _PATTERN)]
    return np.array(letters).reshape(rows, columns)


def _pattern(tags: Any, colours: Letters) -> DngPattern:
    top, left = (int(number) for number in _numbers(tags, _ACTIVE_AREA, [0, 0, 0, 0])[:2])
    black = None
    if _BLACK in tags:
        rows, columns = (int(number) for number in _numbers(tags, _BLACK_REPEAT, [1, 1]))
        black = np.array(_numbers(tags, _BLACK)).reshape(rows, columns)
        # The level of single rows and columns: only its mean belongs to what repeats.
        for tag in (_BLACK_BY_COLUMN, _BLACK_BY_ROW):
            black = black + np.mean(_numbers(tags, tag, [0]))
    return DngPattern((top, left), colours, black)


def _numbers(tags: Any, code: int, absent: list[float] | None = None) -> list[float]:
    """Return the values of a tag.

    Parameters
    ----------
    tags
        Tags of an image.
    code
        Number of the tag.
    absent
        Values if the tag is absent; None requires it.

    Raises
    ------
    ValueError
        The tag is absent and has no default.
    """
    tag = tags.get(code)
    if tag is None:
        if absent is None:
            raise ValueError(f"tag {code} is missing")
        return absent
    values = list(tag.value) if isinstance(tag.value, tuple | bytes) else [tag.value]
    if tag.dtype in _FRACTIONS:
        return [values[i] / values[i + 1] for i in range(0, len(values), 2)]
    return [float(value) for value in values]
