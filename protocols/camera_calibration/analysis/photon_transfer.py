"""Gain and read noise of a sensor from pairs of frames of the same light.

The variance is that of reading and that of photons, which rises with the light by the reciprocal of
the gain, and bends with the sensor (module `linearity`): gain and bend are fitted together. The
difference of two frames holds no pattern of pixels, card or lens. Rounding is taken out as
`labrig.reduce.rounding` and, where noise is less than a step of the converter's numbers, the module
`read_noise` say.

Where pixels share charge with their neighbours, each one scatters less than its photons do. The
covariances with the eight neighbours compensate for it: a pixel's lost charge is in its neighbours
(A. C. Moore, Z. Ninkov, W. J. Forrest, Optical Engineering 45, 2006). They are always added: a gain
without those that are lost in the noise would appear more certain than it is.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.special import chdtrc

from labrig.calibration import Noise
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.foundation.region import Region, region_pixels
from labrig.protocols.camera_calibration.analysis.linearity import Bend, photon_terms
from labrig.protocols.camera_calibration.analysis.read_noise import (
    RESOLVED,
    NumberCounts,
    counted_noise,
)
from labrig.protocols.camera_calibration.result import PairScatter, PhotonTransfer
from labrig.record import FrameRecord
from labrig.reduce import (
    ROUNDING_VARIANCE,
    LinearFrame,
    RawFrame,
    measure,
)
from labrig.results import Measured

#: Standard deviations beyond which a pixel is hot, or was hit by a cosmic ray.
OUTLIER_SIGMAS = 6.0
#: Brightness of a lit frame in standard deviations of its pixels.
LIT_SIGMAS = 3.0
#: Most pixels across and down; more take memory without more precision.
MAX_PIXELS = 1024
#: Probability of a χ² below which variances scatter by more than their σ, which are then raised:
#: the numbers of pixels tell σ, and raising it for every χ² above its mean would make it too large.
BY_CHANCE = 0.01
#: Offsets of half of the eight neighbours; the others are symmetric.
_NEIGHBOURS = ((0, 1), (1, -1), (1, 0), (1, 1))


@dataclass(frozen=True, eq=False)
class Pair:
    """Two frames of the same light.

    Attributes
    ----------
    scatter
        Their scatter.
    counts
        Their numbers, at each position of the colour filter, where these resolve the scatter badly;
        otherwise empty.
    """

    scatter: PairScatter
    counts: tuple[NumberCounts, ...] = ()


@dataclass(frozen=True)
class MeasurePair:
    """Measurement of the scatter between the two frames of a pair.

    Attributes
    ----------
    region
        Region in fractions of the frame.
    dark_dn
        Dark level above black in DN.
    """

    region: Region
    dark_dn: float

    def __call__(self, frames: Iterator[RawFrame]) -> tuple[Pair, ...]:
        """Measure a pair; there is none if the first frame clips."""
        first, second = frames
        if measure(first, self.region).clipped:
            return ()
        return (measure_pair(first, second, self.region, self.dark_dn),)


def measure_pair(
    first_frame: RawFrame, second_frame: RawFrame, region: Region, dark_dn: float
) -> Pair:
    """Measure the scatter between two frames of one exposure in a region.

    Parameters
    ----------
    first_frame, second_frame
        The two frames.
    region
        Region in fractions of the frame.
    dark_dn
        Dark level above black in DN.

    Raises
    ------
    DataError
        The frames are of different sensors.
    """
    if first_frame.mosaic.shape != second_frame.mosaic.shape or first_frame.cfa != second_frame.cfa:
        raise DataError("expected pairs of frames of one sensor; choose those of one camera")
    area = _central_area(region_pixels(region, first_frame.width, first_frame.height))
    dark = np.full(len(first_frame.channels), dark_dn)
    values = [LinearFrame(frame, dark).value_dn(area) for frame in (first_frame, second_frame)]
    difference, levels = np.zeros(values[0].shape), []
    for row, column in np.ndindex(first_frame.cfa_side, first_frame.cfa_side):
        slices = np.s_[row :: first_frame.cfa_side, column :: first_frame.cfa_side]
        first, second = (value[slices] for value in values)
        first_level, second_level = float(first.mean()), float(second.mean())
        # Flicker is no noise of pixels; in the dark there is nothing to scale by.
        is_lit = min(first_level, second_level) > LIT_SIGMAS * float(first.std())
        scale = first_level / second_level if is_lit else 1.0
        scaled_difference = first - scale * second
        difference[slices] = (scaled_difference - scaled_difference.mean()) / np.sqrt(1 + scale**2)
        difference[slices] *= _uncut(first_frame, first_level + dark_dn)
        levels.append((first_level + second_level) / 2)
    step_dn = _step_dn(first_frame, area)
    scatter = _difference_scatter(difference, levels, step_dn)
    is_resolved = scatter.total_variance_dn2 > (RESOLVED + ROUNDING_VARIANCE) * step_dn**2
    counts = () if is_resolved else _counts(first_frame, second_frame, area, step_dn)
    return Pair(scatter, counts)


def _step_dn(frame: RawFrame, area: tuple[int, int, int, int]) -> int:
    """Return the step of the numbers in DN: 4 of a camera with 12 bits that writes 14."""
    x, y, width, height = area
    numbers = np.flatnonzero(np.bincount(frame.mosaic[y : y + height, x : x + width].ravel()))
    return max(int(np.gcd.reduce(np.diff(numbers))), 1) if len(numbers) > 1 else 1


def _counts(
    first: RawFrame, second: RawFrame, area: tuple[int, int, int, int], step_dn: int
) -> tuple[NumberCounts, ...]:
    x, y, width, height = area
    side = first.cfa_side
    ends = min(first.black) < step_dn
    counts = []
    for row, column in np.ndindex(side, side):
        plane = np.s_[y + row : y + height : side, x + column : x + width : side]
        counts.append(NumberCounts.of(first.mosaic[plane], second.mosaic[plane], step_dn, ends))
    return tuple(counts)


def _uncut(frame: RawFrame, level_dn: float) -> float:
    """Return the noise of pixels at a level above black over that of what a camera left of it."""
    cut_off = frame.cut_off
    return (
        1.0
        if cut_off is None
        else cut_off.noise_ratio(level_dn + min(frame.black) - cut_off.lowest_dn)
    )


def _central_area(area: tuple[int, int, int, int]) -> tuple[int, int, int, int]:
    """Return the middle of an area x, y, width, height, large enough to measure noise to 0.2 %."""
    x, y, width, height = area
    wide, high = min(width, MAX_PIXELS), min(height, MAX_PIXELS)
    return x + (width - wide) // 2, y + (height - high) // 2, wide, high


def _difference_scatter(
    difference: FloatArray, levels_dn: Sequence[float], step_dn: int
) -> PairScatter:
    robust = 1.4826 * float(np.median(np.abs(difference)))
    kept = np.abs(difference) <= OUTLIER_SIGMAS * max(robust, step_dn)
    clean = np.where(kept, difference, 0.0)
    columns = clean.shape[1]
    rows = clean.sum(axis=1) / kept.sum(axis=1)
    deviations = np.where(kept, clean - rows[:, np.newaxis], 0.0)
    variance = float(np.square(deviations).sum() / kept.sum())
    covariances = [_covariance(deviations, down, right) for down, right in _NEIGHBOURS]
    # What its mean has taken from each row: pixels that share noise make more of it.
    row_mean_variance = (variance + 2 * covariances[0]) / columns
    fourth = float(np.square(np.square(deviations)).sum() / kept.sum())
    return PairScatter(
        float(np.mean(levels_dn)),
        tuple(levels_dn),
        variance_dn2=variance + row_mean_variance,
        neighbours_dn2=2 * (sum(covariances) + row_mean_variance),
        row_variance_dn2=max(float(np.square(rows).mean()) - row_mean_variance, 0.0),
        kurtosis=fourth / variance**2 if variance else 3.0,
        pixels=int(kept.sum()),
        step_dn=step_dn,
    )


def _covariance(values: FloatArray, down: int, right: int) -> float:
    """Return the covariance with the pixel `down` rows below and `right` columns to the right."""
    rows, columns = values.shape
    shifted = values[down:, max(right, 0) : columns + min(right, 0)]
    unmoved = values[: rows - down, max(-right, 0) : columns - max(right, 0)]
    return float((shifted * unmoved).mean())


def photon_transfer(
    iso: float, lit: Sequence[Pair], dark: Sequence[Pair], bend: Bend
) -> PhotonTransfer:
    """Fit gain and bend to lit pairs, and measure the read noise of dark ones.

    Parameters
    ----------
    iso
        The ISO of the frames.
    lit, dark
        Pairs of lit frames, and of dark ones.
    bend
        The sensor's bend by the ratios of channels.

    Raises
    ------
    DataError
        There are too few pairs, or the variance does not rise with the light.
    """
    if len(lit) < 2 or not dark:
        raise DataError(
            f"expected pairs of lit frames at two levels and of dark frames at ISO {iso:g}, got "
            f"{len(lit)} and {len(dark)}; take more"
        )
    read = _read_noise(dark)
    every = [_light_variance(pair) for pair in lit]
    points = [point for point in every if point is not None]
    if len(points) < 2:
        raise DataError(
            f"expected noise of at least half a step of the camera's numbers at ISO {iso:g}, got "
            "less than these resolve; add light, or choose a higher ISO"
        )
    dark_variance = _dark_light_variance(read, dark)
    line = _fit_line(points, dark_variance, bend)
    if not line.slope.value > 0:
        raise DataError(
            f"expected noise that rises with the light at ISO {iso:g}, got {line.slope.value:.3g} "
            "per DN; is the card lit, and 'card:' its region?"
        )
    gain = 1 / line.slope.value
    relative = line.slope.sigma / line.slope.value
    row = np.sqrt(np.mean([pair.scatter.row_variance_dn2 for pair in dark]))
    noise = Noise(
        iso=iso,
        gain_e_per_dn=gain,
        gain_e_per_dn_sigma=gain * relative,
        read_noise_e=read.value_dn * gain,
        read_noise_e_sigma=gain * float(np.hypot(read.sigma_dn, read.value_dn * relative)),
        read_noise_is_limit=read.is_limit,
        row_noise_e=float(row * gain),
    )
    scatters = tuple(pair.scatter for pair in lit)
    photons = tuple(
        None if point is None else point.variance_dn2 - dark_variance.value for point in every
    )
    shared, shared_sigma = _shared_noise(scatters)
    return PhotonTransfer(
        noise, scatters, photons, shared, shared_sigma, line.reduced_chi2, line.bend
    )


@dataclass(frozen=True)
class _ReadNoise:
    """Read noise of a pixel without the row noise in DN; where `is_limit` it is below the value."""

    value_dn: float
    sigma_dn: float
    is_limit: bool = False


def _read_noise(dark: Sequence[Pair]) -> _ReadNoise:
    step_dn = max(pair.scatter.step_dn for pair in dark)
    row_variance = float(np.mean([pair.scatter.row_variance_dn2 for pair in dark]))
    counts = [each for pair in dark for each in pair.counts]
    # Only of the quieter ones of pairs that chance divides the noise would be too low.
    if not all(pair.counts for pair in dark):
        variance = float(np.mean([pair.scatter.variance_dn2 for pair in dark]))
        kurtosis = float(np.mean([pair.scatter.kurtosis for pair in dark]))
        pixels = sum(pair.scatter.pixels for pair in dark)
        value = np.sqrt(variance - ROUNDING_VARIANCE * step_dn**2)
        return _ReadNoise(
            float(value), float(variance * np.sqrt((kurtosis - 1) / pixels) / 2 / value)
        )
    noise = counted_noise(counts)
    value, sigma = noise.value * step_dn, noise.sigma * step_dn
    if noise.is_limit:
        return _ReadNoise(value, 0.0, is_limit=True)
    alone = float(np.sqrt(max(value**2 - row_variance, 0.01 * value**2)))
    return _ReadNoise(alone, sigma * value / alone)


def _dark_light_variance(read: _ReadNoise, dark: Sequence[Pair]) -> Measured:
    """Return what lit frames have of the noise of dark ones in DN²."""
    neighbours = float(np.mean([pair.scatter.neighbours_dn2 for pair in dark]))
    pixels = sum(pair.scatter.pixels for pair in dark)
    variance = float(np.mean([pair.scatter.variance_dn2 for pair in dark]))
    covariances = 4 * variance / np.sqrt(pixels)
    if read.is_limit:
        # Anything up to the limit.
        half = sigma = read.value_dn**2 / 2
    else:
        half, sigma = read.value_dn**2, 2 * read.value_dn * read.sigma_dn
    return Measured(half + neighbours, float(np.hypot(sigma, covariances)))


@dataclass(frozen=True)
class _Point:
    """Variance of light at one level.

    Attributes
    ----------
    levels_dn
        Level of each position of the colour filter above dark in DN.
    variance_dn2
        Variance of a pixel before its numbers are rounded, in DN².
    rounding_dn2
        What rounding adds to the scatter of the numbers in DN².
    relative_sigma
        σ of the variance over that of the numbers.
    """

    levels_dn: tuple[float, ...]
    variance_dn2: float
    rounding_dn2: float
    relative_sigma: float


def _light_variance(pair: Pair) -> _Point | None:
    """Return the variance of light by a pair; None where the numbers do not resolve it."""
    scatter = pair.scatter
    # Of n pixels the variance V has a variance of (κ − 1) V²/n, each of the covariances with the
    # four neighbours, which count twice, V²/n.
    relative_sigma = float(np.sqrt((scatter.kurtosis - 1 + 16) / scatter.pixels))
    rounding = ROUNDING_VARIANCE * scatter.step_dn**2
    if pair.counts:
        noises = [counted_noise([each]) for each in pair.counts]
        if any(noise.is_limit for noise in noises):
            return None
        value, sigma = np.array([(noise.value, noise.sigma) for noise in noises]).T
        variance = scatter.step_dn**2 * float(np.square(value).mean())
        rounding = scatter.total_variance_dn2 - variance
        counted = scatter.step_dn**2 * float(np.linalg.norm(2 * value * sigma)) / len(noises)
        relative_sigma = float(
            np.hypot(counted / scatter.variance_dn2, 4 / np.sqrt(scatter.pixels))
        )
    variance = scatter.light_variance_dn2 - rounding
    return _Point(scatter.levels_dn, variance, rounding, relative_sigma)


def _shared_noise(lit: Sequence[PairScatter]) -> tuple[float, float]:
    """Return the neighbours' covariance over a pixel's variance, and its σ if there is none."""
    pixels = np.array([point.pixels for point in lit])
    ratio = np.array(
        [point.neighbours_dn2 / max(point.variance_dn2, ROUNDING_VARIANCE) for point in lit]
    )
    sigma = 2 * np.sqrt(len(_NEIGHBOURS) / pixels.sum())
    return float(ratio @ pixels / pixels.sum()), float(sigma)


@dataclass(frozen=True)
class _Line:
    """Photons' variance per DN of faint light, bend at white, and reduced χ²."""

    slope: Measured
    bend: Measured
    reduced_chi2: float


def _fit_line(points: Sequence[_Point], dark: Measured, bend: Bend) -> _Line:
    """Fit variance = dark + slope · photons' terms of the bent sensor."""
    levels = np.array([point.levels_dn for point in points])
    variance = np.array([point.variance_dn2 for point in points])
    rounding = np.array([point.rounding_dn2 for point in points])
    relative = np.array([point.relative_sigma for point in points])
    whitened = np.linalg.inv(np.linalg.cholesky(bend.covariance))
    start = float((variance - dark.value).sum() / levels.mean(axis=1).sum())

    def model(parameters: FloatArray) -> FloatArray:
        slope, first, second, dark_variance = parameters
        terms = photon_terms(np.array([first, second]), levels, bend.range_dn).mean(axis=1)
        return np.asarray(dark_variance + slope * terms)

    parameters = np.array([start, *bend.coefficients, dark.value])
    scale = np.array([abs(start) or 1.0, 0.01, 0.01, dark.sigma])
    for _ in range(3):
        # By the expected variance: a measured one that is too small by chance would count more.
        sigmas = relative * np.maximum(model(parameters) + rounding, 1e-3 * variance.max())

        def misfit(trial: FloatArray, sigmas: FloatArray = sigmas) -> FloatArray:
            return np.concatenate(
                [
                    (variance - model(trial)) / sigmas,
                    whitened @ (trial[1:3] - bend.coefficients),
                    [(trial[3] - dark.value) / dark.sigma],
                ]
            )

        fit = least_squares(misfit, parameters, x_scale=scale)
        parameters = fit.x
    reduced = float(2 * fit.cost) / (len(points) - 1)
    jacobian: FloatArray = np.asarray(fit.jac, dtype=np.float64)
    covariance = np.linalg.inv(jacobian.T @ jacobian)
    if chdtrc(len(points) - 1, 2 * fit.cost) < BY_CHANCE:
        covariance *= reduced
    return _Line(
        Measured(float(parameters[0]), float(np.sqrt(covariance[0, 0]))),
        Measured(float(parameters[1:3].sum()), float(np.sqrt(covariance[1:3, 1:3].sum()))),
        reduced,
    )


def pairs_of(frames: Sequence[FrameRecord]) -> list[tuple[FrameRecord, FrameRecord]]:
    """Return successive frames of the same exposure time, two by two."""
    pairs: list[tuple[FrameRecord, FrameRecord]] = []
    previous: FrameRecord | None = None
    for frame in frames:
        if previous is not None and previous.exposure_s == frame.exposure_s:
            pairs.append((previous, frame))
            previous = None
        else:
            previous = frame
    return pairs
