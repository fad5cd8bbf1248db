"""Regions and a filter's strip in frames on disk, several exposures of one scene."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import FloatArray
from labrig.foundation.detection import PRECISE_SIGMA
from labrig.foundation.region import Region
from labrig.optics import CameraModel, Strip
from labrig.reduce.frame_reduction import Exposure, reduce_groups
from labrig.reduce.hdr import HdrFrame, hdr_frame
from labrig.reduce.hot_pixels import HotPixels
from labrig.reduce.measured_frames import SeriesFrame
from labrig.reduce.raw import RawFrame
from labrig.reduce.series import reduce_patches
from labrig.reduce.strip import FoundStrip, find_strip, strip_profile
from labrig.results import Series, SliceValues, StripProfile

#: Relative change of lamp, shutter and aperture between scenes, common to colours and places.
FLICKER = 0.005
#: Relative independent error of a place: the sensor's pattern, dust.
PATTERN = 0.002


@dataclass(frozen=True, eq=False)
class _Bracket:
    """Several exposures of one scene that are combined into one frame of larger range.

    Attributes
    ----------
    exposures_s
        Exposure times of the frames in seconds.
    hot
        Hot pixels to leave out; None leaves out none.
    """

    exposures_s: tuple[float, ...]
    hot: HotPixels | None

    def combined(self, frames: Iterator[RawFrame]) -> HdrFrame:
        """Return the combined frame."""
        hot = None if self.hot is None else self.hot.mask
        return hdr_frame(zip(frames, self.exposures_s, strict=True), hot)


@dataclass(frozen=True, eq=False)
class FindStrip(_Bracket):
    """Search of a bracket for the lit strip."""

    def __call__(self, frames: Iterator[RawFrame]) -> FoundStrip:
        """Find the strip in the combined frames."""
        return find_strip(self.combined(frames))


@dataclass(frozen=True, eq=False)
class ProfileStrip(_Bracket):
    """Average of a bracket across a strip.

    Attributes
    ----------
    strip
        Place of the strip.
    """

    strip: Strip

    def __call__(self, frames: Iterator[RawFrame]) -> StripProfile:
        """Average the combined frames across the strip."""
        return strip_profile(self.combined(frames), self.strip)


def find_strip_in(frames: Sequence[Exposure], hot: HotPixels | None = None) -> FoundStrip:
    """Find the lit strip in several exposures of one scene.

    Parameters
    ----------
    frames
        Frames on disk, with their actual exposure times in seconds.
    hot
        Hot pixels to leave out; None leaves out none.

    Returns
    -------
    FoundStrip
        Corners, tilt and size of the lit rectangle in pixels.

    Raises
    ------
    DataError
        There is no frame, no strip is lit, or it is tilted or too short to be read.
    UsageError, FrameError
        A file cannot be read, or is no RAW file of a known sensor.

    Examples
    --------
    >>> import labrig
    >>> from labrig.reduce import find_strip_in
    >>> try:
    ...     print(find_strip_in(labrig.read_run("runs/decay").frames("meter")))
    ... except labrig.DataError as error:
    ...     print(str(error).partition(":")[0])
    no strip is lit in the picture
    """
    reduction = FindStrip(tuple(float(frame.exposure_s) for frame in frames), hot)
    return reduce_groups([frames], reduction)[0]


def strip_profile_in(
    frames: Sequence[Exposure], strip: Strip, hot: HotPixels | None = None
) -> StripProfile:
    """Average several exposures of one scene across a strip.

    Parameters
    ----------
    frames
        Frames on disk, with their actual exposure times in seconds.
    strip
        Place of the strip in the frame; the direction of its wavelengths does not matter.
    hot
        Hot pixels to leave out; None leaves out none.

    Returns
    -------
    StripProfile
        Mean signal in DN/s at n positions from the left end (0) to the right end (1), shape
        (n, channels).

    Raises
    ------
    DataError
        There is no frame, or some part of the strip clips in all of them.
    UsageError, FrameError
        A file cannot be read, or is no RAW file of a known sensor.

    Examples
    --------
    >>> import labrig
    >>> from labrig.optics import Strip
    >>> from labrig.reduce import strip_profile_in
    >>> strip = Strip(left=(0.1, 0.5), right=(0.9, 0.5), height=0.2, rising=True)
    >>> profile = strip_profile_in(labrig.read_run("runs/decay").frames("meter"), strip)
    >>> profile.value_dn_per_s.shape
    (38, 3)
    """
    reduction = ProfileStrip(tuple(float(frame.exposure_s) for frame in frames), hot, strip)
    return reduce_groups([frames], reduction)[0]


def slice_values(
    frames: Sequence[SeriesFrame],
    strip: Strip,
    darks: Sequence[SeriesFrame],
    camera: CameraModel | None,
) -> Mapping[str, SliceValues]:
    """Measure the light in every slice of a strip, scene by scene.

    Parameters
    ----------
    frames
        Light frames; those of one unit show one scene at several exposures.
    strip
        Place of the strip, the same in all frames.
    darks
        Dark frames at their exposure times.
    camera
        Calibration of the camera; None uses the values as they are.

    Returns
    -------
    dict of str to SliceValues
        Signal in DN/s and its standard uncertainty by unit, shape (slices, channels).

    Raises
    ------
    DataError
        ISO or f-number differ within a unit, no dark frames match, or the calibration is of another
        camera or aperture.
    FrameError, UsageError
        A frame cannot be read, or the strip leaves it.

    Examples
    --------
    >>> import labrig
    >>> from labrig.optics import Strip
    >>> from labrig.reduce import SeriesFrame, slice_values
    >>> run = labrig.read_run("runs/decay")
    >>> darks = [SeriesFrame(dark.path, 0.0, dark.exposure_s) for dark in run.frames("dark")]
    >>> first = run.frames("decay")[0]
    >>> frames = [SeriesFrame(first.path, 1.06, first.exposure_s, unit="lit")]
    >>> strip = Strip(left=(0.1, 0.5), right=(0.9, 0.5), height=0.2, rising=True)
    >>> values = slice_values(frames, strip, darks, camera=None)
    >>> values["lit"].value.shape
    (31, 3)
    """
    return region_values(frames, strip.slices(), darks, camera)


def region_values(
    frames: Sequence[SeriesFrame],
    regions: Mapping[str, Region],
    darks: Sequence[SeriesFrame],
    camera: CameraModel | None,
    *,
    is_evened: bool = False,
) -> Mapping[str, SliceValues]:
    """Measure the light in some regions, scene by scene.

    Bright regions clip in the long exposures, and dim ones are seen in those only. What is seen in
    several frames tells how bright each is, by which the flicker between them can be taken out.

    Parameters
    ----------
    frames
        Light frames; those of one unit show one scene at several exposures.
    regions
        Regions by name, in fractions of the frame.
    darks
        Dark frames at their exposure times.
    camera
        Calibration of the camera; None uses the values as they are.
    is_evened
        Whether the frames of a scene are brought to one brightness.

    Returns
    -------
    dict of str to SliceValues
        Signal in DN/s and its standard uncertainty by unit, shape (regions, channels); NaN where
        all exposures clip.

    Raises
    ------
    DataError
        ISO or f-number differ within a unit, no dark frames match, or the calibration is of another
        camera or aperture.
    FrameError, UsageError
        A frame cannot be read, or a region leaves it.

    Examples
    --------
    >>> import labrig
    >>> from labrig.reduce import SeriesFrame, region_values
    >>> run = labrig.read_run("runs/decay")
    >>> darks = [SeriesFrame(dark.path, 0.0, dark.exposure_s) for dark in run.frames("dark")]
    >>> first = run.frames("decay")[0]
    >>> frames = [SeriesFrame(first.path, 1.06, first.exposure_s, unit="lit")]
    >>> values = region_values(frames, {"middle": (0.4, 0.4, 0.2, 0.2)}, darks, camera=None)
    >>> values["lit"].value.shape
    (1, 3)
    """
    series = reduce_patches(frames, regions, darks, camera=camera)
    return {
        unit: _slice_values(_evened(series, unit) if is_evened else series, unit)
        for unit in dict.fromkeys(frame.unit for frame in frames)
    }


def _usable(series: Series, unit: str) -> NDArray[np.bool_]:
    """Return which frames of a unit a region is usable in, shape (frames,)."""
    rows = np.array(series.unit) == unit
    usable: NDArray[np.bool_] = rows & series.usable & np.isfinite(series.sigma).all(axis=1)
    return usable


def _slice_values(series: Mapping[str, Series], unit: str) -> SliceValues:
    """Return the means over the frames of a unit, all regions together."""
    pairs = []
    for region in series.values():
        usable = _usable(region, unit)
        pairs.append(_weighted_mean(region.values[usable], region.sigma[usable], region.dark_sigma))
    value, sigma = np.moveaxis(np.array(pairs), 1, 0)
    return SliceValues(value, sigma)


def _evened(series: Mapping[str, Series], unit: str) -> Mapping[str, Series]:
    """Return the series with the frames of a unit brought to one brightness."""
    usable = np.array([_usable(region, unit) for region in series.values()])
    value = np.array([region.values for region in series.values()])
    sigma = np.array([region.sigma for region in series.values()])
    shown = usable[:, :, np.newaxis] & (value > PRECISE_SIGMA * sigma)
    frames = np.flatnonzero(shown.any(axis=(0, 2)))
    if len(frames) < 2:
        return series
    # (frames, places · channels)
    shown = np.moveaxis(shown[:, frames], 1, 0).reshape(len(frames), -1)
    value_of = np.moveaxis(value[:, frames], 1, 0).reshape(len(frames), -1)
    sigma_of = np.moveaxis(sigma[:, frames], 1, 0).reshape(len(frames), -1)
    weight = np.where(shown, (value_of / np.where(shown, sigma_of, 1.0)) ** 2, 0.0)
    log = np.log(np.where(shown, value_of, 1.0))
    total = np.maximum(weight.sum(axis=0), 1e-300)
    # Least squares of log = place + frame; the places are eliminated, the frames have mean 0.
    normal = np.diag(weight.sum(axis=1)) - (weight / total) @ weight.T
    right = (weight * (log - (weight * log).sum(axis=0) / total)).sum(axis=1)
    gain = np.linalg.lstsq(normal, right, rcond=1e-9)[0]
    factor = np.ones(len(next(iter(series.values())).values))
    factor[frames] = np.exp(gain - gain.mean())
    return {
        name: replace(
            region,
            values=region.values / factor[:, np.newaxis],
            sigma=region.sigma / factor[:, np.newaxis],
        )
        for name, region in series.items()
    }


def _weighted_mean(
    value: FloatArray, sigma: FloatArray, dark_sigma: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the weighted mean of frames (n, channels) of one scene and its σ, (channels,) each."""
    if not len(value):
        return np.full_like(dark_sigma, np.nan), np.full_like(dark_sigma, np.nan)
    weight = 1 / sigma**2
    mean = (weight * value).sum(axis=0) / weight.sum(axis=0)
    dark = np.nan_to_num(dark_sigma)
    return mean, np.sqrt(1 / weight.sum(axis=0) + dark**2 + (PATTERN * mean) ** 2)
