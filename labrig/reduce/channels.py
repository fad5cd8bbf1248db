"""Mean, noise and damage of each colour channel in a region of one frame."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from labrig.errors import DataError, FrameError
from labrig.reduce.noise import ROUNDING_VARIANCE, TILE, Floats, Mosaic, PlaneNoise, plane_noise
from labrig.reduce.outliers import isolated_outliers
from labrig.reduce.raw import RawFrame
from labrig.region import Region, region_pixels

PixelMask: TypeAlias = npt.NDArray[np.bool_]

CHANNELS = ("R", "G", "B")
#: The quantile that says how close to clipping a channel is: a few hot pixels do not reach it.
PEAK_QUANTILE = 0.995
#: Noise of a smaller region is told from its surroundings of this many pixels: 2 × 2 tiles.
_LEAST_WINDOW = 4 * TILE


@dataclass(frozen=True)
class ChannelStats:
    """One colour channel in a region, in DN above black.

    Parameters
    ----------
    mean
        Mean of the pixels.
    sigma
        Standard uncertainty of `mean` from photon and read noise in this frame: what a repeated
        frame would scatter by. Flicker, dark level and the sensor's pattern are not in it.
    std
        Standard deviation of the pixels, the sample's structure and shading included.
    peak
        The 99.5 % quantile.
    n
        Pixels counted.
    saturated
        Pixels at or above white.
    hot
        Pixels that stand out from their neighbours by more than 8 standard deviations.
    """

    mean: float
    sigma: float
    std: float
    peak: float
    n: int
    saturated: int
    hot: int


@dataclass(frozen=True)
class FrameMeasurement:
    """The channels `R`, `G` (both greens) and `B` of a frame; the rest is as in `RawFrame`."""

    channels: Mapping[str, ChannelStats]
    cfa: str
    black: tuple[float, float, float, float]
    white: float
    width: int
    height: int
    exposure_s: float | None
    iso: float | None
    f_number: float | None
    make: str | None
    model: str | None

    def to_json(self) -> dict[str, Any]:
        """What `labrig frame --json` prints (contracts.md)."""
        return {
            "channels": {
                name: {
                    "mean": stats.mean,
                    "sigma": stats.sigma,
                    "std": stats.std,
                    "n": stats.n,
                    "saturated": stats.saturated,
                    "hot": stats.hot,
                }
                for name, stats in self.channels.items()
            },
            "black": list(self.black),
            "white": self.white,
            "cfa": self.cfa,
            "width": self.width,
            "height": self.height,
            "exposure_s": self.exposure_s,
            "iso": self.iso,
            "f_number": self.f_number,
            "make": self.make,
            "model": self.model,
        }

    def __str__(self) -> str:
        """A table for people; values in DN above black."""
        make = self.make if self.make and self.make not in (self.model or "") else None
        body = " ".join(filter(None, (make, self.model))) or "unknown camera"
        taken = [
            None if self.exposure_s is None else f"{self.exposure_s:.4g} s",
            None if self.iso is None else f"ISO {self.iso:g}",
            None if self.f_number is None else f"f/{self.f_number:g}",
        ]
        black = ", ".join(f"{level:g}" for level in dict.fromkeys(self.black))
        rows = [
            f"{name:<4}{stats.mean:>12.2f}{stats.sigma:>10.3f}{stats.std:>10.2f}"
            f"{stats.n:>11}{stats.saturated:>9}{stats.hot:>6}"
            for name, stats in self.channels.items()
        ]
        return "\n".join(
            [
                f"{body}, {', '.join(filter(None, taken)) or 'exposure not recorded'}",
                f"{self.width} x {self.height} pixels, {self.cfa}, black {black}, "
                f"white {self.white:g}",
                f"    {'mean / DN':>12}{'σ':>10}{'std':>10}{'pixels':>11}{'clipped':>9}{'hot':>6}",
                *rows,
            ]
        )


@dataclass(frozen=True, eq=False)
class _PlaneCount:
    """Pixels of one position of the CFA: how many (`count`) have which `value` (DN above black)."""

    colour: str
    value: Floats
    count: Floats
    saturated: int
    hot: int
    noise: PlaneNoise


def measure(
    raw: RawFrame, region: Region | None = None, hot: PixelMask | None = None
) -> FrameMeasurement:
    """Statistics of each channel of `raw`.

    Parameters
    ----------
    raw
        The frame.
    region
        Where; None is the whole frame.
    hot
        Shape (height, width): pixels to leave out, as `hot_pixels` finds them in dark frames.

    Raises
    ------
    UsageError
        The region leaves the frame.
    DataError
        `hot` is of another sensor, or leaves no pixel of a channel.
    """
    if hot is not None and hot.shape != raw.mosaic.shape:
        raise DataError(
            f"expected a hot-pixel mask of shape {raw.mosaic.shape} as the frame has, got "
            f"{hot.shape}; take dark frames with the same camera and image size"
        )
    area = (0, 0, raw.width, raw.height)
    if region is not None:
        area = region_pixels(region, raw.width, raw.height)
    planes = _plane_counts(raw, area, hot)
    return FrameMeasurement(
        channels={
            name: _channel(name, [plane for plane in planes if plane.colour == name])
            for name in CHANNELS
        },
        cfa=raw.cfa,
        black=raw.black,
        white=raw.white,
        width=raw.width,
        height=raw.height,
        exposure_s=raw.exposure_s,
        iso=raw.iso,
        f_number=raw.f_number,
        make=raw.make,
        model=raw.model,
    )


def _plane_counts(
    raw: RawFrame, area: tuple[int, int, int, int], hot: PixelMask | None
) -> list[_PlaneCount]:
    """The four CFA positions of `raw` in the pixels `area`: x, y, width, height."""
    x, y, width, height = area
    left, wide = _grown(x, width, raw.width)
    top, high = _grown(y, height, raw.height)
    window = raw.mosaic[top : top + high, left : left + wide]
    # Rows and columns of the window that have the CFA's first row and column.
    noises = {
        (row, column): plane_noise(window[(row - top) % 2 :: 2, (column - left) % 2 :: 2])
        for row in (0, 1)
        for column in (0, 1)
    }
    out_y, out_x = isolated_outliers(window, (top, left), noises)
    inside = (y <= out_y) & (out_y < y + height) & (x <= out_x) & (out_x < x + width)
    out_y, out_x = out_y[inside], out_x[inside]
    if hot is not None:
        known = hot[out_y, out_x]
        out_y, out_x = out_y[~known], out_x[~known]
    found = []
    for row, column in noises:
        here = (
            slice(y + (row - y) % 2, y + height, 2),
            slice(x + (column - x) % 2, x + width, 2),
        )
        plane = np.ascontiguousarray(raw.mosaic[here])
        histogram = _histogram(plane)
        if hot is not None:
            histogram -= np.bincount(plane[hot[here]], minlength=len(histogram))
        level = np.flatnonzero(histogram)
        count = histogram[level].astype(np.float64)
        position = 2 * row + column
        found.append(
            _PlaneCount(
                colour=raw.cfa[position],
                value=np.asarray(level - raw.black[position], dtype=np.float64),
                count=count,
                saturated=int(count[level >= raw.white].sum()),
                hot=int(np.count_nonzero((out_y % 2 == row) & (out_x % 2 == column))),
                noise=noises[row, column],
            )
        )
    return found


def _grown(start: int, length: int, limit: int) -> tuple[int, int]:
    """A side of a region, grown about its middle to what noise needs, inside the frame."""
    grown = min(max(length, _LEAST_WINDOW), limit)
    return min(max(start - (grown - length) // 2, 0), limit - grown), grown


def _histogram(plane: Mosaic) -> npt.NDArray[np.int64]:
    """Number of pixels at each of the 65536 levels: mean, spread, quantiles in one exact pass."""
    import cv2  # counts ten times as fast as NumPy

    counts = cv2.calcHist([plane], [0], None, [65536], [0, 65536])
    return np.asarray(counts).ravel().astype(np.int64)


def _channel(name: str, planes: list[_PlaneCount]) -> ChannelStats:
    """Statistics over the one or two CFA positions of a colour."""
    value = np.concatenate([plane.value for plane in planes])
    count = np.concatenate([plane.count for plane in planes])
    n = float(count.sum())
    if n == 0:
        raise FrameError(
            f"every {name} pixel of the region is marked hot; choose a larger region or newer darks"
        )
    mean = float(np.sum(value * count)) / n
    spread = float(np.sum(np.square(value - mean) * count))
    order = np.argsort(value, kind="stable")
    peak = value[order][np.searchsorted(np.cumsum(count[order]), PEAK_QUANTILE * n)]
    variance = sum(plane.noise.mean_variance * float(plane.count.sum()) for plane in planes) / n**2
    if min(plane.noise.mean_variance for plane in planes) < ROUNDING_VARIANCE:
        # Without noise to dither it, rounding is the same in every pixel and does not average out.
        variance = max(variance, ROUNDING_VARIANCE)
    return ChannelStats(
        mean=mean,
        sigma=float(np.sqrt(variance)),
        std=float(np.sqrt(spread / max(n - 1, 1))),
        peak=float(peak),
        n=int(n),
        saturated=sum(plane.saturated for plane in planes),
        hot=sum(plane.hot for plane in planes),
    )
