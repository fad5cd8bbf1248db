"""Entries of a re-radiation matrix to which mixtures are fitted.

Noise scatters about a third of all entries below zero, which no density reproduces, and a mixture
that follows the positive ones covers the whole matrix. Entries that are not above the noise are
therefore set to zero before the fit (Hua et al. 2021, section 5.1).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from labrig.errors import DataError, UsageError
from labrig.fit.least_squares import FloatArray
from labrig.fit.mixture.gaussians import monomials_of
from labrig.material import ReradiationMatrix

#: Expected fraction of noise among the entries that are kept (Benjamini and Hochberg, *Journal of
#: the Royal Statistical Society B* 57, 1995).
FALSE_DISCOVERY_RATE = 0.05


@dataclass(frozen=True, eq=False)
class StokesEntries:
    """Measured entries with λ_o > λ_i, those below the threshold set to 0.

    Attributes
    ----------
    input_nm, output_nm
        Centres of the entries' bands in nm, shape (N,).
    input_width_nm, output_width_nm
        Widths of the entries' bands in nm, shape (N,).
    value
        Fraction of the light of the input band that comes back in the output band, shape (N,).
    is_kept
        Whether the entry is above the threshold, shape (N,).
    threshold
        The least value that is kept.
    """

    input_nm: FloatArray
    output_nm: FloatArray
    input_width_nm: FloatArray
    output_width_nm: FloatArray
    value: FloatArray
    is_kept: NDArray[np.bool_]
    threshold: float

    @property
    def mass(self) -> FloatArray:
        """Integral of the re-radiation over each entry in nm, shape (N,)."""
        return self.value * self.input_width_nm

    @cached_property
    def relative_width(self) -> FloatArray:
        """Width of each output band over their mean: entry per density and scale, shape (N,)."""
        return np.asarray(self.output_width_nm / self.output_width_nm.mean())

    @cached_property
    def origin_nm(self) -> FloatArray:
        """Mean [input, output] of the kept light, shape (2,)."""
        points = np.stack([self.input_nm, self.output_nm])
        return np.asarray(points @ self.mass / self.mass.sum())

    @cached_property
    def unit_nm(self) -> float:
        """Standard deviation of the kept light, but at least a band's width."""
        off = np.stack([self.input_nm, self.output_nm]) - self.origin_nm[:, np.newaxis]
        variance = float((off**2 @ self.mass).mean() / self.mass.sum())
        return max(float(np.sqrt(variance)), self.band_nm)

    @cached_property
    def band_nm(self) -> float:
        """Mean width of a band of input and of output."""
        return float((self.input_width_nm.mean() + self.output_width_nm.mean()) / 2)

    @cached_property
    def points(self) -> FloatArray:
        """Centres [input, output] from `origin_nm` in `unit_nm`, shape (2, N)."""
        centres = np.stack([self.input_nm, self.output_nm])
        return np.asarray((centres - self.origin_nm[:, np.newaxis]) / self.unit_nm)

    @cached_property
    def monomials(self) -> FloatArray:
        """Monomials of `points`, shape (6, N)."""
        return np.asarray(monomials_of(*self.points))

    def where(self, chosen: NDArray[np.bool_]) -> "StokesEntries":
        """Return some of the entries."""
        return StokesEntries(
            self.input_nm[chosen],
            self.output_nm[chosen],
            self.input_width_nm[chosen],
            self.output_width_nm[chosen],
            self.value[chosen],
            self.is_kept[chosen],
            self.threshold,
        )


def stokes_entries(matrix: ReradiationMatrix, threshold: float | None) -> StokesEntries:
    """Return the entries of a matrix, thresholded.

    Parameters
    ----------
    matrix
        The matrix; σ of its re-radiation is needed without a threshold. Entries that were not
        measured, or of unknown σ, are left out.
    threshold
        Least value per band that is kept. Without it, entries are kept that are significant at
        `FALSE_DISCOVERY_RATE`.

    Raises
    ------
    UsageError
        The threshold is no positive number, or there is neither threshold nor σ.
    DataError
        No entry is above the threshold.
    """
    if threshold is not None and not (np.isfinite(threshold) and threshold > 0):
        raise UsageError(f"expected a threshold above 0, got {threshold:g}")
    sigma = matrix.reradiation_sigma
    if threshold is None and sigma is None:
        raise UsageError(
            "expected σ of the re-radiation or a threshold, got neither; give the least value per "
            "band that is more than noise"
        )
    measured = matrix.is_stokes & ~np.isnan(matrix.reradiation)
    per_nm = matrix.reradiation[measured]
    row, column = np.nonzero(measured)
    output_width_nm = matrix.output_width_nm[row]
    value = per_nm * output_width_nm
    if threshold is not None:
        is_kept = value >= threshold
    else:
        assert sigma is not None
        is_kept = _is_significant(per_nm, sigma[measured])
    if not is_kept.any():
        raise DataError(
            "expected re-radiation above the noise, got none on the Stokes side; lower the "
            "threshold, or take it as not fluorescent"
        )
    return StokesEntries(
        matrix.input_nm[column],
        matrix.output_nm[row],
        matrix.input_width_nm[column],
        output_width_nm,
        np.where(is_kept, value, 0.0),
        is_kept,
        float(value[is_kept].min()) if threshold is None else threshold,
    )


def _is_significant(value: FloatArray, sigma: FloatArray) -> NDArray[np.bool_]:
    """Return which values are above noise of standard deviation σ, by Benjamini and Hochberg."""
    known = sigma >= 0
    with np.errstate(divide="ignore", invalid="ignore"):
        p_value = np.where(known & (value != 0), ndtr(-value / sigma), 1.0)
    ordered = np.sort(p_value[known])
    allowed = FALSE_DISCOVERY_RATE * np.arange(1, len(ordered) + 1) / len(ordered)
    passing = ordered[ordered <= allowed]
    return p_value <= passing[-1] if len(passing) else np.zeros(len(value), dtype=np.bool_)
