"""The level from which pixels are saturated, and the number of them that clips a region.

Some sensors, and most at their lowest ISO, saturate below the white level of their file. Then all
pixels that would be brighter pile up at one level, the brightest of the frame. Pixels that are not
saturated do not: photon noise alone spreads them over tens of levels there. The saturation level is
therefore determined from the frame where the file's white level is not reached.
"""

import numpy as np
import numpy.typing as npt

from labrig.reduce.plane_noise import Mosaic

#: Pixels below which sorting them is faster than going through all levels.
_FEW_PIXELS = 50_000
#: OpenCV counts into 32-bit floats, which hold whole numbers up to this.
_MAX_PIXELS = 2**24


def histogram(plane: Mosaic) -> npt.NDArray[np.int64]:
    """Return the number of pixels at each level, shape (65536,)."""
    import cv2  # counts ten times as fast as NumPy

    counts = np.zeros(65536, np.int64)
    for rows in np.array_split(plane, -(-plane.size // _MAX_PIXELS)):
        part = cv2.calcHist([np.ascontiguousarray(rows)], [0], None, [65536], [0, 65536])
        counts += np.asarray(part).ravel().astype(np.int64)
    return counts


def count_levels(
    plane: Mosaic, left_out: npt.NDArray[np.bool_] | None
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Count the pixels at each level that occurs.

    Parameters
    ----------
    plane
        Pixels in DN.
    left_out
        Pixels to leave out, in the shape of `plane`; None leaves out none.

    Returns
    -------
    tuple of ndarray
        Levels that occur, rising, and the number of pixels at each.
    """
    if plane.size < _FEW_PIXELS:
        kept = plane if left_out is None else plane[~left_out]
        levels, pixels = np.unique(kept, return_counts=True)
        return levels.astype(np.int64), pixels.astype(np.int64)
    counts = histogram(plane)
    if left_out is not None:
        counts -= np.bincount(plane[left_out], minlength=len(counts))
    occur = np.flatnonzero(counts)
    return occur, counts[occur]


#: Fraction of a region's pixels, of one colour, that may be saturated; see `is_clipped`.
CLIPPED_FRACTION = 0.001

#: Fraction of the range above black below which a plateau is not saturation.
_MIN_FULL = 0.5
#: Fraction of the frame's pixels, and number of pixels, that a plateau holds at least.
_MIN_FRACTION = 1e-4
_MIN_PIXELS = 50
#: Pixels of a plateau over those of any of the levels next below it.
_STANDS_OUT = 10
#: Number of these levels, of those that occur (compressed files leave levels out). A frame with
#: fewer levels has no noise and is no photograph: its saturation level remains the file's.
_LEVELS_BELOW = 16


def is_clipped(saturated: npt.ArrayLike, pixels: npt.ArrayLike) -> npt.NDArray[np.bool_]:
    """Return whether saturated pixels make the mean of a region too small.

    A region is clipped if more than 0.1 % of its pixels are saturated. Fewer say nothing about the
    light: a sensor's hot pixels are up to that many, and in a long exposure they are full at any
    light. Nor do fewer bias the mean: noise whose tail beyond white holds 0.1 % of the pixels lacks
    3e-4 of a pixel's standard deviation in the mean, and highlights twice as bright as white lack
    0.1 % of white, a seventh of a shutter's flicker.

    Parameters
    ----------
    saturated
        Number of pixels of one colour at white or above, of any shape.
    pixels
        Number of pixels of that colour, of the same shape.

    Returns
    -------
    ndarray of bool
        True where the region is clipped, of the shape of `saturated`.

    Examples
    --------
    >>> from labrig.reduce import is_clipped
    >>> is_clipped([0, 1, 5], [1000, 1000, 1000]).tolist()
    [False, False, True]
    """
    return np.asarray(np.asarray(saturated) > CLIPPED_FRACTION * np.asarray(pixels))


def clip_level(mosaic: Mosaic, black: float, white: float) -> float:
    """Return the saturation level: `white`, or the level below it at which the frame's pixels clip.

    Parameters
    ----------
    mosaic
        The whole visible frame in DN.
    black, white
        Black and white level of the file in DN.
    """
    highest = int(mosaic.max())
    lowest = black + _MIN_FULL * (white - black)
    least = max(_MIN_FRACTION * mosaic.size, _MIN_PIXELS)
    if not lowest < highest < white or np.count_nonzero(mosaic == highest) < least:
        return white  # nearly every frame: the histogram would take ten times as long
    counts = histogram(mosaic)
    below = np.flatnonzero(counts)[-1 - _LEVELS_BELOW : -1]
    if len(below) < _LEVELS_BELOW:
        return white
    return float(highest) if counts[highest] >= _STANDS_OUT * counts[below].max() else white
