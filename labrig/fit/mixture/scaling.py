"""The scale of a mixture: by its light, by its squared error, or by its colours."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
from scipy.optimize import minimize_scalar

from labrig.fit.mixture.entries import StokesEntries
from labrig.foundation.errors import DataError, UsageError
from labrig.material import ReradiationMatrix, ReradiationMixture, compare_colours
from labrig.optics import Spectrum

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
