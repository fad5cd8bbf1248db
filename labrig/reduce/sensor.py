"""The filter colours and black levels of an open RAW file, from its first visible pixel."""

from typing import Any

import numpy as np

from labrig.errors import FrameError
from labrig.reduce.cfa import MONOCHROME, Letters, smallest_square
from labrig.reduce.dng import DngPattern, read_dng
from labrig.reduce.noise import Floats

#: LibRaw's colour numbers: the second green, in the blue's row, is 3.
_RGBG = "RGBG"
#: LibRaw's number of the channel whose black level stands for each letter.
_BLACK_NUMBER = {"R": 0, "G": 1, "B": 2, MONOCHROME: 0}
#: Rows of an X-Trans pattern.
_X_TRANS = 6


def sensor_pattern(raw: Any, dng: bytes | None) -> tuple[str, tuple[float, ...]]:
    """`cfa` and `black` of a `RawFrame`.

    Parameters
    ----------
    raw
        An open rawpy file.
    dng
        Its bytes if it is a DNG, whose own tags then go before what LibRaw makes of them.

    Raises
    ------
    FrameError
        The sensor has other colours, or no pattern that is known for certain.
    """
    if dng is not None:
        found = read_dng(dng, raw.sizes.raw_height, raw.sizes.raw_width)
        if found is not None:
            return smallest_square(*_from_first_pixel(raw, found))
    return smallest_square(*_by_libraw(raw))


def _from_first_pixel(raw: Any, found: DngPattern) -> tuple[Letters, Floats]:
    """Both repeats of a DNG, shifted to where LibRaw's visible part begins."""
    shift = (found.corner[0] - raw.sizes.top_margin, found.corner[1] - raw.sizes.left_margin)
    colours = np.roll(found.colours, shift, axis=(0, 1))
    if found.black is not None:
        return colours, np.roll(found.black, shift, axis=(0, 1))
    # LibRaw then has measured it in the masked borders, or knows the camera.
    by_number = raw.black_level_per_channel
    numbers = [_BLACK_NUMBER.get(str(letter), 0) for letter in colours.flat]
    return colours, np.array([float(by_number[i]) for i in numbers]).reshape(colours.shape)


def _by_libraw(raw: Any) -> tuple[Letters, Floats]:
    """Colours and black levels as LibRaw says; its patterns begin at the first visible pixel."""
    pattern, levels = raw.raw_pattern, raw.black_level_per_channel
    if pattern is None or pattern.shape == (1, 1):
        return np.array([[MONOCHROME]]), np.array([[float(levels[0])]])
    names = raw.color_desc.decode("ascii", "replace")
    if names != _RGBG:
        raise FrameError(
            f"expected a sensor with filters of red, green and blue, got {names}; "
            "labrig cannot reduce this kind of sensor"
        )
    margins = (raw.sizes.top_margin, raw.sizes.left_margin)
    if len(pattern) == _X_TRANS and any(margin % _X_TRANS for margin in margins):
        # LibRaw and rawpy then count the pattern's rows from different ones.
        raise FrameError(
            "expected an X-Trans pattern whose repeats begin at the border, got margins "
            f"{margins}; convert the file to DNG"
        )
    colours = np.array(list(names))[pattern]
    return colours, np.asarray(levels, dtype=np.float64)[pattern]
