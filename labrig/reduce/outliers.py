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
#: The nearest pixels of the same colour.
_NEIGHBOURS = [(y, x) for y in (-2, 0, 2) for x in (-2, 0, 2) if (y, x) != (0, 0)]


def isolated_outliers(
    window: Mosaic, corner: tuple[int, int], noises: Mapping[tuple[int, int], PlaneNoise]
) -> tuple[Indices, Indices]:
    """Rows and columns, on the sensor, of the outliers in `window`.

    Parameters
    ----------
    window
        Part of a mosaic, at least 6 × 6 pixels.
    corner
        Row and column of its first pixel on the sensor.
    noises
        Noise of the four CFA positions by the parity of row and column on the sensor.
    """
    import cv2  # SIMD over the whole mosaic: 20 ms for 21 megapixels

    kernel = np.zeros((5, 5), np.uint8)
    for down, right in _NEIGHBOURS:
        kernel[down + 2, right + 2] = 1
    greatest = np.asarray(cv2.dilate(window, kernel))
    excess = np.asarray(cv2.subtract(window, greatest))
    levels = np.arange(65536, dtype=np.float64)
    quietest = np.min([noise.variance_at(levels) for noise in noises.values()], axis=0)
    limit = _ABOVE_ALL_SIGMAS * np.sqrt(quietest)
    # Compared with one number, then by level, then by the noise of their own plane: few are left.
    passed = np.flatnonzero(excess > int(limit[int(window.min())]))
    passed = passed[excess.ravel()[passed] > limit[greatest.ravel()[passed]]]
    y, x = np.divmod(passed, window.shape[1])
    level = greatest[y, x].astype(np.float64)
    alone = excess[y, x] > _ABOVE_ALL_SIGMAS * _deviation(level, y, x, corner, noises)
    y, x = y[alone], x[alone]
    level = _median_of_neighbours(window, y, x)
    far = window[y, x] > level + OUTLIER_SIGMAS * _deviation(level, y, x, corner, noises)
    return y[far] + corner[0], x[far] + corner[1]


def _deviation(
    level: Floats,
    y: Indices,
    x: Indices,
    corner: tuple[int, int],
    noises: Mapping[tuple[int, int], PlaneNoise],
) -> Floats:
    """Standard deviation of the noise at `level` in the pixels (y, x) of the window."""
    variance = np.zeros(len(level))
    for (row, column), noise in noises.items():
        here = ((y + corner[0]) % 2 == row) & ((x + corner[1]) % 2 == column)
        variance[here] = noise.variance_at(level[here])
    return np.sqrt(variance)


def _median_of_neighbours(window: Mosaic, y: Indices, x: Indices) -> Floats:
    """Median of the eight same-colour neighbours; beyond a border, of the opposite ones."""
    values = np.empty((len(_NEIGHBOURS), len(y)))
    for values_there, (down, right) in zip(values, _NEIGHBOURS, strict=True):
        row, column = y + down, x + right
        row = np.where((row < 0) | (row >= window.shape[0]), y - down, row)
        column = np.where((column < 0) | (column >= window.shape[1]), x - right, column)
        values_there[:] = window[row, column]
    return np.asarray(np.median(values, axis=0))
