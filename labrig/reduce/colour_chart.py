"""A ColorChecker in a frame: where its patches are."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.errors import DataError
from labrig.foundation.region import Region
from labrig.optics import CHART_PATCHES
from labrig.reduce.pictures import binned
from labrig.reduce.raw import read_raw

#: Width in pixels to which a frame is reduced before the chart is searched for.
SEARCH_WIDTH = 1200
#: Brightest value of the picture that is searched, of the frame's brightest ones.
WHITE_QUANTILE = 0.995
#: Part of a found patch's sides that is measured.
INNER = 0.6


def find_colour_chart(path: Path) -> list[Region]:
    """Find the 24 patches of a ColorChecker in a frame.

    Parameters
    ----------
    path
        Frame with all of the chart in it, in focus and not clipped.

    Returns
    -------
    list of tuple
        Inner part of each patch as `(x, y, width, height)` in fractions of the frame, row by row
        from the brown patch, however the chart lies.

    Raises
    ------
    DataError
        There is no chart to be seen.
    FrameError
        The frame cannot be read.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.reduce import find_colour_chart
    >>> patches = find_colour_chart(Path("chart.dng"))  # doctest: +SKIP
    """
    import cv2

    picture = _shown(binned(read_raw(path)))
    height, width = picture.shape[:2]
    detector = cv2.mcc.CCheckerDetector.create()
    detector.setColorChartType(cv2.mcc.MCC24)
    if not detector.process(picture, 1):
        raise DataError(
            f"{path}: expected a ColorChecker, found none; lay it so that all of it is in the "
            "frame, in focus, evenly lit and not clipped"
        )
    corners = np.asarray(detector.getBestColorChecker().getColorCharts(), dtype=np.float64)
    return [_inside(quad / (width, height)) for quad in corners.reshape(len(CHART_PATCHES), 4, 2)]


def _shown(picture: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return a picture as a screen shows it, blue first: each channel's brightest part is white."""
    import cv2

    full = np.quantile(picture, WHITE_QUANTILE, axis=(0, 1))
    shown = np.clip(picture / np.maximum(full, 1e-9), 0.0, 1.0) ** (1 / 2.2)
    eight_bit = np.ascontiguousarray((255 * shown[..., ::-1]).astype(np.uint8))
    width = eight_bit.shape[1]
    if width <= SEARCH_WIDTH:
        return eight_bit
    size = SEARCH_WIDTH, round(eight_bit.shape[0] * SEARCH_WIDTH / width)
    return np.asarray(cv2.resize(eight_bit, size, interpolation=cv2.INTER_AREA))


def _inside(quad: Sequence[Sequence[float]] | NDArray[np.float64]) -> Region:
    """Return the upright rectangle in the middle of a quadrilateral."""
    points = np.asarray(quad)
    middle = points.mean(axis=0)
    half = INNER * np.abs(points - middle).mean(axis=0)
    (x, y), (wide, high) = (middle - half).tolist(), (2 * half).tolist()
    return (x, y, wide, high)
