"""Pixels that stand out alone: hot pixels and cosmic rays, in a frame with light."""

from collections.abc import Mapping
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from labrig.reduce.noise import Floats, Mosaic, PlaneNoise

Indices: TypeAlias = npt.NDArray[np.intp]

#: Standard deviations by which an outlier exceeds the median of its neighbours …
OUTLIER_SIGMAS = 8.0
#: … and the greatest of them, so that an edge of the sample is none.
_ABOVE_ALL_SIGMAS = 4.0
#: Where the nearest pixels of the same CFA position are, in repeats of the CFA.
_NEIGHBOURS = [(y, x) for y in (-1, 0, 1) for x in (-1, 0, 1) if (y, x) != (0, 0)]


def isolated_outliers(
    window: Mosaic,
    corner: tuple[int, int],
    side: int,
    noises: Mapping[tuple[int, int], PlaneNoise],
) -> tuple[Indices, Indices]:
    """Rows and columns, on the sensor, of the outliers in `window`.

    Parameters
    ----------
    window
        Part of a mosaic, at least three repeats of the CFA wide and high.
    corner
        Row and column of its first pixel on the sensor.
    side
        Pixels after which the CFA repeats: 2 of a Bayer sensor.
    noises
        Noise of each CFA position by row and column within the repeat.
    """
    import cv2  # SIMD over the whole mosaic: 20 ms for 21 megapixels

    kernel = np.zeros((2 * side + 1, 2 * side + 1), np.uint8)
    for down, right in _NEIGHBOURS:
        kernel[(down + 1) * side, (right + 1) * side] = 1
    greatest = np.asarray(cv2.dilate(window, kernel))
    excess = np.asarray(cv2.subtract(window, greatest))

    def limit(levels: Floats) -> Floats:
        quietest = np.min([noise.variance_at(levels) for noise in noises.values()], axis=0)
        return np.asarray(_ABOVE_ALL_SIGMAS * np.sqrt(quietest))

    # By a row's darkest, then by level, then by the noise of their own plane: few are left.
    least = np.minimum(limit(window.min(axis=1).astype(np.float64)), 65535).astype(np.uint16)
    passed = np.flatnonzero(excess > least[:, np.newaxis])
    passed = passed[excess.ravel()[passed] > limit(greatest.ravel()[passed].astype(np.float64))]
    y, x = np.divmod(passed, window.shape[1])
    level = greatest[y, x].astype(np.float64)
    alone = excess[y, x] > _ABOVE_ALL_SIGMAS * _deviation(
        level, y + corner[0], x + corner[1], side, noises
    )
    y, x = y[alone], x[alone]
    level = _median_of_neighbours(window, y, x, side)
    far = window[y, x] > level + OUTLIER_SIGMAS * _deviation(
        level, y + corner[0], x + corner[1], side, noises
    )
    return y[far] + corner[0], x[far] + corner[1]


def _deviation(
    level: Floats,
    y: Indices,
    x: Indices,
    side: int,
    noises: Mapping[tuple[int, int], PlaneNoise],
) -> Floats:
    """Standard deviation of the noise at `level` in the pixels (y, x) of the sensor."""
    variance = np.zeros(len(level))
    for (row, column), noise in noises.items():
        here = (y % side == row) & (x % side == column)
        variance[here] = noise.variance_at(level[here])
    return np.sqrt(variance)


def _median_of_neighbours(window: Mosaic, y: Indices, x: Indices, side: int) -> Floats:
    """Median of the eight same-position neighbours; beyond a border, of the opposite ones."""
    values = np.empty((len(_NEIGHBOURS), len(y)))
    for values_there, repeats in zip(values, _NEIGHBOURS, strict=True):
        down, right = (number * side for number in repeats)
        row, column = y + down, x + right
        row = np.where((row < 0) | (row >= window.shape[0]), y - down, row)
        column = np.where((column < 0) | (column >= window.shape[1]), x - right, column)
        values_there[:] = window[row, column]
    return np.asarray(np.median(values, axis=0))
