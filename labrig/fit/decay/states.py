"""Fit of n exponentials to a whitened series."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from labrig.fit.decay.series import NO_DECAY, DecaySeries, WhitenedSeries
from labrig.fit.decay.variable_projection import (
    JointFit,
    Shape,
    fit_jointly,
    projection,
    search_rates,
)
from labrig.fit.nonlinear_least_squares import Ending
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from labrig.material import exponential_means_and_slopes

#: Amplitude at the first frame, relative to the largest, below which a state is dropped.
NEGLIGIBLE_AMPLITUDE = 1e-9
#: Distance in log k below which two rates are merged.
MERGED_LOG_RATE = 1e-2
#: Distance in σ below which two rates are not distinct.
APART_SIGMAS = 3.0
#: σ of log k above which a rate is ill-determined.
ILL_DETERMINED = 0.3
#: Evaluations and relative step of a candidate, which is only compared by its χ².
CANDIDATE_ITERATIONS = 100
CANDIDATE_TOLERANCE = 1e-6
#: Gain in χ² of a step at which a candidate stops that does not come near the χ² it needs: a state
#: too many creeps along a flat valley.
CANDIDATE_GAIN = 0.01
#: Evaluations of the final fit, to full precision.
FINAL_ITERATIONS = 1000


@dataclass(frozen=True)
class StatesFit:
    """Fitted states, free rates first; rates per span, amplitudes at the first frame over the peak.

    Attributes
    ----------
    joint
        Joint fit; its `shape` is [log k₁, b₁, log k₂, b₂, … of the free rates, b … of the fixed
        ones].
    fixed
        Logarithms of the fixed rates, shape (f,).
    """

    joint: JointFit
    fixed: FloatArray

    @property
    def n_free(self) -> int:
        """Number of states whose rate was fitted."""
        return (len(self.joint.shape) - len(self.fixed)) // 2

    @property
    def n_states(self) -> int:
        """Number of states."""
        return self.n_free + len(self.fixed)

    @property
    def log_rates(self) -> FloatArray:
        """Logarithms of the rates, free ones first, shape (n,)."""
        return np.concatenate([self.joint.shape[0 : 2 * self.n_free : 2], self.fixed])

    @property
    def amplitudes(self) -> FloatArray:
        """Amplitudes in the order of `log_rates`, shape (n,)."""
        shape = self.joint.shape
        return np.concatenate([shape[1 : 2 * self.n_free : 2], shape[2 * self.n_free :]])

    def dof(self, data: WhitenedSeries) -> int:
        """Return the number of values and offset priors minus parameters and levels of repeats."""
        n_priors = len(data.target) - data.values.size
        n_levels = len(data.series.repeats) - 1
        return data.series.n_values + n_priors - self.joint.n_parameters - n_levels

    @property
    def rates_are_determined(self) -> bool:
        """Whether the free rates differ by more than their uncertainty, and that is small.

        A rate may be uncertain that would need a longer record: one below 1 per span.
        """
        free = slice(0, 2 * self.n_free, 2)
        log_rates = self.joint.shape[free]
        covariance = self.joint.least_squares.covariance[free, free]
        apart = sigmas_apart(log_rates, covariance)
        uncertain = np.diag(covariance) > ILL_DETERMINED**2
        return bool((apart >= APART_SIGMAS).all() and not (uncertain & (log_rates > 0)).any())

    @property
    def vanished(self) -> NDArray[np.bool_]:
        """Which states have no amplitude, in the order of `log_rates`, shape (n,)."""
        vanished: NDArray[np.bool_] = (
            self.amplitudes <= NEGLIGIBLE_AMPLITUDE * self.amplitudes.max()
        )
        return vanished

    def signal(self, series: DecaySeries) -> FloatArray:
        """Return the model without offset, shape (n, C)."""
        h, _ = exponentials(series, self.n_free, self.fixed)(self.joint.shape)
        return np.multiply.outer(h, self.joint.weights)


def sigmas_apart(log_rates: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return the (n − 1,) distances in σ of neighbouring log rates (n,) with covariance (n, n)."""
    falling = np.argsort(-log_rates)
    fast, slow = falling[:-1], falling[1:]
    variance = covariance[fast, fast] + covariance[slow, slow] - 2 * covariance[fast, slow]
    apart: FloatArray = log_rates[fast] - log_rates[slow]
    positive = variance > 0
    return np.where(positive, apart / np.sqrt(np.where(positive, variance, 1.0)), np.inf)


def exponentials(series: DecaySeries, n_free: int, fixed: FloatArray) -> Shape:
    """Return Σ b_i g(k_i; t, T) as a function of the parameters of `StatesFit.joint`."""
    paired = 2 * n_free

    def shape(theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        rates = np.exp(np.concatenate([theta[0:paired:2], fixed]))
        b = np.concatenate([theta[1:paired:2], theta[paired:]])
        means, slopes = exponential_means_and_slopes(rates, series.t, series.exposure)
        jacobian = np.empty((len(means), len(theta)))
        jacobian[:, 0:paired:2] = slopes[:, :n_free] * b[:n_free]
        jacobian[:, 1:paired:2] = means[:, :n_free]
        jacobian[:, paired:] = means[:, n_free:]
        return means @ b, jacobian

    return shape


def fit_states(
    data: WhitenedSeries,
    n_free: int,
    fixed: FloatArray,
    weights: FloatArray,
    offsets: FloatArray,
    needed_chi2: float = np.inf,
) -> StatesFit | None:
    """Fit `n_free` exponentials besides those of the `fixed` log rates (f,).

    A fit that creeps and stays above `needed_chi2` is given up. The result is None if the data do
    not support that many states: an amplitude vanishes or two rates merge, so that fewer states fit
    as well. A fixed rate without amplitude is dropped from the result.
    """
    problem = projection(data, weights)
    log_rates: FloatArray | None = np.empty(0)
    if n_free:
        log_rates = search_rates(problem, n_free, fixed)
    if log_rates is None:
        return None
    amplitudes, _ = problem.amplitudes(np.concatenate([log_rates, fixed]))
    start = np.empty(2 * n_free + len(fixed))
    start[0 : 2 * n_free : 2] = log_rates
    start[1 : 2 * n_free : 2] = amplitudes[:n_free]
    start[2 * n_free :] = amplitudes[n_free:]
    limits = CANDIDATE_ITERATIONS, CANDIDATE_TOLERANCE
    fit = _fit_from(data, start, fixed, weights, offsets, *limits, CANDIDATE_GAIN)
    creeps = fit.joint.least_squares.ending is Ending.SLOW_PROGRESS
    if creeps and fit.joint.chi2 < needed_chi2:
        joint = fit.joint
        fit = _fit_from(data, joint.shape, fixed, joint.weights, joint.offsets, *limits)
    vanished = fit.vanished
    if vanished[n_free:].any():
        return fit_states(data, n_free, fixed[~vanished[n_free:]], weights, offsets, needed_chi2)
    return None if vanished.any() or _are_merged(fit) else fit


def fit_one_more(
    data: WhitenedSeries, fit: StatesFit, log_rate: float, amplitude: float
) -> StatesFit | None:
    """Fit one free state more than in `fit`, from a start value; None if it does not stay apart."""
    start = np.insert(fit.joint.shape, 2 * fit.n_free, [log_rate, amplitude])
    weights, offsets = fit.joint.weights, fit.joint.offsets
    limits = CANDIDATE_ITERATIONS, CANDIDATE_TOLERANCE
    more = _fit_from(data, start, fit.fixed, weights, offsets, *limits, CANDIDATE_GAIN)
    return None if more.vanished.any() or _are_merged(more) else more


def _are_merged(fit: StatesFit) -> bool:
    rates = np.sort(fit.joint.shape[0 : 2 * fit.n_free : 2])
    return len(rates) > 1 and float(np.diff(rates).min()) < MERGED_LOG_RATE


def refit(data: WhitenedSeries, fit: StatesFit, tolerance: float = 0.0) -> StatesFit:
    """Fit the same states, perhaps whitened anew, without vanishing ones.

    The fit ends at a relative step below `tolerance`, or at full precision.
    """
    joint = fit.joint
    return _refit_from(data, joint.shape, fit.fixed, joint.weights, joint.offsets, tolerance)


def _refit_from(
    data: WhitenedSeries,
    start: FloatArray,
    fixed: FloatArray,
    weights: FloatArray,
    offsets: FloatArray,
    tolerance: float,
) -> StatesFit:
    fit = _fit_from(data, start, fixed, weights, offsets, FINAL_ITERATIONS, tolerance)
    kept, n_free = ~fit.vanished, fit.n_free
    if kept.all():
        return fit
    if not kept.any():
        raise FitError(NO_DECAY)
    still_present = np.concatenate([np.repeat(kept[:n_free], 2), kept[n_free:]])
    return _refit_from(
        data, fit.joint.shape[still_present], fixed[kept[n_free:]], weights, offsets, tolerance
    )


def _fit_from(
    data: WhitenedSeries,
    start: FloatArray,
    fixed: FloatArray,
    weights: FloatArray,
    offsets: FloatArray,
    max_iterations: int,
    tolerance: float,
    least_gain: float = 0.0,
) -> StatesFit:
    n_free = (len(start) - len(fixed)) // 2
    low, high = data.series.log_rate_bounds
    lower, upper = np.zeros_like(start), np.full_like(start, np.inf)
    lower[0 : 2 * n_free : 2], upper[0 : 2 * n_free : 2] = low, high
    shape = exponentials(data.series, n_free, fixed)
    joint = fit_jointly(
        data, shape, start, weights, offsets, lower, upper, max_iterations, tolerance, least_gain
    )
    return StatesFit(joint, fixed)
