"""The frames of a run, each read once and seen in every patch of the sample."""

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from labrig.errors import DataError
from labrig.reduce.channels import FrameMeasurement, PixelMask, measure_regions
from labrig.reduce.noise import Floats
from labrig.reduce.pair_noise import strip_deviations
from labrig.reduce.raw import RawFrame, read_raw
from labrig.region import Region

#: Frames in memory at once; only one is ever being decoded.
_FRAMES_AT_ONCE = 2


@dataclass(frozen=True)
class SeriesFrame:
    """A frame on disk and its *measured* times.

    Parameters
    ----------
    t_s, exposure_s
        Start of the exposure (after lamp off) and its length. Of a dark frame, `t_s` is not used.
    iso, f_number
        None: as the file's EXIF says.
    unit, flag
        Unit of the run, and flags it already has.
    """

    path: Path
    t_s: float
    exposure_s: float
    iso: float | None = None
    f_number: float | None = None
    unit: str = ""
    flag: str = ""


@dataclass(frozen=True, eq=False)
class RegionMeasurement:
    """A region of a frame: what is in it, and how its strips (C, strips) deviate from its mean."""

    measured: FrameMeasurement
    strips: Floats

    @property
    def kind(self) -> tuple[int, int, tuple[str, ...]]:
        """What frames that belong together have in common: size and channels."""
        measured = self.measured
        return (measured.width, measured.height, tuple(measured.channels))


@dataclass(frozen=True)
class MeasuredFrame:
    """A frame, seen in every patch and in the background, if there is one."""

    frame: SeriesFrame
    patches: Mapping[str, RegionMeasurement]
    background: RegionMeasurement | None

    @property
    def iso(self) -> float:
        """NaN where neither the run nor the file says."""
        return _first(self.frame.iso, *(view.measured.iso for view in self.patches.values()))

    @property
    def f_number(self) -> float:
        """NaN where neither the run nor the file says."""
        views = self.patches.values()
        return _first(self.frame.f_number, *(view.measured.f_number for view in views))


def measure_frames(
    frames: Sequence[SeriesFrame],
    patches: Mapping[str, Region],
    background: Region | None,
    hot: PixelMask | None,
    read: Mapping[Path, RawFrame],
) -> list[MeasuredFrame]:
    """All `frames` in order; one is decoded, unless it is `read`, while another is measured."""

    def shot(frame: SeriesFrame) -> MeasuredFrame:
        raw = read.get(frame.path) or read_raw(frame.path)
        return _shot(frame, raw, patches, background, hot)

    with ThreadPoolExecutor(_FRAMES_AT_ONCE) as pool:
        return list(pool.map(shot, frames))


def _shot(
    frame: SeriesFrame,
    raw: RawFrame,
    patches: Mapping[str, Region],
    background: Region | None,
    hot: PixelMask | None,
) -> MeasuredFrame:
    if not frame.exposure_s > 0:
        raise DataError(f"{frame.path}: expected an exposure above 0 s, got {frame.exposure_s}")
    regions = [*patches.values(), *([background] if background else [])]
    try:
        views = [
            RegionMeasurement(measured, strip_deviations(raw, region, hot))
            for measured, region in zip(measure_regions(raw, regions, hot), regions, strict=True)
        ]
    except DataError as error:
        raise type(error)(f"{frame.path}: {error}") from None
    return MeasuredFrame(
        frame,
        dict(zip(patches, views, strict=False)),
        views[-1] if background else None,
    )


def levels(views: Sequence[RegionMeasurement]) -> tuple[Floats, Floats]:
    """Means and what each frame by itself says of their sigma in DN, each of shape (n, C)."""
    kinds = {view.kind for view in views}
    if len(kinds) > 1:
        raise DataError(f"expected frames of one sensor and size, got {sorted(kinds)}")
    pairs = [[(c.mean, c.sigma) for c in view.measured.channels.values()] for view in views]
    mean, sigma = np.moveaxis(np.array(pairs), 2, 0)
    return mean, sigma


def strips(views: Sequence[RegionMeasurement]) -> Floats:
    """Their strips' deviations in DN, shape (n, C, strips)."""
    return np.stack([view.strips for view in views])


def _first(*numbers: float | None) -> float:
    return next((number for number in numbers if number is not None), np.nan)
