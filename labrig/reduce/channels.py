"""Mean, noise and damage of each colour channel in a region of one frame."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from labrig.errors import DataError, FrameError
from labrig.reduce.photon_transfer import ROUNDING_VARIANCE
from labrig.reduce.planes import PixelMask, PlaneCount, count_planes
from labrig.reduce.raw import RawFrame
from labrig.reduce.saturation import is_clipped
from labrig.region import Region, region_pixels

#: The quantile that says how close to clipping a channel is: a few hot pixels do not reach it.
PEAK_QUANTILE = 0.995


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

    @property
    def clipped(self) -> bool:
        """Whether so many pixels are saturated that the mean is too small."""
        return bool(is_clipped(self.saturated, self.n))


@dataclass(frozen=True)
class FrameMeasurement:
    """The channels `R`, `G` (all greens) and `B`, or `L`; the rest is as in `RawFrame`."""

    channels: Mapping[str, ChannelStats]
    cfa: str
    black: tuple[float, ...]
    white: float
    width: int
    height: int
    exposure_s: float | None
    iso: float | None
    f_number: float | None
    make: str | None
    model: str | None

    @property
    def clipped(self) -> bool:
        """Whether any channel is."""
        return any(stats.clipped for stats in self.channels.values())

    @property
    def range_dn(self) -> float:
        """From black to white."""
        return self.white - max(self.black)

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


def measure(
    raw: RawFrame, region: Region | None = None, hot: PixelMask | None = None
) -> FrameMeasurement:
    """Statistics of each channel of `raw` in a region; None is the whole frame.

    The parameters and errors are those of `measure_regions`.
    """
    return measure_regions(raw, [region], hot)[0]


def measure_regions(
    raw: RawFrame, regions: Sequence[Region | None], hot: PixelMask | None = None
) -> list[FrameMeasurement]:
    """Statistics of each channel of `raw` in each region.

    Parameters
    ----------
    raw
        The frame.
    regions
        Where; None is the whole frame.
    hot
        Shape (height, width): pixels to leave out, as `hot_pixels` finds them in dark frames.

    Raises
    ------
    UsageError
        A region leaves the frame.
    DataError
        `hot` is of another sensor, or leaves no pixel of a channel.
    """
    if hot is not None and hot.shape != raw.mosaic.shape:
        raise DataError(
            f"expected a hot-pixel mask of shape {raw.mosaic.shape} as the frame has, got "
            f"{hot.shape}; take dark frames with the same camera and image size"
        )
    areas = [
        (0, 0, raw.width, raw.height)
        if region is None
        else region_pixels(region, raw.width, raw.height)
        for region in regions
    ]
    return [_measured(raw, planes) for planes in count_planes(raw, areas, hot)]


def _measured(raw: RawFrame, planes: Sequence[PlaneCount]) -> FrameMeasurement:
    return FrameMeasurement(
        channels={
            name: _channel(name, [plane for plane in planes if plane.colour == name])
            for name in raw.channels
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


def _channel(name: str, planes: list[PlaneCount]) -> ChannelStats:
    """Statistics over all CFA positions of a colour."""
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
