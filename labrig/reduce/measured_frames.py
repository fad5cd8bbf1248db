"""The frames of a run, each read once and measured in every patch of the sample."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from labrig.foundation.errors import DataError
from labrig.foundation.region import Region
from labrig.reduce.hot_pixels import HotPixels
from labrig.reduce.pair_noise import strip_deviations
from labrig.reduce.plane_noise import Floats
from labrig.reduce.raw import RawFrame
from labrig.reduce.region_levels import FrameMeasurement, measure_regions
from labrig.reduce.workers.reduction import StoredFrame, reduce_frames


@dataclass(frozen=True)
class SeriesFrame:
    """A frame on disk and its *measured* times.

    Parameters
    ----------
    path
        Path of the RAW file.
    t_s
        Start of the exposure in seconds after lamp off; not used of a dark frame.
    exposure_s
        Exposure time in seconds.
    iso, f_number
        ISO and f-number; None takes those of the file's EXIF.
    unit
        Unit of the run.
    flag
        Flags that the frame already has.
    sha256
        Checksum of the file by its run's journal: what is reduced from the frame is then kept in
        the run folder, and taken from there the next time. Empty keeps nothing.
    """

    path: Path
    t_s: float
    exposure_s: float
    iso: float | None = None
    f_number: float | None = None
    unit: str = ""
    flag: str = ""
    sha256: str = ""


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

    @property
    def is_cut_off(self) -> bool:
        """Whether the camera cut off noise below black in this frame."""
        return any(stats.read_dn is not None for stats in self.measured.channels.values())


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


@dataclass(frozen=True, eq=False)
class MeasureRegions:
    """Measurement of one frame in several regions.

    Attributes
    ----------
    regions
        Regions in fractions of the frame.
    hot
        Hot pixels to leave out; None leaves out none.
    """

    regions: tuple[Region, ...]
    hot: HotPixels | None

    def __call__(self, frames: Iterator[RawFrame]) -> tuple[RegionMeasurement, ...]:
        """Measure the frame in each region."""
        raw, hot = next(frames), None if self.hot is None else self.hot.mask
        return tuple(
            RegionMeasurement(measured, strip_deviations(raw, region, hot))
            for measured, region in zip(
                measure_regions(raw, self.regions, hot), self.regions, strict=True
            )
        )


def measure_region(
    frames: Sequence[StoredFrame], region: Region, hot: HotPixels | None = None
) -> list[FrameMeasurement]:
    """Measure mean, noise and saturation of each colour channel in a region of each frame.

    Parameters
    ----------
    frames
        Frames on disk.
    region
        Region as (x, y, width, height) in fractions of the frame.
    hot
        Hot pixels to leave out; None leaves out none.

    Returns
    -------
    list of FrameMeasurement
        The statistics of each frame's channels in DN above black, and its settings.

    Raises
    ------
    DataError
        A frame is damaged, or the hot pixels are of another sensor.
    UsageError, DiskError
        A frame cannot be read, or the region leaves it.

    Examples
    --------
    >>> import labrig
    >>> from labrig.reduce import measure_region
    >>> glow = labrig.read_run("runs/decay").frames("decay")[:3]
    >>> measured = measure_region(glow, (0.25, 0.25, 0.5, 0.5))
    >>> [f"{frame.channels['G'].mean:.0f} DN" for frame in measured]
    ['4447 DN', '2403 DN', '1660 DN']
    """
    return [views[0].measured for views in reduce_frames(frames, MeasureRegions((region,), hot))]


def measure_frames(
    frames: Sequence[SeriesFrame],
    patches: Mapping[str, Region],
    background: Region | None,
    hot: HotPixels | None,
) -> list[MeasuredFrame]:
    """Measure all frames in their order.

    Parameters
    ----------
    frames
        Frames on disk.
    patches
        Region of each patch by its name.
    background
        Region of the background; None if there is none.
    hot
        Hot pixels to leave out.
    """
    for frame in frames:
        if not frame.exposure_s > 0:
            raise DataError(f"{frame.path}: expected an exposure above 0 s, got {frame.exposure_s}")
    regions = (*patches.values(), *([background] if background else []))
    return [
        MeasuredFrame(
            frame, dict(zip(patches, views, strict=False)), views[-1] if background else None
        )
        for frame, views in zip(
            frames, reduce_frames(frames, MeasureRegions(regions, hot)), strict=True
        )
    ]


def levels(views: Sequence[RegionMeasurement]) -> tuple[Floats, Floats]:
    """Return means and their σ by each frame alone, in DN, shape (n, C) each."""
    kinds = {view.kind for view in views}
    if len(kinds) > 1:
        raise DataError(f"expected frames of one sensor and size, got {sorted(kinds)}")
    pairs = [[(c.mean, c.sigma) for c in view.measured.channels.values()] for view in views]
    mean, sigma = np.moveaxis(np.array(pairs), 2, 0)
    return mean, sigma


def shared_sigmas(views: Sequence[RegionMeasurement]) -> Floats:
    """Return σ of the means in DN by what all pixels of a frame have in common, shape (n, C).

    It is that of the correction for noise cut off below black, and that of rounding.
    """
    return np.array(
        [
            [
                np.hypot(stats.cut_off_sigma, stats.rounding_sigma)
                for stats in view.measured.channels.values()
            ]
            for view in views
        ]
    )


def cut_off_levels(views: Sequence[RegionMeasurement]) -> Floats:
    """Return what the means are lowered by for noise cut off below black in DN, shape (n, C)."""
    return np.array(
        [[stats.cut_off_dn for stats in view.measured.channels.values()] for view in views]
    )


def pixels(views: Sequence[RegionMeasurement]) -> Floats:
    """Return the number of pixels of each channel, shape (C,)."""
    return np.array([stats.n for stats in views[0].measured.channels.values()], dtype=np.float64)


def strips(views: Sequence[RegionMeasurement]) -> Floats:
    """Return the deviations of the strips in DN, shape (n, C, strips)."""
    return np.stack([view.strips for view in views])


def _first(*numbers: float | None) -> float:
    return next((number for number in numbers if number is not None), np.nan)
