"""The scale of a mixture: by its light, by its squared error, or by its colours."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
from scipy.optimize import minimize_scalar

from labrig.errors import DataError, UsageError
from labrig.fit.mixture.entries import StokesEntries
from labrig.material import ReradiationMatrix, ReradiationMixture, compare_colours
from labrig.optics import Spectrum

Scaling = Literal["integral", "least-squares", "colour"]

#: How far from the scale of the integral, as a factor, colours may take it.
FARTHEST = 2.0
#: Number of scales of which the best is the start of the search.
GRID = 29


def modelled(entries: StokesEntries, mixture: ReradiationMixture) -> np.ndarray:
    """Return the mixture at the entries, per band, shape (N,)."""
    per_nm = mixture.scale * mixture.density(entries.input_nm, entries.output_nm)
    return np.asarray(per_nm * entries.output_width_nm)


def masked_mse(entries: StokesEntries, mixture: ReradiationMixture) -> float:
    """Return the mean squared error of a mixture, per band."""
    return float(((modelled(entries, mixture) - entries.value) ** 2).mean())


def with_integral(entries: StokesEntries, mixture: ReradiationMixture) -> ReradiationMixture:
    """Return the mixture with the scale that keeps the light in all entries (equation 5)."""
    light = modelled(entries, mixture) @ entries.input_width_nm
    return replace(mixture, scale=mixture.scale * float(entries.mass.sum() / light))


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
