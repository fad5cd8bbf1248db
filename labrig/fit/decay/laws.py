"""Fits of the laws of decay that are no sum of a few exponentials.

They are fitted to the same series with the same noise and the same offsets as the exponentials, so
that their χ² compare. Traps of many depths and the recombination of electrons and holes decay like
this (Nalbach et al., section 4.4).
"""

from dataclasses import dataclass, replace

import numpy as np

from labrig.errors import FitError
from labrig.fit.decay.joint import JointFit, Shape, covariance_under_flicker, fit_jointly
from labrig.fit.decay.noise_likelihood import NoiseLikelihood
from labrig.fit.decay.search import projection
from labrig.fit.decay.series import DecaySeries
from labrig.fit.decay.whitening import WhitenedSeries
from labrig.fit.least_squares import FloatArray, parameter_covariance
from labrig.material import DECAY_LAWS, DecayLaw
from labrig.results import FittedLaw

#: Largest rate at lamp off in inverse shortest steps between frames, and smallest in spans: laws
#: other than exponentials fall fast at first, and go on falling.
FASTEST_STEPS, SLOWEST_SPANS = 100.0, 100.0
#: Sizes of the grid of rates and shapes, and smallest shape above 0 on it.
GRID = (20, 8)
LEAST_SHAPE = 0.05
#: Places of the rate and of the shape among the parameters.
LAW_RATE, LAW_SHAPE = slice(1, 2), 2
MAX_ITERATIONS = 60
TOLERANCE = 1e-5
#: Gain in χ² of a step at which a fit ends: laws are compared by differences of several.
LEAST_GAIN = 1e-3


@dataclass(frozen=True)
class LawFit:
    """Fit of a law in the series' own units, and in the user's.

    Attributes
    ----------
    joint
        Joint fit; its `shape` is [amplitude, log rate, shape of the law].
    covariance
        Covariance of all fitted parameters, shape (p, p).
    fitted
        The law in the user's units.
    """

    joint: JointFit
    covariance: FloatArray
    fitted: FittedLaw

    def signal(self, series: DecaySeries) -> FloatArray:
        """Return the law without offset, shape (n, C)."""
        h, _ = _shape(series, DECAY_LAWS[self.fitted.name])(self.joint.shape)
        return np.multiply.outer(h, self.joint.weights)

    def with_added(self, covariance: FloatArray, series: DecaySeries) -> "LawFit":
        """Return the fit with a covariance (p, p) added to its own."""
        total = self.covariance + covariance
        if self.covariance[LAW_SHAPE, LAW_SHAPE] == 0:
            total = _without_shape(total)
        fitted = replace(self.fitted, covariance=_own_covariance(self.joint, series, total))
        return replace(self, covariance=total, fitted=fitted)


def fit_law(
    likelihood: NoiseLikelihood,
    law: DecayLaw,
    weights: FloatArray,
    offsets: FloatArray,
    added_square: float,
    student: float,
) -> LawFit | None:
    """Fit a law from the best place of a grid of rates and shapes.

    Parameters
    ----------
    likelihood
        Likelihood of the whitened series.
    law
        The law.
    weights, offsets
        Start values of the channels, shape (C,).
    added_square
        Mean square of the flicker less that of the series' noise.
    student
        Factor of the covariance where the noise was estimated.

    Returns
    -------
    LawFit or None
        The fit; None if the law has no signal.
    """
    data = likelihood.data
    series = data.series
    low, high = _log_rate_bounds(series)
    shape = _shape(series, law)
    start = _best_on_grid(data, law, weights, (low, high))
    if start[0] == 0:
        return None
    least, largest = law.shapes
    try:
        fit = fit_jointly(
            data,
            shape,
            start,
            weights,
            offsets,
            np.array([0.0, low, least]),
            np.array([np.inf, high, largest]),
            MAX_ITERATIONS,
            TOLERANCE,
            LEAST_GAIN,
        )
    except FitError:
        return None
    if fit.shape[0] == 0:
        return None
    # Near an exponential, retrapping changes the signal as the rate does: its σ has no limit there.
    if not np.sqrt(fit.least_squares.covariance[LAW_SHAPE, LAW_SHAPE]) <= largest - least:
        fit = _with_shape_held(fit)
    signal = np.multiply.outer(shape(fit.shape)[0], fit.weights)
    covariance = covariance_under_flicker(fit, data, signal, added_square)
    with np.errstate(invalid="ignore"):
        covariance = np.where(covariance == 0, 0.0, student * covariance)
    return LawFit(fit, covariance, _in_units(law, fit, series, covariance, likelihood.bic(fit)))


def fit_laws(
    likelihood: NoiseLikelihood,
    weights: FloatArray,
    offsets: FloatArray,
    added_square: float,
    student: float,
) -> tuple[LawFit, ...]:
    """Fit every law; the arguments are those of `fit_law`."""
    fits = (
        fit_law(likelihood, law, weights, offsets, added_square, student)
        for law in DECAY_LAWS.values()
    )
    return tuple(fit for fit in fits if fit is not None)


def _log_rate_bounds(series: DecaySeries) -> tuple[float, float]:
    return -float(np.log(SLOWEST_SPANS)), float(np.log(FASTEST_STEPS / series.shortest_step))


def _shape(series: DecaySeries, law: DecayLaw) -> Shape:
    """Return the law as a function of [amplitude, log rate, shape]."""
    time = series.t + series.start

    def shape(theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        means, slopes = law.means(float(np.exp(theta[1])), float(theta[2]), time, series.exposure)
        return theta[0] * means, np.column_stack([means, theta[0] * slopes])

    return shape


def _with_shape_held(fit: JointFit) -> JointFit:
    """Return a fit in whose covariance the shape is no parameter."""
    jacobian = fit.least_squares.jacobian.copy()
    jacobian[:, LAW_SHAPE] = 0.0
    covariance = _without_shape(parameter_covariance(jacobian)[0])
    solution = replace(fit.least_squares, jacobian=jacobian, covariance=covariance)
    return replace(fit, least_squares=solution)


def _without_shape(covariance: FloatArray) -> FloatArray:
    """Return a covariance (p, p) with nothing of the shape."""
    held = covariance.copy()
    held[LAW_SHAPE, :] = held[:, LAW_SHAPE] = 0.0
    return held


def _best_on_grid(
    data: WhitenedSeries, law: DecayLaw, weights: FloatArray, log_rates: tuple[float, float]
) -> FloatArray:
    """Return the best [amplitude, log rate, shape] of the grid, with exposures as their middles."""
    series = data.series
    problem = projection(data, weights)
    middle = series.t + series.start + series.exposure / 2
    least, largest = law.shapes
    shapes = np.geomspace(max(least, LEAST_SHAPE), largest, GRID[1])
    log_rate, exponents = (
        grid.ravel() for grid in np.meshgrid(np.linspace(*log_rates, GRID[0]), shapes)
    )
    phase = np.multiply.outer(middle, np.exp(log_rate))
    values = law.value(phase, exponents)
    moments = problem.pull @ values
    norms2 = problem.information @ values**2 - ((problem.shadow @ values) ** 2).sum(axis=0)
    gains = np.maximum(moments, 0) ** 2 / np.where(norms2 > 0, norms2, np.inf)
    best = int(np.argmax(gains))
    if gains[best] == 0:
        return np.zeros(3)
    return np.array([float(moments[best]) / float(norms2[best]), log_rate[best], exponents[best]])


def _in_units(
    law: DecayLaw, fit: JointFit, series: DecaySeries, covariance: FloatArray, fit_bic: float
) -> FittedLaw:
    """Return the fit in the user's units; `covariance` is that of all fitted parameters."""
    amplitude, log_rate, shape = (float(value) for value in fit.shape)
    n_values = series.n_values + len(series.offset_prior)
    dof = n_values - fit.n_parameters - (len(series.repeats) - 1)
    return FittedLaw(
        name=law.name,
        amplitude=amplitude * series.peak,
        rate_per_s=float(np.exp(log_rate)) / series.span_s,
        shape=shape,
        covariance=_own_covariance(fit, series, covariance),
        channel_weights=tuple(fit.weights.tolist()),
        offsets=tuple((fit.offsets * series.peak).tolist()),
        reduced_chi2=fit.chi2 / dof if dof > 0 else float("nan"),
        bic=fit_bic,
    )


def _own_covariance(fit: JointFit, series: DecaySeries, covariance: FloatArray) -> FloatArray:
    """Return the covariance of amplitude, rate, shape and offset in the user's units, (4, 4)."""
    rate_per_s = float(np.exp(fit.shape[1])) / series.span_s
    units = np.array([series.peak, rate_per_s, 1.0, series.peak])
    own = np.zeros((4, 4))
    fitted = np.flatnonzero(series.fitted_offsets == fit.brightest)
    rows = [0, 1, 2, *(3 + len(fit.weights) - 1 + fitted)]
    own[: len(rows), : len(rows)] = covariance[np.ix_(rows, rows)]
    with np.errstate(invalid="ignore"):
        return np.where(own == 0, 0.0, own * np.outer(units, units))
