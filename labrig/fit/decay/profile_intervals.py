"""Intervals of a decay's rates and lifetimes, and of a law's parameters, by profile likelihood.

The noise is held as it was fitted. What else is in σ, as correlated noise or a state that may hide,
widens an interval by the same factor; where the scatter told the noise, limits are those of the
F-test.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from labrig.fit.decay.fit_warnings import FitDiagnostics
from labrig.fit.decay.law_fit import LawFit
from labrig.fit.decay.series import WhitenedSeries
from labrig.fit.decay.states import StatesFit, exponentials
from labrig.fit.decay.variable_projection import JointFit, JointProblem, Shape
from labrig.fit.profile_likelihood import (
    Likelihood,
    LowerMinimumError,
    NoiseScale,
    Quantity,
    exponential,
    parameter,
)
from labrig.foundation.arrays import FloatArray
from labrig.foundation.result_warning import ResultWarning, Undetermined
from labrig.material import DECAY_LAWS
from labrig.results import EXPONENTIALS, ProfileInterval

#: Change of the logarithm of a time within which its limits are sought.
FARTHEST = 4.0
#: Least shape of Becquerel's law with a logarithm.
TINY_SHAPE = 1e-12

#: Reported quantities by name, each a monotone function of the profiled one.
Shown = dict[str, Callable[[float], float]]


@dataclass(frozen=True)
class Intervals:
    """Intervals by the name of their parameter, and names of those whose profile has none."""

    by_name: dict[str, ProfileInterval]
    without: tuple[str, ...]


def decay_intervals(
    data: WhitenedSeries,
    fit: StatesFit,
    covariance: FloatArray,
    laws: Iterable[LawFit],
    diagnostics: FitDiagnostics,
) -> tuple[dict[str, ProfileInterval], list[ResultWarning]]:
    """Return the intervals of a decay's states and its law, and warnings about them.

    Parameters
    ----------
    data, fit, covariance
        Whitened series, the fit at its minimum, and the covariance of its parameters, (p, p).
    laws
        Other laws that were fitted, with their final covariance.
    diagnostics
        Steps that led to the fit.
    """
    student, dof, all_of_them = (
        diagnostics.student,
        diagnostics.sigma_dof,
        diagnostics.all_intervals,
    )
    if not math.isfinite(student):
        student, covariance = 1.0, fit.joint.least_squares.covariance
    each = []
    # Of exponentials that only describe another law, σ is enough unless more is asked for.
    if all_of_them or diagnostics.law == EXPONENTIALS:
        each.append(rate_intervals(data, fit, covariance / student, dof, all_of_them=all_of_them))
    each += [
        law_intervals(diagnostics.data, law, student, dof, all_of_them=all_of_them)
        for law in laws
        if law.fitted.name == diagnostics.law
    ]
    warnings: list[ResultWarning] = [
        Undetermined(
            "minimum-not-lowest",
            "along the profile of {parameters} χ² falls below that of the fit, which did not end "
            "at the lowest minimum: ask for fewer states (--states) or record longer",
            parameters=part.without,
        )
        for part in each
        if part.without
    ]
    return {name: interval for part in each for name, interval in part.by_name.items()}, warnings


def rate_intervals(
    data: WhitenedSeries, fit: StatesFit, covariance: FloatArray, dof: float, *, all_of_them: bool
) -> Intervals:
    """Return intervals of rates in 1/s and lifetimes in seconds, states by falling rate.

    Parameters
    ----------
    data, fit
        Whitened series, and the fit at its minimum.
    covariance
        Covariance of the fitted parameters without Student's factor, shape (p, p).
    dof
        Degrees of freedom that told the noise; infinite where it is known.
    all_of_them
        Whether to return all of them, not only those that ±σ does not describe.
    """
    series, joint = data.series, fit.joint
    low, high = series.log_rate_bounds
    shape = exponentials(series, fit.n_free, fit.fixed)
    lower, upper = np.zeros_like(joint.shape), np.full_like(joint.shape, np.inf)
    lower[0 : 2 * fit.n_free : 2], upper[0 : 2 * fit.n_free : 2] = low, high
    likelihood = _likelihood(data, joint, shape, joint.shape, lower, upper)
    order = np.argsort(-fit.log_rates, kind="stable")
    log_rates = fit.log_rates
    wanted = []
    for number, state in enumerate(order.tolist(), start=1):
        if state >= fit.n_free:
            continue
        slower = tuple(2 * k for k in range(fit.n_free) if log_rates[k] < log_rates[state])
        faster = tuple(2 * k for k in range(fit.n_free) if log_rates[k] > log_rates[state])
        quantity = Quantity(
            parameter(2 * state), searched=(low, high), not_above=slower, not_below=faster
        )
        own = joint.least_squares.covariance
        noise = _noise(covariance[2 * state, 2 * state], own[2 * state, 2 * state], dof)
        shown: Shown = {
            f"k_r_per_s {number}": lambda log_rate: exponential(log_rate) / series.span_s,
            f"lifetime_s {number}": lambda log_rate: series.span_s * exponential(-log_rate),
        }
        wanted.append((quantity, noise, shown))
    return _intervals(likelihood, wanted, all_of_them=all_of_them)


def law_intervals(
    data: WhitenedSeries, law: LawFit, student: float, dof: float, *, all_of_them: bool
) -> Intervals:
    """Return intervals of a law's own parameters, named as `FittedLaw.parameters` are.

    Parameters
    ----------
    data, law
        Whitened series, and a law that was fitted to it.
    student
        Factor in the law's covariance where the scatter told the noise.
    dof, all_of_them
        As of `rate_intervals`.
    """
    series, fitted = data.series, law.fitted
    kind = DECAY_LAWS[fitted.name]
    time = series.t + series.start

    def shape(theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        means, slopes = kind.means(float(np.exp(theta[1])), float(theta[2]), time, series.exposure)
        return theta[0] * means, np.column_stack([means, theta[0] * slopes])

    log_rate = math.log(fitted.rate_per_s * series.span_s)
    theta = np.array([fitted.amplitude / series.peak, log_rate, fitted.shape])
    least, largest = kind.shapes
    lower, upper = np.array([0.0, -np.inf, least]), np.array([np.inf, np.inf, largest])
    likelihood = _likelihood(data, law.joint, shape, theta, lower, upper)
    span_s = series.span_s
    own = law.joint.least_squares.covariance[1, 1]
    noise = _noise(float(law.covariance[1, 1] / student), float(own), dof)
    searched = log_rate - FARTHEST, log_rate + FARTHEST
    rate = Quantity(parameter(1), searched=searched)
    quantity = Quantity(parameter(2), *kind.possible_shapes, kind.shapes)
    time_s: Shown = {"decay_time_s": lambda log_rate: span_s * exponential(-log_rate)}
    of_shape: Shown = {kind.shape_name: float}
    if kind.name == "becquerel":
        log_time, _ = _log_time(likelihood.fit.parameters)
        rate, time_s = (
            Quantity(_log_time, searched=(log_time - FARTHEST, log_time + FARTHEST)),
            {"decay_time_s": lambda log_s: span_s * exponential(log_s)},
        )
        of_shape = {"exponent": _reciprocal, "kinetic_order": _order_of}
    wanted = [(rate, noise, time_s), (quantity, noise, of_shape)]
    return _intervals(likelihood, wanted, all_of_them=all_of_them)


def _likelihood(
    data: WhitenedSeries,
    joint: JointFit,
    shape: Shape,
    theta: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
) -> Likelihood:
    """Return the likelihood of a shape, its parameters (q,) being near the minimum."""
    weights = joint.weights
    others = [c for c in range(len(weights)) if c != joint.brightest]
    problem = JointProblem(data, shape, len(theta), others)
    ends = np.full_like(weights, np.inf)
    return Likelihood.at_minimum(
        problem.residuals,
        problem.pack(theta, weights, joint.offsets),
        problem.pack(lower, np.zeros_like(weights), -ends),
        problem.pack(upper, ends, ends),
    )


def _noise(variance: float, by_curvature: float, dof: float) -> NoiseScale:
    """Return the scale of the noise by a variance in σ over that by the curvature of χ²."""
    ratio = variance / by_curvature if by_curvature > 0 else math.nan
    return NoiseScale(ratio if 0 < ratio < math.inf else 1.0, dof)


def _intervals(
    likelihood: Likelihood,
    wanted: Iterable[tuple[Quantity, NoiseScale, Shown]],
    *,
    all_of_them: bool,
) -> Intervals:
    """Return the intervals of all quantities, or of those that two points show to be asymmetric."""
    by_name: dict[str, ProfileInterval] = {}
    without: list[str] = []
    for quantity, noise, shown in wanted:
        functions = shown.values()
        if not (all_of_them or any(likelihood.is_asymmetric(quantity, each) for each in functions)):
            continue
        try:
            interval = likelihood.interval(quantity, noise)
        except LowerMinimumError:
            without += shown
            continue
        by_name |= {name: interval.mapped(function) for name, function in shown.items()}
    return Intervals(by_name, tuple(without))


def _log_time(theta: FloatArray) -> tuple[float, FloatArray]:
    """Return log τ of Becquerel's law, whose rate is 1/(u τ) with the shape u."""
    shape = max(float(theta[2]), TINY_SHAPE)
    gradient = np.zeros(len(theta))
    gradient[1], gradient[2] = -1.0, -1 / shape
    return -float(theta[1]) - math.log(shape), gradient


def _reciprocal(shape: float) -> float:
    return 1 / shape if shape > 0 else math.inf


def _order_of(shape: float) -> float:
    """Return the kinetic order b of Becquerel's law with an exponent 1/shape = b/(b − 1)."""
    return 1 / (1 - shape) if shape < 1 else math.inf
