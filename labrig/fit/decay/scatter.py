"""Standard uncertainties of values that come without, from their scatter about a smooth curve.

The curve is the best completely monotone one (see `envelope`): it contains every sum of positive
exponentials, every power law and every stretched exponential with an exponent up to 1, so that the
misfit of a wrong number of states is not taken for noise. As projection on a convex cone it takes
as many degrees of freedom as it has active rates (M. Meyer, M. Woodroofe, Annals of Statistics 28,
2000).

How the noise depends on the signal s is not known either. Instruments have three kinds,
σ² = c² + g s + ρ² s²: of reading, of counting, and in proportion to the signal. The likelihood of
the scatter weighs all mixtures of the three, and σ² is their mean: no kind is chosen by a threshold
that a small change of the data could cross.
"""

from dataclasses import dataclass, replace

import numpy as np

from labrig.fit.decay.envelope import envelope, monotone_curve
from labrig.fit.decay.series import DecaySeries
from labrig.fit.decay.whitening import whitened
from labrig.fit.least_squares import EPSILON
from labrig.foundation.arrays import FloatArray
from labrig.results import ScatterSigma

#: Iterations in which the weights of the curve follow σ; the third changes σ by less than 1 %.
ITERATIONS = 3
#: Number of fractions of each kind of noise that are weighed, dense near none and all of it.
FRACTIONS = 9
#: Prior probability that the noise is the same for all values. Some dozens of values hardly tell,
#: and a σ that rises with the signal by accident would weigh the first values, which determine the
#: fastest rate, too little.
PRIOR_OF_CONSTANT = 0.7
#: Scatter below which data are exact up to rounding, in units of the largest value.
EXACT = 1e-13


def with_scatter_sigma(series: DecaySeries) -> tuple[DecaySeries, ScatterSigma]:
    """Return a series without σ with the σ of its scatter, and how σ depends on the signal.

    Parameters
    ----------
    series
        Series of one channel whose σ is not given.

    Raises
    ------
    FitError
        The signal does not decay.
    """
    if len(series.repeats) > 1:
        series = envelope(series, 0.0).series
    law = _Law(np.array([1.0, 0.0, 0.0]), np.inf)
    result = series
    for _ in range(ITERATIONS):
        data = whitened(result, np.zeros_like(series.values), 0.0)
        curve, offsets, leverage, _ = monotone_curve(data, np.ones(1))
        residual = series.values[:, 0] - curve - offsets[0]
        law = _likely_law(residual, np.maximum(curve, 0.0), np.minimum(leverage, 1.0))
        sigma = np.maximum(law.sigma(curve), EXACT)
        result = replace(series, inverse_sigma=1 / sigma[:, None])
    constant, counting, proportional = law.coefficients
    return result, ScatterSigma(
        constant=float(np.sqrt(constant)) * series.peak,
        counting=float(counting) * series.peak,
        proportional=float(np.sqrt(proportional)),
        at_brightest=float(sigma[np.argmax(curve)]) * series.peak,
        at_faintest=float(sigma[np.argmin(curve)]) * series.peak,
        dof=law.dof,
    )


def with_equal_sigma(series: DecaySeries) -> DecaySeries:
    """Return a series without σ with one for all values, that of their scatter.

    Raises
    ------
    FitError
        The signal does not decay.
    """
    if len(series.repeats) > 1:
        series = envelope(series, 0.0).series
    data = whitened(series, np.zeros_like(series.values), 0.0)
    curve, offsets, leverage, _ = monotone_curve(data, np.ones(1))
    residual = series.values[:, 0] - curve - offsets[0]
    dof = max(len(residual) - float(leverage.sum()), 1.0)
    return scaled_sigma(series, float(np.sqrt(residual @ residual / dof)))


def scaled_sigma(series: DecaySeries, factor: float) -> DecaySeries:
    """Return the series with its σ times a factor, as far as numbers have digits."""
    smallest = float(np.min(1 / series.inverse_sigma[series.inverse_sigma > 0]))
    factor = max(factor, EPSILON / smallest)
    return replace(series, inverse_sigma=series.inverse_sigma / factor)


def residual_sigma(series: DecaySeries, dof: int) -> ScatterSigma:
    """Return the σ of a series that is the same for all values, that of residuals."""
    sigma = series.peak / float(series.inverse_sigma.max())
    return ScatterSigma(sigma, 0.0, 0.0, sigma, sigma, float(dof), is_of_residuals=True)


@dataclass(frozen=True)
class _Law:
    """Variance of a value of signal s: coefficients of 1, s and s², and degrees of freedom."""

    coefficients: FloatArray
    dof: float

    def sigma(self, signal: FloatArray) -> FloatArray:
        return np.asarray(np.sqrt(self.coefficients @ _kinds(signal)))


def _kinds(signal: FloatArray) -> FloatArray:
    """Return the variances of reading, counting and proportional noise, shape (3, n)."""
    positive = np.maximum(signal, 0.0)
    return np.stack([np.ones_like(positive), positive, positive**2])


def _likely_law(residual: FloatArray, signal: FloatArray, leverage: FloatArray) -> _Law:
    """Return the mean of all laws of the variance, weighed by their restricted likelihood.

    Parameters
    ----------
    residual, signal
        Deviation of each value from the curve, and the curve, shape (n,).
    leverage
        Degrees of freedom that the curve took from each value, shape (n,).
    """
    free = 1 - leverage
    dof = float(free.sum())
    kinds = _kinds(signal)
    means = kinds.mean(axis=1)
    mixtures = _MIXTURES / np.where(means > 0, means, 1.0)
    variance = mixtures @ kinds
    # Counting noise alone has none where the signal vanishes, which no residual can equal.
    variance = np.maximum(variance, EXACT)
    scale = (residual**2 / variance).sum(axis=1) / max(dof, 1.0)
    scale = np.maximum(scale, EXACT**2)
    log_likelihood = -0.5 * (np.log(variance) @ free + dof * np.log(scale))
    probability = np.exp(log_likelihood - log_likelihood.max()) * _PRIOR
    return _Law((probability / probability.sum() * scale) @ mixtures, dof)


def _mixtures() -> FloatArray:
    """Return the fractions of reading, counting and proportional noise, shape (m, 3)."""
    steps = np.sin(np.linspace(0, np.pi / 2, FRACTIONS)) ** 2
    signal, proportional = (grid.ravel() for grid in np.meshgrid(steps, steps))
    mixtures = np.stack([1 - signal, signal * (1 - proportional), signal * proportional], axis=1)
    return np.unique(mixtures.round(12), axis=0)


_MIXTURES = _mixtures()
_IS_CONSTANT = _MIXTURES[:, 0] == 1
_PRIOR = np.where(
    _IS_CONSTANT, PRIOR_OF_CONSTANT, (1 - PRIOR_OF_CONSTANT) / np.count_nonzero(~_IS_CONSTANT)
)
