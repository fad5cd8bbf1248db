"""How many pixels have which of the 65536 levels: mean, spread, quantiles in one exact pass."""

import numpy as np
import numpy.typing as npt

from labrig.reduce.noise import Mosaic

#: Pixels below which sorting them is faster than going through all levels.
_FEW_PIXELS = 50_000
#: OpenCV counts into 32-bit floats, which hold whole numbers up to this.
_MOST_PIXELS = 2**24


def histogram(plane: Mosaic) -> npt.NDArray[np.int64]:
    """Number of pixels at each level, shape (65536,)."""
    import cv2  # counts ten times as fast as NumPy

    counts = np.zeros(65536, np.int64)
    for rows in np.array_split(plane, -(-plane.size // _MOST_PIXELS)):
        part = cv2.calcHist([np.ascontiguousarray(rows)], [0], None, [65536], [0, 65536])
        counts += np.asarray(part).ravel().astype(np.int64)
    return counts


def counted(
    plane: Mosaic, left_out: npt.NDArray[np.bool_] | None
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Levels that occur, rising, and in how many pixels but those `left_out` (as `plane`)."""
    if plane.size < _FEW_PIXELS:
        kept = plane if left_out is None else plane[~left_out]
        levels, pixels = np.unique(kept, return_counts=True)
        return levels.astype(np.int64), pixels.astype(np.int64)
    counts = histogram(plane)
    if left_out is not None:
        counts -= np.bincount(plane[left_out], minlength=len(counts))
    occur = np.flatnonzero(counts)
    return occur, counts[occur]
