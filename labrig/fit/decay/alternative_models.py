"""Alternative decay models: power law A (1 + t/τ)^(−p) and stretched exponential A exp(−(t/τ)^β).

Traps of many depths and electron–hole recombination decay like this (Nalbach et al. sec. 4.4,
after Jonscher and de Polignac 1984 and Lee et al. 2001). They are fitted to the same series with
the same noise, to report when one fits better than exponentials.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from labrig.fit.decay.joint import JointFit, fit_jointly
from labrig.fit.decay.search import projection
from labrig.fit.decay.series import DecaySeries
from labrig.fit.decay.states import SERIES_BELOW
from labrig.fit.decay.whitening import WhitenedSeries
from labrig.fit.least_squares import FloatArray
from labrig.results import AlternativeModel

#: Gauss–Legendre nodes and weights on [0, 1], for functions without an elementary integral.
_NODES, _FRACTIONS = np.polynomial.legendre.leggauss(8)
NODES, FRACTIONS = (_NODES + 1) / 2, _FRACTIONS / 2


def power_law_mean(
    tau_s: float, exponent: float, t_s: FloatArray, exposure_s: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Average (1 + t/τ)^(−p) over each exposure, with derivatives.

    With v = τ + t, Δ = log(1 + T/v) and ψ(x) = (e^x − 1)/x the mean is (v/τ)^(−p) (v/T) Δ ψ((1 − p)
    Δ), which has no special case at p = 1.

    Parameters
    ----------
    tau_s
        Time scale τ > 0 in seconds.
    exponent
        Exponent p > 0.
    t_s, exposure_s
        Begin t > −τ and length T ≥ 0 of the exposures in seconds, shape (n,).

    Returns
    -------
    means, slopes
        Means (n,), and their derivatives by log τ and p (n, 2).
    """
    v = tau_s + t_s
    stretch = np.log(v / tau_s)
    start = np.exp(-exponent * stretch)
    exposed = exposure_s > 0
    duration = np.where(exposed, exposure_s, 1.0)
    delta = np.log1p(duration / v)
    psi, psi_slope = _growth((1 - exponent) * delta)
    mean = np.where(exposed, start * (v / duration) * delta * psi, start)
    # d log(mean) / dv at fixed v/τ; Δ falls with v.
    delta_slope = -duration / (v * (v + duration))
    within = 1 / v + delta_slope / delta + (1 - exponent) * delta_slope * psi_slope
    by_log_tau = mean * (exponent * t_s / v + np.where(exposed, tau_s * within, 0.0))
    by_exponent = -mean * (stretch + np.where(exposed, delta * psi_slope, 0.0))
    return mean, np.stack([by_log_tau, by_exponent], axis=1)


def stretched_mean(
    tau_s: float, exponent: float, t_s: FloatArray, exposure_s: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Average exp(−(t/τ)^β) over each exposure, with derivatives.

    Parameters
    ----------
    tau_s
        Time scale τ > 0 in seconds.
    exponent
        Exponent β > 0.
    t_s, exposure_s
        Begin t ≥ 0 and length T ≥ 0 of the exposures in seconds, shape (n,).

    Returns
    -------
    means, slopes
        Means (n,), and their derivatives by log τ and β (n, 2).
    """
    time = t_s[:, None] + exposure_s[:, None] * NODES
    # t^β log t → 0 as t → 0.
    log_ratio = np.log(np.maximum(time / tau_s, 1e-300))
    power = np.exp(exponent * log_ratio)
    falling = np.exp(-power) * FRACTIONS
    by_log_tau = exponent * (falling * power).sum(axis=1)
    by_exponent = -(falling * power * log_ratio).sum(axis=1)
    return falling.sum(axis=1), np.stack([by_log_tau, by_exponent], axis=1)


def _growth(x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return ψ(x) = (e^x − 1)/x and its logarithmic derivative 1/(1 − e^(−x)) − 1/x."""
    small = np.abs(x) < SERIES_BELOW
    safe = np.where(small, 1.0, x)
    series = 1 + x / 2 * (1 + x / 3 * (1 + x / 4 * (1 + x / 5 * (1 + x / 6))))
    psi = np.where(small, series, np.expm1(safe) / safe)
    # 1/2 + x/12 − x³/720 + …
    slope = np.where(small, 0.5 + x / 12 - x**3 / 720, -1 / np.expm1(-safe) - 1 / safe)
    return psi, slope


#: Smallest τ as a fraction of the shortest step between frames.
SHORTEST_STEPS = 0.01
#: Largest τ in spans.
LONGEST_SPANS = 100.0
GRID = (24, 12)
MAX_ITERATIONS = 60
TOLERANCE = 1e-4

Mean = Callable[[float, float, FloatArray, FloatArray], tuple[FloatArray, FloatArray]]


@dataclass(frozen=True)
class AlternativeShape:
    """A decay model with a time scale τ and one exponent.

    Attributes
    ----------
    name, formula
        Name, and formula for people with fields `tau` and `exponent`.
    value
        Function (t/τ, exponent) → value at a time.
    mean
        Function (τ, exponent, t, T) → means over the exposures, and derivatives by log τ and the
        exponent.
    exponents
        Smallest and largest exponent; a bound is needed since an exponential is the limit.
    """

    name: str
    formula: str
    value: Callable[[FloatArray, FloatArray], FloatArray]
    mean: Mean
    exponents: tuple[float, float]


ALTERNATIVES = (
    AlternativeShape(
        name="power law",
        formula="(1 + t/{tau:.3g} s)^−{exponent:.3g}",
        value=lambda ratio, exponent: (1 + ratio) ** -exponent,
        mean=power_law_mean,
        exponents=(0.1, 10.0),
    ),
    AlternativeShape(
        name="stretched exponential",
        formula="exp(−(t/{tau:.3g} s)^{exponent:.3g})",
        value=lambda ratio, exponent: np.exp(-(ratio**exponent)),
        mean=stretched_mean,
        exponents=(0.1, 0.95),
    ),
)


def fit_alternative(
    data: WhitenedSeries, alternative: AlternativeShape, weights: FloatArray, offsets: FloatArray
) -> JointFit:
    """Fit from the best of a grid of τ and exponent; `shape` is [A, log τ, exponent]."""
    series = data.series
    time = series.t + series.start
    steps = np.diff(series.t)
    low = np.log(SHORTEST_STEPS * steps[steps > 0].min())
    high = np.log(LONGEST_SPANS)

    def shape(theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        mean, slopes = alternative.mean(
            float(np.exp(theta[1])), float(theta[2]), time, series.exposure
        )
        return theta[0] * mean, np.column_stack([mean, theta[0] * slopes])

    start = _best_on_grid(data, alternative, weights, (low, high))
    return fit_jointly(
        data,
        shape,
        start,
        weights,
        offsets,
        np.array([0.0, low, alternative.exponents[0]]),
        np.array([np.inf, high, alternative.exponents[1]]),
        MAX_ITERATIONS,
        TOLERANCE,
    )


def _best_on_grid(
    data: WhitenedSeries,
    alternative: AlternativeShape,
    weights: FloatArray,
    log_taus: tuple[float, float],
) -> FloatArray:
    """Return the best [A, log τ, exponent] of the grid, with exposures taken as their middles."""
    series = data.series
    problem = projection(data, weights)
    middle = series.t + series.start + series.exposure / 2
    taus = np.linspace(*log_taus, GRID[0])
    log_tau, exponents = (
        grid.ravel() for grid in np.meshgrid(taus, np.geomspace(*alternative.exponents, GRID[1]))
    )
    means = alternative.value(np.multiply.outer(middle, np.exp(-log_tau)), exponents)
    columns = problem.columns(means)
    moments = problem.target @ columns
    norms2 = np.einsum("ij,ij->j", columns, columns)
    gains = np.maximum(moments, 0) ** 2 / np.where(norms2 > 0, norms2, np.inf)
    best = int(np.argmax(gains))
    amplitude = max(float(moments[best]), 0.0) / float(norms2[best])
    return np.array([amplitude, log_tau[best], exponents[best]])


def fitted_alternative(
    alternative: AlternativeShape, fit: JointFit, series: DecaySeries, bic: float
) -> AlternativeModel:
    """Convert the fit to the user's units."""
    amplitude, log_tau, exponent = (float(x) for x in fit.shape)
    tau_s = float(np.exp(log_tau)) * series.span_s
    return AlternativeModel(
        name=alternative.name,
        formula=alternative.formula.format(tau=tau_s, exponent=exponent),
        amplitude=amplitude * series.peak,
        tau_s=tau_s,
        exponent=exponent,
        exponent_sigma=float(fit.least_squares.sigma[2]),
        bic=bic,
    )
