"""Values of slices moved to where the slices' light is known.

A slice consists of whole pixels, and of a Bayer cell's colours some lie left of others: what a
channel shows of a slice belongs to a place up to a pixel away from the slice's middle. Along the
filter the glow is steep, so that a pixel matters where slices are a few pixels wide.
"""

import numpy as np
from numpy.typing import NDArray

from labrig.analyse.strip_patches import Slices, lean
from labrig.calibration.lvf_file import Strip
from labrig.reduce import RawFrame
from labrig.region import Region, region_pixels

FloatArray = NDArray[np.float64]


def centred(
    values: FloatArray,
    slices: Slices,
    position: FloatArray,
    strip: Strip,
    raw: RawFrame,
) -> FloatArray:
    """Values (n, P, C) at the positions (P,) along the strip, by the slope to the neighbours.

    Parameters
    ----------
    slices
        Where the values were measured.
    raw
        Any frame: its size and colours.
    """
    along = position if strip.rising else 1 - position
    left, right = strip.left[0] * raw.width, strip.right[0] * raw.width
    wanted = left + (along - lean(strip, slices, raw)) * (right - left)
    moved = values.copy()
    for number, channel in enumerate(raw.channels):
        x = np.array([_middle(region, raw, channel) for region in slices.values()])
        slope = np.nan_to_num(np.gradient(values[..., number], x, axis=1))
        moved[..., number] += slope * (wanted - x)
    return moved


def _middle(region: Region, raw: RawFrame, channel: str) -> float:
    """Mean place in x of the pixels of that channel in a region, their middles at .5."""
    x, y, width, height = region_pixels(region, raw.width, raw.height)
    side = raw.cfa_side
    colours = np.array(list(raw.cfa)).reshape(side, side)
    rows, columns = np.arange(y, y + height) % side, np.arange(x, x + width)
    own = colours[np.ix_(rows, columns % side)] == channel
    found = own.sum(axis=0)
    return float((found * (columns + 0.5)).sum() / found.sum())
