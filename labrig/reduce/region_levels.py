"""Mean, noise and damage of each colour channel in a region of one frame."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from labrig.foundation.errors import DataError, FrameError
from labrig.foundation.region import Region, region_pixels
from labrig.reduce.black_cut_off import TOO_MANY, BlackCutOff
from labrig.reduce.plane_noise import TILE, Floats, Mosaic, PlaneNoise, plane_noise
from labrig.reduce.raw import RawFrame
from labrig.reduce.rounding import shared_rounding_variance, unrounded_variance
from labrig.reduce.saturation import count_levels, is_clipped

Indices: TypeAlias = npt.NDArray[np.intp]

#: Standard deviations by which an outlier exceeds the median of its neighbours.
OUTLIER_SIGMAS = 8.0
#: Standard deviations by which it exceeds all neighbours, which excludes edges of the sample.
_ABOVE_ALL_SIGMAS = 4.0
#: Variance of values in steps² above which rounding leaves an error of 0 in their mean.
_DITHERED_VARIANCE = 20.0
#: Rows that are searched at once, so that the search takes little memory.
_ROWS_AT_ONCE = 256
#: Offsets of the nearest pixels of the same CFA position, in periods of the CFA.
_NEIGHBOURS = [(y, x) for y in (-1, 0, 1) for x in (-1, 0, 1) if (y, x) != (0, 0)]


def isolated_outliers(
    window: Mosaic,
    corner: tuple[int, int],
    side: int,
    noises: Mapping[tuple[int, int], PlaneNoise],
) -> tuple[Indices, Indices]:
    """Find isolated pixels in a window that are far brighter than their neighbours.

    Parameters
    ----------
    window
        Part of a mosaic in DN, at least three repeats of the CFA wide and high.
    corner
        Row and column of the window's first pixel on the sensor.
    side
        Period of the CFA in pixels: 2 of a Bayer sensor.
    noises
        Noise of each CFA position by row and column within the repeat.

    Returns
    -------
    tuple of ndarray
        Rows and columns of the outliers on the sensor.
    """
    y, x, level = _brighter_than_neighbours(window, side, list(noises.values()))
    excess = window[y, x] - level
    is_isolated = excess > _ABOVE_ALL_SIGMAS * _deviation(
        level, y + corner[0], x + corner[1], side, noises
    )
    y, x = y[is_isolated], x[is_isolated]
    # So it is in most regions of most frames.
    if not len(y):
        return y, x
    level = _median_of_neighbours(window, y, x, side)
    is_outlier = window[y, x] > level + OUTLIER_SIGMAS * _deviation(
        level, y + corner[0], x + corner[1], side, noises
    )
    return y[is_outlier] + corner[0], x[is_outlier] + corner[1]


def _brighter_than_neighbours(
    window: Mosaic, side: int, noises: Sequence[PlaneNoise]
) -> tuple[Indices, Indices, Floats]:
    """Find pixels that clearly exceed the eight neighbours of their CFA position.

    Returns
    -------
    tuple of ndarray
        Rows and columns of the pixels in the window, and the level of the brightest neighbour.
    """
    import cv2  # SIMD over all pixels: 20 ms for 21 megapixels

    kernel = np.zeros((2 * side + 1, 2 * side + 1), np.uint8)
    for down, right in _NEIGHBOURS:
        kernel[(down + 1) * side, (right + 1) * side] = 1

    def limit(levels: Floats) -> Floats:
        quietest = np.min([noise.variance_at(levels) for noise in noises], axis=0)
        return np.asarray(_ABOVE_ALL_SIGMAS * np.sqrt(quietest))

    parts = []
    for first in range(0, len(window), _ROWS_AT_ONCE):
        rows = window[first : first + _ROWS_AT_ONCE]
        top = max(first - side, 0)
        surroundings = window[top : first + _ROWS_AT_ONCE + side]
        greatest = np.asarray(cv2.dilate(surroundings, kernel))[first - top :][: len(rows)]
        excess = np.asarray(cv2.subtract(rows, greatest))
        # By a row's darkest, then by level, then by the noise of their own plane: few are left.
        row_limit = np.minimum(limit(rows.min(axis=1).astype(np.float64)), 65535).astype(np.uint16)
        y, x = np.nonzero(excess > row_limit[:, np.newaxis])
        level = greatest[y, x].astype(np.float64)
        is_bright = excess[y, x] > limit(level)
        parts.append((y[is_bright] + first, x[is_bright], level[is_bright]))
    y, x, level = (np.concatenate(column) for column in zip(*parts, strict=True))
    return y, x, level


def _deviation(
    level: Floats,
    y: Indices,
    x: Indices,
    side: int,
    noises: Mapping[tuple[int, int], PlaneNoise],
) -> Floats:
    """Return the noise σ in DN of the pixels (y, x) of the sensor at `level`."""
    variance = np.zeros(len(level))
    for (row, column), noise in noises.items():
        at_position = (y % side == row) & (x % side == column)
        variance[at_position] = noise.variance_at(level[at_position])
    return np.sqrt(variance)


def _median_of_neighbours(window: Mosaic, y: Indices, x: Indices, side: int) -> Floats:
    """Return the median of the eight neighbours of the same CFA position.

    Beyond a border of the window the opposite neighbour takes the place of the missing one.
    """
    values = np.empty((len(_NEIGHBOURS), len(y)))
    for neighbour_values, repeats in zip(values, _NEIGHBOURS, strict=True):
        down, right = (number * side for number in repeats)
        row, column = y + down, x + right
        row = np.where((row < 0) | (row >= window.shape[0]), y - down, row)
        column = np.where((column < 0) | (column >= window.shape[1]), x - right, column)
        neighbour_values[:] = window[row, column]
    return np.asarray(np.median(values, axis=0))


PixelMask: TypeAlias = npt.NDArray[np.bool_]

#: Side of the surroundings, in pixels of each position, from which noise is estimated.
_MIN_WINDOW = 2 * TILE


@dataclass(frozen=True, eq=False)
class PlaneCount:
    """Histogram of the pixels of one CFA position in a region.

    Attributes
    ----------
    colour
        Channel of the position.
    value
        Levels that occur, in DN above black, rising, shape (k,).
    count
        Number of pixels at each level, shape (k,).
    saturated
        Number of pixels at white or above.
    hot
        Number of isolated outliers; None if they were not counted.
    noise
        Temporal noise of the pixels.
    cut_off
        Number of pixels at which the camera cut off noise below black.
    cut_off_dn, cut_off_sigma
        What the mean is lowered by for them in DN, and its standard uncertainty.
    """

    colour: str
    value: Floats
    count: Floats
    saturated: int
    hot: int | None
    noise: PlaneNoise
    cut_off: int = 0
    cut_off_dn: float = 0.0
    cut_off_sigma: float = 0.0


def count_planes(
    raw: RawFrame,
    areas: Sequence[tuple[int, int, int, int]],
    hot: PixelMask | None,
    outliers: bool,
) -> list[list[PlaneCount]]:
    """Count the pixels of every CFA position in each area, without the hot ones.

    Parameters
    ----------
    raw
        The RAW frame.
    areas
        Areas as x, y, width and height in pixels.
    hot
        Hot pixels to leave out, shape (height, width); None leaves out none.
    outliers
        Whether to count isolated outliers.

    Returns
    -------
    list of list of PlaneCount
        Counts of each area, for each CFA position row by row.
    """
    windows = [_Window.about(area, raw) for area in areas]
    planes = [
        plane if raw.cut_off is None else raw.levels_dn(plane)
        for window in windows
        for plane in window.planes()
    ]
    noises = plane_noise(planes)
    positions = raw.cfa_side**2
    return [
        _count_region(
            raw, area, hot, window, noises[positions * index : positions * (index + 1)], outliers
        )
        for index, (area, window) in enumerate(zip(areas, windows, strict=True))
    ]


@dataclass(frozen=True, eq=False)
class _Window:
    """Surroundings of a region, from which its noise is estimated.

    Attributes
    ----------
    pixels
        Part of the mosaic in DN.
    top, left
        Row and column of its first pixel on the sensor.
    cfa_side
        Period of the CFA in pixels.
    """

    pixels: Mosaic
    top: int
    left: int
    cfa_side: int

    @classmethod
    def about(cls, area: tuple[int, int, int, int], raw: RawFrame) -> "_Window":
        """Cut out the surroundings of an area of `raw`."""
        x, y, width, height = area
        left, window_width = _grow(x, width, raw.width, raw.cfa_side)
        top, window_height = _grow(y, height, raw.height, raw.cfa_side)
        return cls(
            raw.mosaic[top : top + window_height, left : left + window_width],
            top,
            left,
            raw.cfa_side,
        )

    def planes(self) -> Iterator[Mosaic]:
        """Iterate over the pixels of every CFA position, row by row of the CFA."""
        side = self.cfa_side
        for row, column in np.ndindex(side, side):
            yield self.pixels[(row - self.top) % side :: side, (column - self.left) % side :: side]


def _count_region(
    raw: RawFrame,
    area: tuple[int, int, int, int],
    hot: PixelMask | None,
    window: _Window,
    noises: Sequence[PlaneNoise],
    outliers: bool,
) -> list[PlaneCount]:
    """Count the pixels of every CFA position in a region; `noises` are those of its window."""
    x, y, width, height = area
    side = raw.cfa_side
    noise_by_position = dict(zip(np.ndindex(side, side), noises, strict=True))
    hot_counts = _count_outliers(raw, area, hot, window, noise_by_position) if outliers else {}
    planes = []
    for (row, column), noise in noise_by_position.items():
        slices = (
            slice(y + (row - y) % side, y + height, side),
            slice(x + (column - x) % side, x + width, side),
        )
        plane = np.ascontiguousarray(raw.mosaic[slices])
        level, pixels = count_levels(plane, None if hot is None else hot[slices])
        count = pixels.astype(np.float64)
        position = side * row + column
        plane_count = PlaneCount(
            colour=raw.cfa[position],
            value=np.asarray(raw.levels_dn(level) - raw.black[position]),
            count=count,
            saturated=int(count[level >= raw.white].sum()),
            hot=hot_counts.get((row, column)),
            noise=noise,
        )
        if raw.cut_off is not None:
            lowest = float(count[level == raw.cut_off.lowest_dn].sum())
            black_dn = raw.black[position] - raw.cut_off.lowest_dn
            plane_count = _uncut(plane_count, raw.cut_off, black_dn, lowest)
            raised = level - raw.black[position] - plane_count.value
            plane_count = replace(
                plane_count, cut_off_dn=float(raised @ count) / max(float(count.sum()), 1.0)
            )
        planes.append(plane_count)
    return planes


def _uncut(plane: PlaneCount, cut_off: BlackCutOff, black_dn: float, lowest: float) -> PlaneCount:
    """Return a count whose mean is right though `lowest` of its pixels are cut off.

    `black_dn` is the black level above the number at which they are cut off.
    """
    n = float(plane.count.sum())
    if lowest > TOO_MANY * n > 0:
        raise FrameError(
            f"{100 * lowest / n:.1f} % of the {plane.colour} pixels are cut off at black, so that "
            "their level cannot be estimated: the camera subtracts more than its black level; "
            "raise its black level (offset, brightness) if it has such a setting, or take another "
            "camera"
        )
    mean = float(plane.value @ plane.count) / max(n, 1.0) + black_dn
    level = float(cut_off.level_dn(np.asarray(mean)))
    variance = plane.noise.mean_variance * cut_off.sensitivity(mean) ** 2
    return replace(
        plane,
        value=plane.value + (level - mean),
        cut_off=int(lowest),
        cut_off_sigma=cut_off.level_dn_sigma(mean),
        noise=replace(plane.noise, mean_variance=variance),
    )


def _count_outliers(
    raw: RawFrame,
    area: tuple[int, int, int, int],
    hot: PixelMask | None,
    window: _Window,
    noises: Mapping[tuple[int, int], PlaneNoise],
) -> dict[tuple[int, int], int]:
    """Count the isolated outliers of every CFA position in a region, without the hot pixels."""
    x, y, width, height = area
    side = raw.cfa_side
    out_y, out_x = isolated_outliers(window.pixels, (window.top, window.left), side, noises)
    inside = (y <= out_y) & (out_y < y + height) & (x <= out_x) & (out_x < x + width)
    out_y, out_x = out_y[inside], out_x[inside]
    if hot is not None:
        is_hot = hot[out_y, out_x]
        out_y, out_x = out_y[~is_hot], out_x[~is_hot]
    return {
        (row, column): int(np.count_nonzero((out_y % side == row) & (out_x % side == column)))
        for row, column in noises
    }


def _grow(start: int, length: int, limit: int, side: int) -> tuple[int, int]:
    """Grow a side of a region about its middle to the length that noise needs, inside the frame."""
    window_length = min(max(length, _MIN_WINDOW * side), limit)
    return min(max(start - (window_length - length) // 2, 0), limit - window_length), window_length


#: Quantile that measures how close to clipping a channel is, insensitive to a few hot pixels.
PEAK_QUANTILE = 0.995


@dataclass(frozen=True)
class ChannelStats:
    """Statistics of one colour channel in a region, in DN above black.

    Parameters
    ----------
    mean
        Mean of the pixels.
    sigma
        Standard uncertainty of `mean` by photon and read noise of this frame: the scatter of
        repeated frames. Flicker, dark level and fixed pattern are not in it.
    std
        Standard deviation of the pixels, with the sample's structure and shading.
    peak
        99.5 % quantile of the pixels.
    n
        Number of pixels.
    saturated
        Number of pixels at or above white.
    hot
        Number of pixels that exceed their neighbours by more than 8 standard deviations; None if
        they were not counted.
    cut_off
        Number of pixels at which the camera cut off noise below black, for which `mean` is
        corrected.
    cut_off_dn
        What `mean` is lowered by in that correction.
    cut_off_sigma
        Part of `sigma` by that correction, which all pixels of the frame have in common.
    rounding_sigma
        Part of `sigma` by rounding to whole numbers, which pixels have in common as far as their
        values do not spread over a step.
    read_dn
        Read noise in DN by which it is; None of a camera that cuts off none.
    """

    mean: float
    sigma: float
    std: float
    peak: float
    n: int
    saturated: int
    hot: int | None
    cut_off: int = 0
    cut_off_dn: float = 0.0
    cut_off_sigma: float = 0.0
    rounding_sigma: float = 0.0
    read_dn: float | None = None

    @property
    def clipped(self) -> bool:
        """Whether so many pixels are saturated that the mean is too small."""
        return bool(is_clipped(self.saturated, self.n))


@dataclass(frozen=True)
class FrameMeasurement:
    """Statistics of the channels of a region, and the settings of the frame.

    Attributes
    ----------
    channels
        Statistics of `R`, `G` (all greens) and `B`, or of `L`, in DN above black.
    cfa, black, white, exposure_s, iso, f_number, make, model
        Colour filter array, levels and settings as in `RawFrame`.
    width, height
        Size of the frame in pixels.
    """

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
        """Whether any channel is clipped."""
        return any(stats.clipped for stats in self.channels.values())

    @property
    def range_dn(self) -> float:
        """Range from black to white in DN."""
        return self.white - max(self.black)

    def to_json(self) -> dict[str, Any]:
        """Return the object that `labrig frame --json` prints."""
        return {
            "channels": {
                name: {
                    "mean": stats.mean,
                    "sigma": stats.sigma,
                    "std": stats.std,
                    "n": stats.n,
                    "saturated": stats.saturated,
                    "hot": stats.hot,
                    "cut_off": stats.cut_off,
                    "read_noise": stats.read_dn,
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
        """Return a table for people, values in DN above black."""
        make = self.make if self.make and self.make not in (self.model or "") else None
        body = " ".join(filter(None, (make, self.model))) or "unknown camera"
        settings = [
            None if self.exposure_s is None else f"{self.exposure_s:.4g} s",
            None if self.iso is None else f"ISO {self.iso:g}",
            None if self.f_number is None else f"f/{self.f_number:g}",
        ]
        black = ", ".join(f"{level:g}" for level in dict.fromkeys(self.black))
        rows = [
            f"{name:<4}{stats.mean:>12.2f}{stats.sigma:>10.3f}{stats.std:>10.2f}"
            f"{stats.n:>11}{stats.saturated:>9}{'–' if stats.hot is None else stats.hot:>6}"
            for name, stats in self.channels.items()
        ]
        return "\n".join(
            [
                f"{body}, {', '.join(filter(None, settings)) or 'exposure not recorded'}",
                f"{self.width} x {self.height} pixels, {self.cfa}, black {black}, "
                f"white {self.white:g}",
                f"    {'mean / DN':>12}{'σ':>10}{'std':>10}{'pixels':>11}{'clipped':>9}{'hot':>6}",
                *rows,
                *self._cut_off_lines(),
            ]
        )

    def _cut_off_lines(self) -> list[str]:
        """Return a sentence on noise below black that is missing; nothing if none is."""
        cut = {name: stats for name, stats in self.channels.items() if stats.read_dn is not None}
        if not cut:
            return []
        parts = ", ".join(
            f"{name} {100 * stats.cut_off / stats.n:.1f} % (read noise {stats.read_dn:.3g} DN)"
            for name, stats in cut.items()
        )
        return [
            "The camera subtracts black and cuts off noise below it; pixels cut off: "
            f"{parts}. The means are corrected for it."
        ]


def measure(
    raw: RawFrame, region: Region | None = None, hot: PixelMask | None = None
) -> FrameMeasurement:
    """Measure mean, noise and saturation of each colour channel in a region of a frame.

    Parameters
    ----------
    raw
        The RAW frame.
    region
        Region as (x, y, width, height) in fractions of the frame; None takes the whole frame.
    hot
        Hot pixels to leave out, shape (height, width), as `hot_pixels` finds them in dark frames.

    Returns
    -------
    FrameMeasurement
        The statistics of each channel in DN above black, and the settings of the exposure.

    Raises
    ------
    UsageError
        The region leaves the frame.
    DataError
        The mask `hot` is of another sensor, or leaves no pixel of a channel.

    Examples
    --------
    >>> from pathlib import Path
    >>> import labrig
    >>> raw = labrig.read_raw("frame.dng")
    >>> measured = labrig.measure(raw, region=(0.25, 0.25, 0.5, 0.5))
    >>> for name, stats in measured.channels.items():
    ...     print(f"{name} {stats.mean:.0f} DN, sigma {stats.sigma:.1f} DN, {stats.n} pixels")
    R 70 DN, sigma 0.7 DN, 384 pixels
    G 590 DN, sigma 0.8 DN, 768 pixels
    B 337 DN, sigma 0.9 DN, 384 pixels
    """
    return measure_regions(raw, [region], hot, outliers=True)[0]


def measure_regions(
    raw: RawFrame,
    regions: Sequence[Region | None],
    hot: PixelMask | None = None,
    *,
    outliers: bool = False,
) -> list[FrameMeasurement]:
    """Measure each channel of a frame in each region.

    Parameters
    ----------
    raw
        The RAW frame.
    regions
        Regions as (x, y, width, height) in fractions of the frame; None is the whole frame.
    hot
        Hot pixels to leave out, shape (height, width), as `hot_pixels` finds them in dark frames.
    outliers
        Whether to count isolated outliers, of which a series makes no use.

    Returns
    -------
    list of FrameMeasurement
        The statistics of each region.

    Raises
    ------
    UsageError
        A region leaves the frame.
    DataError
        The mask `hot` is of another sensor, or leaves no pixel of a channel.

    See Also
    --------
    measure : Statistics of one region, outliers included.

    Examples
    --------
    >>> from labrig.reduce import measure_regions, read_raw
    >>> left, right = (0.0, 0.0, 0.5, 1.0), (0.5, 0.0, 0.5, 1.0)
    >>> for measured in measure_regions(read_raw("frame.dng"), [left, right]):
    ...     print(f"{measured.channels['G'].mean:.0f} DN")
    371 DN
    370 DN
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
    return [_measured(raw, planes) for planes in count_planes(raw, areas, hot, outliers)]


def _measured(raw: RawFrame, planes: Sequence[PlaneCount]) -> FrameMeasurement:
    return FrameMeasurement(
        channels={
            name: replace(
                _channel(name, [plane for plane in planes if plane.colour == name]),
                read_dn=None if raw.cut_off is None else raw.cut_off.read_dn,
            )
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
    """Return the statistics over all CFA positions of a colour."""
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
    std = float(np.sqrt(spread / max(n - 1, 1)))
    rounding_sigma = _rounding_sigma(std, planes)
    # One read noise for all pixels of the frame: its error does not average out.
    cut_off_sigma = sum(plane.cut_off_sigma * float(plane.count.sum()) for plane in planes) / n
    outliers = [plane.hot for plane in planes if plane.hot is not None]
    return ChannelStats(
        mean=mean,
        sigma=float(np.sqrt(variance + rounding_sigma**2 + cut_off_sigma**2)),
        std=std,
        peak=float(peak),
        n=int(n),
        saturated=sum(plane.saturated for plane in planes),
        hot=sum(outliers) if outliers else None,
        cut_off=sum(plane.cut_off for plane in planes),
        cut_off_dn=sum(plane.cut_off_dn * float(plane.count.sum()) for plane in planes) / n,
        cut_off_sigma=cut_off_sigma,
        rounding_sigma=rounding_sigma,
    )


def _rounding_sigma(std_dn: float, planes: Sequence[PlaneCount]) -> float:
    """Return σ of a mean in DN by rounding, whose error is in all pixels unless values spread."""
    steps = np.concatenate([np.diff(np.rint(plane.value)) for plane in planes])
    step_dn = int(np.gcd.reduce(steps.astype(np.int64))) or 1
    spread = (std_dn / step_dn) ** 2
    if spread > _DITHERED_VARIANCE:
        return 0.0
    return step_dn * float(np.sqrt(shared_rounding_variance(unrounded_variance(np.array(spread)))))
