"""Start values of an excitation fit: one state of the mean rate, charged to guessed levels."""

from collections.abc import Iterator

import numpy as np

from labrig.fit.excitation.levels import levels
from labrig.fit.excitation.problem import ExcitationProblem
from labrig.foundation.arrays import FloatArray
from labrig.foundation.nonnegative import nonnegative_least_squares
from labrig.results import ChargingSeries

#: Guesses of the concentration of the brightest site, the least certain start value.
GUESSED_LEVELS = (0.05, 0.2, 0.5, 0.9)
#: Kinetic order at the start where orders are fitted.
START_ORDER = 1.5
#: Grid of κ over k_r.
KAPPA_OVER_K_R = np.geomspace(1e-5, 1e3, 65)


def starts(
    problem: ExcitationProblem, k_r_per_s: FloatArray, fractions: FloatArray, reference: int
) -> Iterator[FloatArray]:
    """Yield a start θ for each guessed level.

    Parameters
    ----------
    problem
        The least-squares problem.
    k_r_per_s, fractions
        Rates in 1/s and each state's fraction of the glow, from a decay, shape (N,).
    reference
        Index of the brightest channel.
    """
    fractions = fractions / fractions.sum()
    peak = max(float(np.nanmax(charging.values[..., reference])) for charging in problem.series)
    mean_rate = float(fractions @ k_r_per_s)
    for guess in GUESSED_LEVELS:
        total = peak / guess
        site_kappas = [
            _kappa(part, mean_rate, total, reference)
            for charging in problem.series
            for part in charging.by_light()
        ]
        kappa, design = np.concatenate(site_kappas), _irradiances(problem)
        k_e = nonnegative_least_squares(design, kappa)
        # A state that decays faster charges no further by the same light.
        order = START_ORDER if problem.parameters.order is None else problem.parameters.order
        # The glow at that level, and its rate, are those of the decay for any order.
        ease = guess ** (1 - order)
        yield problem.parameters.as_stated(
            k_r_per_s * ease / order,
            total * fractions * ease,
            np.outer(k_r_per_s / mean_rate, np.maximum(k_e, 1e-3 * k_e.max())),
            channel_weights(problem, reference),
            np.full(len(k_r_per_s), order),
        )


def _irradiances(problem: ExcitationProblem) -> FloatArray:
    return np.concatenate(
        [part.irradiance for charging in problem.series for part in charging.by_light()]
    )


def _kappa(series: ChargingSeries, k_r_per_s: float, total: float, reference: int) -> FloatArray:
    """Return the κ (P,) of each site that fits its glow best for one state of amplitude `total`."""
    bands = series.irradiance.shape[1]
    grid = ChargingSeries(
        series.name,
        series.charges,
        series.rise,
        series.fade,
        np.outer(KAPPA_OVER_K_R * k_r_per_s, np.ones(bands)) / bands,
        series.values,
        series.sigma,
    )
    glow = total * levels(grid, np.array([k_r_per_s]), np.ones((1, bands))).value[..., 0]
    values, sigma = series.values[..., reference], series.sigma[..., reference]
    measured = np.isfinite(values) & np.isfinite(sigma)
    weight = np.where(measured, 1 / np.where(measured, sigma, 1.0) ** 2, 0.0)
    misfit = np.nan_to_num(values)[:, :, None] - glow[:, None, :]
    chi2 = np.einsum("fp,fpg->pg", weight, misfit**2)
    best: FloatArray = KAPPA_OVER_K_R[np.argmin(chi2, axis=1)] * k_r_per_s
    return best


def channel_weights(problem: ExcitationProblem, reference: int) -> FloatArray:
    """Estimate channel weights (C,) over the reference from all values."""
    totals = sum(np.nansum(charging.values, axis=(0, 1)) for charging in problem.series)
    weights: FloatArray = np.maximum(totals / totals[reference], 0)
    return weights
