"""The pixels of each position of a frame's CFA, counted by level."""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from labrig.reduce.histogram import counted
from labrig.reduce.noise import TILE, Floats, PlaneNoise, plane_noise
from labrig.reduce.outliers import isolated_outliers
from labrig.reduce.raw import RawFrame

PixelMask: TypeAlias = npt.NDArray[np.bool_]

#: Noise of a smaller region is told from its surroundings of so many pixels of each position.
_LEAST_WINDOW = 2 * TILE


@dataclass(frozen=True, eq=False)
class PlaneCount:
    """Pixels of one position of the CFA: how many (`count`) have which `value` (DN above black)."""

    colour: str
    value: Floats
    count: Floats
    saturated: int
    hot: int
    noise: PlaneNoise


def count_planes(
    raw: RawFrame, area: tuple[int, int, int, int], hot: PixelMask | None
) -> list[PlaneCount]:
    """Every position of the CFA of `raw` in the pixels `area` (x, y, width, height) but `hot`."""
    x, y, width, height = area
    side = raw.cfa_side
    left, wide = _grown(x, width, raw.width, side)
    top, high = _grown(y, height, raw.height, side)
    window = raw.mosaic[top : top + high, left : left + wide]
    # Rows and columns of the window that have the CFA's first row and column.
    noises = {
        (row, column): plane_noise(
            window[(row - top) % side :: side, (column - left) % side :: side]
        )
        for row in range(side)
        for column in range(side)
    }
    out_y, out_x = isolated_outliers(window, (top, left), side, noises)
    inside = (y <= out_y) & (out_y < y + height) & (x <= out_x) & (out_x < x + width)
    out_y, out_x = out_y[inside], out_x[inside]
    if hot is not None:
        known = hot[out_y, out_x]
        out_y, out_x = out_y[~known], out_x[~known]
    found = []
    for row, column in noises:
        here = (
            slice(y + (row - y) % side, y + height, side),
            slice(x + (column - x) % side, x + width, side),
        )
        plane = np.ascontiguousarray(raw.mosaic[here])
        level, pixels = counted(plane, None if hot is None else hot[here])
        count = pixels.astype(np.float64)
        position = side * row + column
        found.append(
            PlaneCount(
                colour=raw.cfa[position],
                value=np.asarray(level - raw.black[position], dtype=np.float64),
                count=count,
                saturated=int(count[level >= raw.white].sum()),
                hot=int(np.count_nonzero((out_y % side == row) & (out_x % side == column))),
                noise=noises[row, column],
            )
        )
    return found


def _grown(start: int, length: int, limit: int, side: int) -> tuple[int, int]:
    """A side of a region, grown about its middle to what noise needs, inside the frame."""
    grown = min(max(length, _LEAST_WINDOW * side), limit)
    return min(max(start - (grown - length) // 2, 0), limit - grown), grown
