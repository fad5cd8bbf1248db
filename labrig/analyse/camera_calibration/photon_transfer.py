"""Gain and read noise of a sensor from pairs of frames of the same light.

The model is that of `labrig.reduce.photon_transfer`; the gain is the reciprocal of its photons'
part. The difference of two frames holds no pattern of pixels, card or lens.

Where pixels share charge with their neighbours, each one scatters less than its photons do. The
covariances with the eight neighbours compensate for it: a pixel's lost charge is in its neighbours
(A. C. Moore, Z. Ninkov, W. J. Forrest, Optical Engineering 45, 2006). They are always added: a gain
without those that are lost in the noise would appear more certain than it is.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from labrig.calibration import Noise
from labrig.errors import DataError
from labrig.record import FrameRecord
from labrig.reduce import (
    ROUNDING_VARIANCE,
    LinearFrame,
    NoiseModel,
    RawFrame,
    measure,
    variance_terms,
)
from labrig.region import Region, region_pixels
from labrig.results import FloatArray, PairScatter, PhotonTransfer

#: Standard deviations beyond which a pixel is hot, or was hit by a cosmic ray.
OUTLIER_SIGMAS = 6.0
#: Brightness of a lit frame in standard deviations of its pixels.
LIT_SIGMAS = 3.0
#: Most pixels across and down; more take memory without more precision.
MAX_PIXELS = 1024
#: Offsets of half of the eight neighbours; the others are symmetric.
_NEIGHBOURS = ((0, 1), (1, -1), (1, 0), (1, 1))


@dataclass(frozen=True)
class MeasureScatter:
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

    def __call__(self, frames: Iterator[RawFrame]) -> tuple[PairScatter, ...]:
        """Measure the scatter of a pair; there is none if the first frame clips."""
        first, second = frames
        if measure(first, self.region).clipped:
            return ()
        return (scatter(first, second, self.region, self.dark_dn),)


def scatter(
    first_frame: RawFrame, second_frame: RawFrame, region: Region, dark_dn: float
) -> PairScatter:
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
    return _difference_scatter(difference, float(np.mean(levels)))


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


def _difference_scatter(difference: FloatArray, level_dn: float) -> PairScatter:
    robust = 1.4826 * float(np.median(np.abs(difference)))
    kept = np.abs(difference) <= OUTLIER_SIGMAS * max(robust, 1.0)
    clean = np.where(kept, difference, 0.0)
    columns = clean.shape[1]
    rows = clean.sum(axis=1) / kept.sum(axis=1)
    deviations = np.where(kept, clean - rows[:, np.newaxis], 0.0)
    variance = float(np.square(deviations).sum() / kept.sum())
    covariances = [_covariance(deviations, down, right) for down, right in _NEIGHBOURS]
    # What its mean has taken from each row: pixels that share noise make more of it.
    row_mean_variance = (variance + 2 * covariances[0]) / columns
    return PairScatter(
        level_dn,
        variance_dn2=variance + row_mean_variance,
        neighbours_dn2=2 * (sum(covariances) + row_mean_variance),
        row_variance_dn2=max(float(np.square(rows).mean()) - row_mean_variance, 0.0),
        pixels=int(kept.sum()),
    )


def _covariance(values: FloatArray, down: int, right: int) -> float:
    """Return the covariance with the pixel `down` rows below and `right` columns to the right."""
    rows, columns = values.shape
    shifted = values[down:, max(right, 0) : columns + min(right, 0)]
    unmoved = values[: rows - down, max(-right, 0) : columns - max(right, 0)]
    return float((shifted * unmoved).mean())


def photon_transfer(
    iso: float, lit: Sequence[PairScatter], dark: Sequence[PairScatter]
) -> PhotonTransfer:
    """Fit the gain to lit pairs, and measure the read noise of dark ones.

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
    level = np.array([point.level_dn for point in lit])
    variance = np.array([point.light_variance_dn2 for point in lit])
    # Of n pixels the variance V has a variance of 2 V²/n, each of the covariances with the four
    # neighbours, which count twice, V²/n: 9 times as much together.
    dof = np.array([point.pixels for point in lit]) / 9
    dark_variance = float(np.mean([point.variance_dn2 for point in dark]))
    dark_light_variance = float(np.mean([point.light_variance_dn2 for point in dark]))
    slope, sigma, chi2 = _fit_line(level, variance, dark_light_variance, dof)
    if not slope > 0:
        raise DataError(
            f"expected noise that rises with the light at ISO {iso:g}, got {slope:.3g} per DN; is "
            "the card lit, and 'card:' its region?"
        )
    gain = 1 / slope
    read = np.sqrt(max(dark_variance - ROUNDING_VARIANCE, 0.0))
    pixels = sum(point.pixels for point in dark)
    row = np.sqrt(np.mean([point.row_variance_dn2 for point in dark]))
    noise = Noise(
        iso=iso,
        gain_e_per_dn=gain,
        gain_e_per_dn_sigma=gain * sigma / slope,
        read_noise_e=float(read * gain),
        read_noise_e_sigma=float(read * gain * np.hypot(sigma / slope, 1 / np.sqrt(2 * pixels))),
        row_noise_e=float(row * gain),
    )
    return PhotonTransfer(noise, tuple(lit), *_shared_noise(lit), chi2)


def _shared_noise(lit: Sequence[PairScatter]) -> tuple[float, float]:
    """Return the neighbours' covariance over a pixel's variance, and its σ if there is none."""
    pixels = np.array([point.pixels for point in lit])
    ratio = np.array(
        [point.neighbours_dn2 / max(point.variance_dn2, ROUNDING_VARIANCE) for point in lit]
    )
    sigma = 2 * np.sqrt(len(_NEIGHBOURS) / pixels.sum())
    return float(ratio @ pixels / pixels.sum()), float(sigma)


def _fit_line(
    level: FloatArray, variance: FloatArray, dark_variance: float, dof: FloatArray
) -> tuple[float, float, float]:
    """Return slope, its σ and reduced χ² of variance = dark + slope · level."""
    expected = variance
    for _ in range(3):
        sigmas = np.maximum(expected, ROUNDING_VARIANCE) * np.sqrt(2 / dof)
        line = NoiseModel.fit(variance_terms(level)[:, :2], variance, sigmas, dark_variance)
        expected = np.maximum(line.variance_dn2(level), 1e-3 * variance)
    residual = (variance - line.variance_dn2(level)) / sigmas
    misfit = float(residual @ residual) / max(len(level) - 1, 1)
    sigma = np.sqrt(max(misfit, 1.0) / np.square(level / sigmas).sum())
    return line.photon_dn, float(sigma), misfit


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
