"""The strip of a linear variable filter in a frame: its place, and the light along it."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import FloatArray
from labrig.foundation.detection import LIT_PIXEL_SIGMA, PRECISE_SIGMA
from labrig.foundation.errors import DataError
from labrig.foundation.region import Region
from labrig.optics import SLICES, CameraModel, Strip
from labrig.reduce.hdr import HdrFrame, Image, hdr_frame
from labrig.reduce.hot_pixels import HotPixels
from labrig.reduce.measured_frames import SeriesFrame
from labrig.reduce.raw import RawFrame
from labrig.reduce.series import reduce_patches
from labrig.reduce.workers.reduction import Exposure, reduce_groups
from labrig.results import Series, SliceValues, StripProfile

#: as a fraction of the brightest light near by,
EDGE = 0.4
#: and as a fraction of the brightest of all: less is stray light.
FAINTEST = 3e-4
#: Neighbourhood as a fraction of the frame's width, within which the strip's light may double.
NEAR = 0.01
#: Largest tilt: upright regions along the strip would mix too many wavelengths beyond it.
MAX_TILT_DEGREES = 5.0
#: Least ratio of a strip's length to its height, and least fraction of the frame that it fills.
MIN_ELONGATION = 2.0
MIN_FRACTION = 0.005
#: Range of the lit fraction of the rectangle; more than 1 is rounding.
FULL = (0.9, 1.1)
#: Margins at each long side and at each end, as fractions of the strip's height and length.
LONG_MARGIN, END_MARGIN = 0.12, 0.01
#: Least width of a slice in pixels: a cell of the colour filter.
_MIN_SLICE = 2


@dataclass(frozen=True)
class FoundStrip:
    """A lit rectangle in a frame.

    Attributes
    ----------
    corners
        Corners (x, y) in pixels, clockwise from the upper left.
    tilt_degrees
        Tilt of the long side in degrees; > 0 falls to the right.
    length, height
        Size of the rectangle in pixels.
    width_of_frame, height_of_frame
        Size of the frame in pixels.
    """

    corners: tuple[tuple[float, float], ...]
    tilt_degrees: float
    length: float
    height: float
    width_of_frame: int
    height_of_frame: int

    def strip(self, rising: bool) -> Strip:
        """Return the inner part of the rectangle in fractions of the frame."""
        upper_left, upper_right, lower_right, lower_left = np.array(self.corners)
        left, right = (upper_left + lower_left) / 2, (upper_right + lower_right) / 2
        inwards = END_MARGIN * (right - left)
        frame = np.array([self.width_of_frame, self.height_of_frame])
        return Strip(
            left=_point((left + inwards) / frame),
            right=_point((right - inwards) / frame),
            height=self.height * (1 - 2 * LONG_MARGIN) / self.height_of_frame,
            rising=rising,
        )

    def __str__(self) -> str:
        """Return size and tilt of the rectangle."""
        return f"{self.length:.0f} x {self.height:.0f} pixels, tilted by {self.tilt_degrees:+.1f}°"


def find_strip(frame: HdrFrame) -> FoundStrip:
    """Find the brightest elongated rectangle in an otherwise dark frame.

    Parameters
    ----------
    frame
        Frame of a lit strip of a linear variable filter, one exposure or several combined.

    Returns
    -------
    FoundStrip
        Corners, tilt and size of the lit rectangle in pixels.

    Raises
    ------
    DataError
        No strip is lit, it is tilted by more than 5°, or it is too short to be read.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.reduce import HdrFrame, find_strip
    >>> rate = np.zeros((120, 200), np.float32)
    >>> rate[50:70, 20:180] = 1000.0  # DN/s
    >>> print(find_strip(HdrFrame(rate, cfa="L", cfa_side=1, channels=("L",))))
    161 x 21 pixels, tilted by +0.0°
    """
    light = frame.light()
    height, width = light.shape
    lit_mask = _largest_lit_patch(light)
    if lit_mask is None:
        raise DataError(
            "no strip is lit in the picture: the lamp is out, the filter is not in its place, or "
            "the frames are too short"
        )
    (middle_x, middle_y), across, down, angle = _rectangle(lit_mask)
    if across * down < MIN_FRACTION * width * height or across < MIN_ELONGATION * down:
        raise DataError(
            f"expected a long strip on a dark ground, found {across:.0f} x {down:.0f} pixels that "
            "are lit; keep other light away and the holder round the filter dark"
        )
    if abs(angle) > MAX_TILT_DEGREES:
        raise DataError(
            f"the strip is tilted by {angle:+.1f}° against the frame, at most "
            f"{MAX_TILT_DEGREES:g}° are allowed; turn the filter or the camera"
        )
    if across * (1 - 2 * END_MARGIN) < _MIN_SLICE * SLICES:
        raise DataError(
            f"the strip is {across:.0f} pixels long, {_MIN_SLICE * SLICES} or more are needed "
            f"for {SLICES} positions; move the camera nearer"
        )
    if not FULL[0] < np.count_nonzero(lit_mask) / (across * down) < FULL[1]:
        raise DataError(
            "the lit area is no rectangle; keep other light away and the holder round the filter "
            "dark"
        )
    along = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
    aside = np.array([-along[1], along[0]])
    middle = np.array([middle_x, middle_y])
    corners = [
        _point(middle + x * across / 2 * along + y * down / 2 * aside)
        for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    ]
    return FoundStrip(tuple(corners), float(angle), float(across), float(down), width, height)


def strip_profile(frame: HdrFrame, strip: Strip) -> StripProfile:
    """Average a frame across a strip, one value for every cell of the colour filter along it.

    Each channel is read where its own pixels are, and interpolated linearly in between.

    Parameters
    ----------
    frame
        The whole frame, one exposure or several combined.
    strip
        Place of the strip in the frame; the direction of its wavelengths does not matter.

    Returns
    -------
    StripProfile
        Mean signal in DN/s at n positions from the left end (0) to the right end (1), shape
        (n, channels).

    Raises
    ------
    DataError
        Some part of the strip clips in all frames.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.optics import Strip
    >>> from labrig.reduce import HdrFrame, strip_profile
    >>> rate = np.tile(np.linspace(0.0, 1000.0, 200, dtype=np.float32), (120, 1))  # DN/s
    >>> frame = HdrFrame(rate, cfa="L", cfa_side=1, channels=("L",))
    >>> strip = Strip(left=(0.1, 0.5), right=(0.9, 0.5), height=0.2, rising=True)
    >>> profile = strip_profile(frame, strip)
    >>> profile.value_dn_per_s.shape, profile.value_dn_per_s[[0, -1], 0].round().tolist()
    ((80, 1), [103.0, 897.0])
    """
    height, width = frame.rate.shape
    along, inside = _strip_position(strip, width, height)
    rows, columns = np.nonzero(inside)
    place, value = along[inside], frame.rate[inside].astype(np.float64)
    side = frame.cfa_side
    colour = np.array(list(frame.cfa)).reshape(side, side)[rows % side, columns % side]
    cells = (strip.right[0] - strip.left[0]) * width / max(side, 2)
    edges = np.linspace(0.0, 1.0, int(cells) + 1)
    position = (edges[1:] + edges[:-1]) / 2
    is_finite = np.isfinite(value)
    columns_of_value = [
        _interpolate_means(place[in_channel], value[in_channel], edges, position)
        for in_channel in (is_finite & (colour == name) for name in frame.channels)
    ]
    return StripProfile(position, np.stack(columns_of_value, axis=1))


def _largest_lit_patch(light: Image) -> NDArray[np.uint8] | None:
    """Mark the largest lit patch by 1, shape (height, width); None without light."""
    import cv2  # plans and lists of runs need no OpenCV

    ground = float(np.median(light))
    noise = 1.4826 * float(np.median(np.abs(light - ground)))
    above = light - np.float32(ground)
    height, width = light.shape
    neighbourhood = np.ones((height // 2 * 2 + 1, int(NEAR * width) // 2 * 2 + 1), np.uint8)
    local = cv2.dilate(above, neighbourhood)
    least = max(LIT_PIXEL_SIGMA * noise, FAINTEST * float(above.max()))
    lit_mask = ((above > least) & (above > EDGE * local)).astype(np.uint8)
    cell = np.ones((3, 3), np.uint8)
    cleaned = cv2.morphologyEx(
        cv2.morphologyEx(lit_mask, cv2.MORPH_OPEN, cell), cv2.MORPH_CLOSE, cell
    )
    count, labels, stats, _ = cv2.connectedComponentsWithStats(cleaned)
    if count < 2:
        return None
    largest = 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
    return np.asarray(labels == largest, dtype=np.uint8)


def _rectangle(lit_mask: NDArray[np.uint8]) -> tuple[tuple[float, float], float, float, float]:
    """Return the rectangle of equal moments: centre, length, height in pixels, tilt in degrees.

    Moments involve all pixels: they resolve a tilt of a fraction of a pixel, which corners do not.
    """
    import cv2

    moments = cv2.moments(lit_mask, binaryImage=True)
    middle = moments["m10"] / moments["m00"] + 0.5, moments["m01"] / moments["m00"] + 0.5
    xx, yy, xy = (moments[name] / moments["m00"] for name in ("mu20", "mu02", "mu11"))
    (short, long), axes = np.linalg.eigh(np.array([[xx, xy], [xy, yy]]))
    angle = math.degrees(math.atan2(axes[1, 1], axes[0, 1]))
    # n pixels side by side have the variance (n² − 1)/12.
    across, down = (math.sqrt(12 * variance + 1) for variance in (long, short))
    return middle, across, down, (angle + 90) % 180 - 90


def _point(xy: NDArray[np.float64]) -> tuple[float, float]:
    return float(xy[0]), float(xy[1])


def _strip_position(strip: Strip, width: int, height: int) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Return every pixel's position along the strip, and whether it is inside; (height, width)."""
    x, y = np.arange(width) + 0.5, np.arange(height)[:, np.newaxis] + 0.5
    left = np.array([strip.left[0] * width, strip.left[1] * height])
    right = np.array([strip.right[0] * width, strip.right[1] * height])
    length = float(np.hypot(*(right - left)))
    (ex, ey) = (right - left) / length
    along = ((x - left[0]) * ex + (y - left[1]) * ey) / length
    aside = (y - left[1]) * ex - (x - left[0]) * ey
    inside = (along >= 0) & (along <= 1) & (np.abs(aside) <= strip.height * height / 2)
    return along, inside


def _interpolate_means(
    place: FloatArray, value: FloatArray, edges: FloatArray, position: FloatArray
) -> FloatArray:
    """Interpolate the mean of the pixels between `edges`, at their mean place, to `position`."""
    pixels, _ = np.histogram(place, edges)
    if (pixels == 0).any():
        raise DataError(
            "some of the strip clips in every frame; close the aperture, or lower the ISO"
        )
    mean_place = np.histogram(place, edges, weights=place)[0] / pixels
    mean_value = np.histogram(place, edges, weights=value)[0] / pixels
    return np.asarray(np.interp(position, mean_place, mean_value), dtype=np.float64)


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
