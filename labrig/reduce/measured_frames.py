"""The frames of a run, each read once and measured in every patch of the sample."""

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from labrig.errors import DataError
from labrig.reduce.channels import FrameMeasurement, PixelMask, measure_regions
from labrig.reduce.pair_noise import strip_deviations
from labrig.reduce.plane_noise import Floats
from labrig.reduce.raw import RawFrame, read_raw
from labrig.region import Region

#: Frames in memory at once; only one is ever being decoded.
_FRAMES_AT_ONCE = 2


@dataclass(frozen=True)
class SeriesFrame:
    """A frame on disk and its *measured* times.

    Parameters
    ----------
    path
        Path of the RAW file.
    t_s
        Begin of the exposure in seconds after lamp off; not used of a dark frame.
    exposure_s
        Exposure time in seconds.
    iso, f_number
        ISO and f-number; None takes those of the file's EXIF.
    unit
        Unit of the run.
    flag
        Flags that the frame already has.
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
    """Measurement of a region of a frame.

    Attributes
    ----------
    measured
        Statistics of the channels.
    strips
        Deviations of the region's strips from its mean in DN, shape (C, strips).
    """

    measured: FrameMeasurement
    strips: Floats

    @property
    def kind(self) -> tuple[int, int, tuple[str, ...]]:
        """Width, height and channels, which frames of one sensor have in common."""
        measured = self.measured
        return (measured.width, measured.height, tuple(measured.channels))


@dataclass(frozen=True)
class MeasuredFrame:
    """A frame measured in every patch.

    Attributes
    ----------
    frame
        The frame.
    patches
        Measurement of each patch by its name.
    background
        Measurement of the background region; None if there is none.
    """

    frame: SeriesFrame
    patches: Mapping[str, RegionMeasurement]
    background: RegionMeasurement | None

    @property
    def iso(self) -> float:
        """ISO by the run or the file's EXIF; NaN if neither has it."""
        return _first(self.frame.iso, *(view.measured.iso for view in self.patches.values()))

    @property
    def f_number(self) -> float:
        """F-number by the run or the file's EXIF; NaN if neither has it."""
        views = self.patches.values()
        return _first(self.frame.f_number, *(view.measured.f_number for view in views))


def measure_frames(
    frames: Sequence[SeriesFrame],
    patches: Mapping[str, Region],
    background: Region | None,
    hot: PixelMask | None,
    read: Mapping[Path, RawFrame],
) -> list[MeasuredFrame]:
    """Measure all frames in their order; one is decoded while another is measured.

    Parameters
    ----------
    frames
        Frames on disk.
    patches
        Region of each patch by its name.
    background
        Region of the background; None if there is none.
    hot
        Hot pixels to leave out, shape (height, width).
    read
        Frames that are already decoded, by path.
    """

    def decode_and_measure(frame: SeriesFrame) -> MeasuredFrame:
        raw = read.get(frame.path) or read_raw(frame.path)
        return _measure_frame(frame, raw, patches, background, hot)

    with ThreadPoolExecutor(_FRAMES_AT_ONCE) as pool:
        return list(pool.map(decode_and_measure, frames))


def _measure_frame(
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
    """Return means and their σ by each frame alone, in DN, shape (n, C) each."""
    kinds = {view.kind for view in views}
    if len(kinds) > 1:
        raise DataError(f"expected frames of one sensor and size, got {sorted(kinds)}")
    pairs = [[(c.mean, c.sigma) for c in view.measured.channels.values()] for view in views]
    mean, sigma = np.moveaxis(np.array(pairs), 2, 0)
    return mean, sigma


def strips(views: Sequence[RegionMeasurement]) -> Floats:
    """Return the deviations of the strips in DN, shape (n, C, strips)."""
    return np.stack([view.strips for view in views])


def _first(*numbers: float | None) -> float:
    return next((number for number in numbers if number is not None), np.nan)
