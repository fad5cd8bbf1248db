"""What a picture shows along a strip, averaged over its height."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from labrig.analyse.lvf_calibration.picture import Picture
from labrig.calibration.lvf_file import Strip
from labrig.errors import DataError

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class StripProfile:
    """Light along a strip.

    Attributes
    ----------
    position
        (n,) rising from 0 at the strip's left end to 1 at its right end.
    value
        (n, channels) DN/s.
    """

    position: FloatArray
    value: FloatArray


def strip_profile(picture: Picture, strip: Strip) -> StripProfile:
    """Means across the strip, one for every cell of the colour filter along it.

    Each channel is read where its own pixels are, and drawn straight in between.

    Raises
    ------
    DataError
        Some part of the strip clips in all frames.
    """
    height, width = picture.rate.shape
    along, inside = _along(strip, width, height)
    rows, columns = np.nonzero(inside)
    at, value = along[inside], picture.rate[inside].astype(np.float64)
    side = picture.cfa_side
    colour = np.array(list(picture.cfa)).reshape(side, side)[rows % side, columns % side]
    cells = (strip.right[0] - strip.left[0]) * width / max(side, 2)
    edges = np.linspace(0.0, 1.0, int(cells) + 1)
    position = (edges[1:] + edges[:-1]) / 2
    seen = np.isfinite(value)
    columns_of_value = [
        _mean(at[own], value[own], edges, position)
        for own in (seen & (colour == name) for name in picture.channels)
    ]
    return StripProfile(position, np.stack(columns_of_value, axis=1))


def _along(strip: Strip, width: int, height: int) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Position of every pixel along the strip, and whether it is inside; (height, width)."""
    x, y = np.arange(width) + 0.5, np.arange(height)[:, np.newaxis] + 0.5
    left = np.array([strip.left[0] * width, strip.left[1] * height])
    right = np.array([strip.right[0] * width, strip.right[1] * height])
    length = float(np.hypot(*(right - left)))
    (ex, ey) = (right - left) / length
    along = ((x - left[0]) * ex + (y - left[1]) * ey) / length
    aside = (y - left[1]) * ex - (x - left[0]) * ey
    inside = (along >= 0) & (along <= 1) & (np.abs(aside) <= strip.height * height / 2)
    return along, inside


def _mean(at: FloatArray, value: FloatArray, edges: FloatArray, position: FloatArray) -> FloatArray:
    """Mean value and mean place of the pixels between `edges`, read at `position`."""
    pixels, _ = np.histogram(at, edges)
    if (pixels == 0).any():
        raise DataError(
            "some of the strip clips in every frame; close the aperture, or lower the ISO"
        )
    place = np.histogram(at, edges, weights=at)[0] / pixels
    mean = np.histogram(at, edges, weights=value)[0] / pixels
    return np.asarray(np.interp(position, place, mean), dtype=np.float64)
