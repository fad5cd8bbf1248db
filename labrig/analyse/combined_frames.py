"""Combination of frames through the LVF, and tests for differences beyond their brightness.

They are compared as measured, position by position: camera curves and filter, which are known to
some per cent, are common to both and cancel.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc

from labrig.foundation.arrays import FloatArray
from labrig.foundation.detection import DETECTION_SIGMA
from labrig.foundation.errors import DataError
from labrig.results import FilterFrames, SpectralComparison

#: Iterations of brightness and mean; each gains a digit or more.
COMBINING_ROUNDS = 20
#: Significance level, over all comparisons of a kind, of a difference of spectra.
LEVEL = 1e-3
#: Fraction of the highest value above which a place counts in the centroid.
BRIGHT = 0.02
#: Iterations of the reference's noise by the brightness.
COMPARING_ROUNDS = 5


@dataclass(frozen=True, eq=False)
class CombinedFrame:
    """Several frames combined into one.

    Attributes
    ----------
    value, sigma
        Combined values at the brightness of the first frame, and their standard uncertainties,
        shape (m,).
    brightness
        Brightness of every frame relative to the first, shape (f,).
    """

    value: FloatArray
    sigma: FloatArray
    brightness: FloatArray

    @property
    def shows_light(self) -> bool:
        """Whether the sum of all values is significant."""
        return bool(np.nansum(self.value) > DETECTION_SIGMA * np.sqrt(np.nansum(self.sigma**2)))


def combined(frames: FilterFrames) -> CombinedFrame:
    """Combine frames of different brightness."""
    weight = np.nan_to_num(1 / (frames.sigma_dn_per_s**2 + frames.dark_dn_per_s_sigma**2))
    value = np.nan_to_num(frames.value_dn_per_s)
    brightness = np.ones(len(frames))
    for _ in range(COMBINING_ROUNDS):
        total = (weight * brightness[:, np.newaxis] ** 2).sum(axis=0)
        with np.errstate(invalid="ignore", divide="ignore"):
            mean = (weight * value * brightness[:, np.newaxis]).sum(axis=0) / total
        finite_mean = np.nan_to_num(mean)
        brightness = (weight * value) @ finite_mean / (weight @ finite_mean**2)
        brightness = brightness / (brightness[0] or 1.0)
    with np.errstate(divide="ignore"):
        sigma = np.where(total > 0, 1 / np.sqrt(total), np.nan)
    return CombinedFrame(mean, sigma, brightness)


def visible(frames: FilterFrames) -> FilterFrames:
    """Return the frames in which light is detected.

    Raises
    ------
    DataError
        No frame shows light.
    """
    rows = [row for row in range(len(frames)) if combined(frames.take([row])).shows_light]
    if not rows:
        raise DataError(
            "expected light through the filter, got none above the noise: was the sample charged, "
            "is the variable filter where it was calibrated? (raise camera.iso, expose longer)"
        )
    return frames.take(rows)


def differ(comparisons: Sequence[SpectralComparison]) -> bool:
    """Return whether any of several comparisons is significant."""
    return any(comparison.p_value < LEVEL / len(comparisons) for comparison in comparisons)


def over_time(frames: FilterFrames, centre_nm: FloatArray) -> list[SpectralComparison]:
    """Compare every frame with all others together.

    Parameters
    ----------
    frames
        Frames after one charge.
    centre_nm
        Centre of the filter's band of every value in nm, shape (m,).
    """
    comparisons = []
    for row in range(len(frames)):
        others = combined(frames.take([other for other in range(len(frames)) if other != row]))
        comparisons.append(
            compared(f"{frames.t_s[row]:.3g} s", frames.take([row]), others, centre_nm)
        )
    return comparisons


def compared(
    what: str, frames: FilterFrames, reference: CombinedFrame, centre_nm: FloatArray
) -> SpectralComparison:
    """Compare frames with others that are combined."""
    mean = combined(frames)
    is_finite = np.isfinite(mean.value) & np.isfinite(reference.value)
    value, reference_value = mean.value[is_finite], reference.value[is_finite]
    gain, chi2 = float(value @ reference_value / (reference_value @ reference_value)), 0.0
    for _ in range(COMPARING_ROUNDS):
        variance = mean.sigma[is_finite] ** 2 + gain**2 * reference.sigma[is_finite] ** 2
        inverse = _inverse_covariance(variance)
        gain = float(
            reference_value @ inverse @ value / (reference_value @ inverse @ reference_value)
        )
        residual = value - gain * reference_value
        chi2 = float(residual @ inverse @ residual)
    dof = len(value) - 2
    excess = max(chi2 - dof, 0.0) / float(gain**2 * (reference_value @ inverse @ reference_value))
    shift, sigma = _centroid_shift(value, reference_value, gain, variance, centre_nm[is_finite])
    return SpectralComparison(
        what, gain, chi2, dof, float(chdtrc(dof, chi2)), float(np.sqrt(excess)), shift, sigma
    )


def _inverse_covariance(variance: FloatArray) -> FloatArray:
    """Return the inverse covariance of values with a free common offset.

    A sensor that has warmed since its dark frames is brighter everywhere by the same amount.
    """
    weight = 1 / variance
    inverse: FloatArray = np.diag(weight) - np.outer(weight, weight) / weight.sum()
    return inverse


def _centroid_shift(
    value: FloatArray,
    reference: FloatArray,
    gain: float,
    variance: FloatArray,
    centre_nm: FloatArray,
) -> tuple[float, float]:
    """Return the difference of the centroids in nm where the reference has its light, and its σ."""
    is_bright = reference > BRIGHT * reference.max()
    value, reference, variance, centre_nm = (
        value[is_bright],
        reference[is_bright],
        variance[is_bright],
        centre_nm[is_bright],
    )
    light = float(reference.sum())
    centroid_nm = float(centre_nm @ reference) / light
    lever = (centre_nm - centroid_nm) / (gain * light)
    return float(lever @ (value - gain * reference)), float(np.sqrt(lever**2 @ variance))
