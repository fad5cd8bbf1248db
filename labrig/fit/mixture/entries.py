"""Entries of a re-radiation matrix to which mixtures are fitted.

Noise scatters about a third of all entries below zero, which have no likelihood as amounts of
light, and a mixture that follows the positive ones covers the whole matrix. Expectation
maximisation therefore takes entries that are not above the noise as zero (Hua et al. 2021,
section 5.1). That loses light: what follows it fits all entries as they were measured where their σ
is known.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from scipy.special import ndtr

from labrig.fit.mixture.gaussians import monomials_of
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError, UsageError
from labrig.material import ReradiationMatrix, ReradiationMixture, compare_colours
from labrig.optics import Spectrum

#: Expected fraction of noise among the entries that are kept (Benjamini and Hochberg, *Journal of
#: the Royal Statistical Society B* 57, 1995).
FALSE_DISCOVERY_RATE = 0.05


@dataclass(frozen=True, eq=False)
class StokesEntries:
    """Measured entries with λ_o > λ_i.

    Attributes
    ----------
    input_nm, output_nm
        Centres of the entries' bands in nm, shape (N,).
    input_width_nm, output_width_nm
        Widths of the entries' bands in nm, shape (N,).
    measured
        Fraction of the light of the input band that comes back in the output band, shape (N,).
    is_kept
        Whether the entry is above the threshold, shape (N,).
    threshold
        The least value that is kept.
    sigma
        Standard deviations of `measured` by which the entries are weighted, shape (N,); None if all
        weigh the same and those below the threshold are taken as 0.
    """

    input_nm: FloatArray
    output_nm: FloatArray
    input_width_nm: FloatArray
    output_width_nm: FloatArray
    measured: FloatArray
    is_kept: NDArray[np.bool_]
    threshold: float
    sigma: FloatArray | None = None

    @cached_property
    def value(self) -> FloatArray:
        """Measured values, those below the threshold taken as 0, shape (N,)."""
        return np.where(self.is_kept, self.measured, 0.0)

    @property
    def wanted(self) -> FloatArray:
        """Values that least squares follow, shape (N,)."""
        return self.value if self.sigma is None else self.measured

    @cached_property
    def weight(self) -> FloatArray:
        """Weights of residuals in least squares: 1/σ, or one over the largest entry, shape (N,)."""
        sigma = self.value.max() if self.sigma is None else self.sigma
        return np.broadcast_to(1 / sigma, self.measured.shape)

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
            self.measured[chosen],
            self.is_kept[chosen],
            self.threshold,
            None if self.sigma is None else self.sigma[chosen],
        )


def stokes_entries(matrix: ReradiationMatrix, threshold: float | None) -> StokesEntries:
    """Return the entries of a matrix.

    Parameters
    ----------
    matrix
        The matrix; σ of its re-radiation is needed without a threshold. Entries that were not
        measured, or of unknown σ, are left out.
    threshold
        Least value per band that is kept; all entries then weigh the same. Without it they are
        weighted by σ, and those are kept that are significant at `FALSE_DISCOVERY_RATE`.

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
    used = matrix.is_stokes & ~np.isnan(matrix.reradiation)
    if threshold is None and sigma is not None:
        used &= sigma >= 0
    row, column = np.nonzero(used)
    output_width_nm = matrix.output_width_nm[row]
    measured = matrix.reradiation[used] * output_width_nm
    if threshold is not None:
        is_kept, weighting = measured >= threshold, None
    else:
        assert sigma is not None
        sigma_per_band = sigma[used] * output_width_nm
        is_kept = _is_significant(measured, sigma_per_band)
        weighting = _above_zero(sigma_per_band)
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
        measured,
        is_kept,
        float(measured[is_kept].min()) if threshold is None else threshold,
        weighting,
    )


def _above_zero(sigma: FloatArray) -> FloatArray | None:
    """Return σ, the least in place of 0, which would weigh without bound; None if all are 0."""
    positive = sigma[sigma > 0]
    return np.maximum(sigma, positive.min()) if len(positive) else None


def _is_significant(value: FloatArray, sigma: FloatArray) -> NDArray[np.bool_]:
    """Return which values are above noise of standard deviation σ, by Benjamini and Hochberg."""
    with np.errstate(divide="ignore", invalid="ignore"):
        p_value = np.where(value != 0, ndtr(-value / sigma), 1.0)
    ordered = np.sort(p_value)
    allowed = FALSE_DISCOVERY_RATE * np.arange(1, len(ordered) + 1) / len(ordered)
    passing = ordered[ordered <= allowed]
    return p_value <= passing[-1] if len(passing) else np.zeros(len(value), dtype=np.bool_)


Scaling = Literal["integral", "least-squares", "colour"]

#: How far from the scale of the integral, as a factor, colours may take it.
FARTHEST = 2.0
#: Difference in σ between fitted and summed light up to which it is taken for noise.
NOISE_SIGMAS = 2.0
#: Number of scales of which the best is the start of the search.
GRID = 29


def modelled(entries: StokesEntries, mixture: ReradiationMixture) -> np.ndarray:
    """Return the mixture at the entries, per band, shape (N,)."""
    per_nm = mixture.scale * mixture.density(entries.input_nm, entries.output_nm)
    return np.asarray(per_nm * entries.output_width_nm)


def masked_mse(entries: StokesEntries, mixture: ReradiationMixture) -> float:
    """Return the mean squared error of a mixture, per band."""
    return float(((modelled(entries, mixture) - entries.value) ** 2).mean())


def chi2(entries: StokesEntries, mixture: ReradiationMixture) -> float | None:
    """Return the sum of squared residuals over σ; None without σ."""
    if entries.sigma is None:
        return None
    return float((((modelled(entries, mixture) - entries.measured) / entries.sigma) ** 2).sum())


def with_integral(
    entries: StokesEntries, mixture: ReradiationMixture, sigma: float | None = None
) -> ReradiationMixture:
    """Return the mixture with the scale that keeps the light in all entries (equation 5).

    Parameters
    ----------
    entries
        The entries.
    mixture
        The mixture, with another scale.
    sigma
        Standard deviation of the light in all entries if the given scale is that of their fit,
        which noise moves far less than their sum: a difference within `NOISE_SIGMAS` then leaves
        the scale as it is, and a larger one moves it by all but the noise in it (shrinkage after
        James and Stein, 1961).

    Raises
    ------
    DataError
        The entries have no light in the mean.
    """
    light = float(modelled(entries, mixture) @ entries.input_width_nm)
    missing = float(entries.wanted @ entries.input_width_nm) - light
    if sigma is not None and missing != 0:
        missing *= max(1 - (NOISE_SIGMAS * sigma / missing) ** 2, 0.0)
    if not light + missing > 0:
        raise DataError(
            "expected light in the sum of all entries, got none above the noise; take the scale "
            "of least squares"
        )
    return replace(mixture, scale=mixture.scale * (1 + missing / light))


def with_colours(
    matrix: ReradiationMatrix, mixture: ReradiationMixture, lights: Sequence[Spectrum]
) -> ReradiationMixture:
    """Return the mixture with the scale of the least mean ΔE2000 under some lights.

    Raises
    ------
    UsageError
        There is no light.
    DataError
        The matrix is black under all of them.
    """
    if not lights:
        raise UsageError("expected lights under which to compare colours, got none")
    smooth = mixture.to_matrix(matrix.input_nm, matrix.output_nm, reflectance=matrix.reflectance)

    def error(log_factor: float) -> float:
        scaled = replace(smooth, reradiation=smooth.reradiation * np.exp(log_factor))
        differences = [each.delta_e for each in compare_colours(scaled, matrix, lights)]
        # Black under a narrow light, a surface has no colour there.
        seen = [delta_e for delta_e in differences if not np.isnan(delta_e)]
        return float(np.mean(seen)) if seen else np.nan

    if np.isnan(error(0.0)):
        names = ", ".join(light.name for light in lights)
        raise DataError(
            f"expected a surface that can be seen under {names}, got a black one; choose another "
            "light or another scale"
        )
    # A mean of lengths may have several minima: the best of a grid, then the minimum beside it.
    grid = np.linspace(-np.log(FARTHEST), np.log(FARTHEST), GRID)
    best = grid[np.argmin([error(log_factor) for log_factor in grid])]
    step = grid[1] - grid[0]
    found = minimize_scalar(error, bounds=(best - step, best + step), method="bounded")
    return replace(mixture, scale=mixture.scale * float(np.exp(found.x)))
