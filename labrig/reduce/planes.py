"""The pixels of each position of a frame's CFA, counted by level."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from labrig.reduce.histogram import counted
from labrig.reduce.noise import TILE, Floats, Mosaic, PlaneNoise, plane_noise
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
    raw: RawFrame, areas: Sequence[tuple[int, int, int, int]], hot: PixelMask | None
) -> list[list[PlaneCount]]:
    """Every position of the CFA of `raw` in each of `areas` (x, y, width, height) but `hot`."""
    windows = [_Window.about(area, raw) for area in areas]
    planes = [plane for window in windows for plane in window.planes()]
    noises = plane_noise(planes)
    positions = raw.cfa_side**2
    return [
        _counted(raw, area, hot, window, noises[positions * index : positions * (index + 1)])
        for index, (area, window) in enumerate(zip(areas, windows, strict=True))
    ]


@dataclass(frozen=True, eq=False)
class _Window:
    """The surroundings of a region from which its noise is told; `top`, `left` on the sensor."""

    pixels: Mosaic
    top: int
    left: int
    cfa_side: int

    @classmethod
    def about(cls, area: tuple[int, int, int, int], raw: RawFrame) -> "_Window":
        """The window of a region of `raw`."""
        x, y, width, height = area
        left, wide = _grown(x, width, raw.width, raw.cfa_side)
        top, high = _grown(y, height, raw.height, raw.cfa_side)
        return cls(raw.mosaic[top : top + high, left : left + wide], top, left, raw.cfa_side)

    def planes(self) -> Iterator[Mosaic]:
        """Its pixels of every position of the CFA, row by row of the CFA."""
        side = self.cfa_side
        for row, column in np.ndindex(side, side):
            yield self.pixels[(row - self.top) % side :: side, (column - self.left) % side :: side]


def _counted(
    raw: RawFrame,
    area: tuple[int, int, int, int],
    hot: PixelMask | None,
    window: _Window,
    noises: Sequence[PlaneNoise],
) -> list[PlaneCount]:
    """A region's planes; `noises` are those of its window."""
    x, y, width, height = area
    side = raw.cfa_side
    by_place = dict(zip(np.ndindex(side, side), noises, strict=True))
    out_y, out_x = isolated_outliers(window.pixels, (window.top, window.left), side, by_place)
    inside = (y <= out_y) & (out_y < y + height) & (x <= out_x) & (out_x < x + width)
    out_y, out_x = out_y[inside], out_x[inside]
    if hot is not None:
        known = hot[out_y, out_x]
        out_y, out_x = out_y[~known], out_x[~known]
    planes = []
    for (row, column), noise in by_place.items():
        here = (
            slice(y + (row - y) % side, y + height, side),
            slice(x + (column - x) % side, x + width, side),
        )
        plane = np.ascontiguousarray(raw.mosaic[here])
        level, pixels = counted(plane, None if hot is None else hot[here])
        count = pixels.astype(np.float64)
        position = side * row + column
        planes.append(
            PlaneCount(
                colour=raw.cfa[position],
                value=np.asarray(level - raw.black[position], dtype=np.float64),
                count=count,
                saturated=int(count[level >= raw.white].sum()),
                hot=int(np.count_nonzero((out_y % side == row) & (out_x % side == column))),
                noise=noise,
            )
        )
    return planes


def _grown(start: int, length: int, limit: int, side: int) -> tuple[int, int]:
    """A side of a region, grown about its middle to what noise needs, inside the frame."""
    grown = min(max(length, _LEAST_WINDOW * side), limit)
    return min(max(start - (grown - length) // 2, 0), limit - grown), grown
