"""Time at which a decay falls to a level beyond its record: a range of 95 %, and an earliest time.

Draws come from the posteriors of several laws, from which the decay departs as a random walk of its
slope; laws and the walk's step are weighed by how well a fit of the first part of the record
predicts its later part. No record foretells all that begins after it, such as the end of a trap
that was hidden: a part of the draws takes the laws alike, with the largest step.

ln L is convex in t for every sum of decaying exponentials with amplitudes ≥ 0 (by the inequality of
Cauchy and Schwarz), among which are Becquerel's law and stretched exponentials of β ≤ 1, and for
one trap with retrapping. It then lies above its tangents: with the rate k = −d ln L/dt at the end T

    T* ≥ T + ln(L(T)/L*)/k.

A line through the last readings lies below ln L at the end and is as steep or steeper, so that its
bound is earlier. A light that is cut off more sharply than by an exponential is no such sum: that
of a sample that cools, of a stretched exponential of β > 1, or of a lamp that runs empty. Its rate
grows with time, which is looked for.

The reference that takes the fall out of the readings before they are averaged is a sum of
exponentials of fixed rates with amplitudes ≥ 0: it follows every decay of independent traps, and
has a slope everywhere.

All are ln L over x = ln t. Rates are relative to the last time T, so that priors are those of what
a record can show: a law bends somewhere within it.

No law is exact: −d ln L/d ln t is the law's times 1 + g, where g is 0 at the end of the record and
walks from there by δ per root of ln t, to both sides. Its integral h moves ln L by −s h, s the
slope; residuals therefore correlate, by the kernel of an integrated Wiener process that begins at
the end, and laws are fitted by generalised least squares. Beyond the record the same walk goes on:
the error of ln t grows there as δ d^(3/2)/√3 with the distance d = ln(t/T). Laws and δ are weighed
by how well fits of the first parts of the record predict its later parts.

References
----------
M. C. Kennedy and A. O'Hagan, *Bayesian calibration of computer models*, J. R. Stat. Soc. B 63
(2001) 425, for a model's departure as a process; G. Wahba, *Spline Models for Observational Data*
(1990), for the kernel; A. P. Dawid, *Statistical theory: the prequential approach*, J. R. Stat.
Soc. A 147 (1984) 278, for weights by predictions.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from labrig.fit.nonlinear_least_squares import least_squares
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from labrig.foundation.nonnegative import nonnegative_least_squares
from labrig.material import DECAY_LAWS
from labrig.results import NORMAL_95, ForecastTime, Measured

#: Factors in time of the last readings that lines are laid through, and fewest readings of a line.
WINDOWS = (1.25, 1.6, 2.5, 5.0)
FEWEST = 5
#: Factors in time before the end between which rates are compared, and the growth of a rate that
#: is none of the noise's: in σ, and relative.
PARTS = (1.0, 1.5, 2.5, 5.0, 12.0)
GROWN_SIGMAS, GROWN = 4.0, 0.05
#: Largest relative σ of a rate of which the inverse is nearly normal.
UNCERTAIN_RATE = 0.3


def earliest_crossing(
    t_s: FloatArray,
    light: FloatArray,
    sigma: FloatArray,
    level: float,
    level_sigma: float,
) -> Measured | None:
    """Return the earliest time of a level by the line that puts it latest; None without a line.

    Parameters
    ----------
    t_s, light, sigma
        Readings and their σ, shape (n,).
    level, level_sigma
        The level, and σ of its logarithm.
    """
    bounds = []
    for window in WINDOWS:
        line = _line(t_s, light, sigma, t_s >= t_s[-1] / window)
        if line is not None:
            bounds.append(line.reaches(level, level_sigma))
    return max(bounds, key=lambda one: one.value - NORMAL_95 * one.sigma, default=None)


def growing_rate(
    t_s: FloatArray, light: FloatArray, sigma: FloatArray
) -> tuple[Measured, Measured] | None:
    """Return two rates in 1/s, the later of which is clearly larger; None if ln L is convex.

    The arguments are those of `earliest_crossing`.
    """
    rates = {}
    for late, early in combinations(PARTS, 2):
        used = (t_s > t_s[-1] / early) & (t_s <= t_s[-1] / late)
        line = _line(t_s, light, sigma, used)
        if line is not None:
            rates[late, early] = line.rate_per_s
    grown = [
        (before, after)
        for (_, end), after in rates.items()
        for (begin, _), before in rates.items()
        if end <= begin
        and after.sigmas_from(before) > GROWN_SIGMAS
        and after.value > (1 + GROWN) * before.value
    ]
    return max(grown, key=lambda pair: pair[1].sigmas_from(pair[0]), default=None)


@dataclass(frozen=True)
class _Line:
    """ln L = a − b (t − T)/s at the end of a part of the record."""

    end_s: float
    span_s: float
    log_light: float
    fall: float
    covariance: FloatArray

    @property
    def rate_per_s(self) -> Measured:
        sigma = math.sqrt(float(self.covariance[1, 1]))
        return Measured(self.fall / self.span_s, sigma / self.span_s, "1/s")

    def reaches(self, level: float, level_sigma: float) -> Measured:
        """Return the time at which the line reaches a level."""
        after = (self.log_light - math.log(level)) / self.fall
        slopes = np.array([1.0, after]) / self.fall
        variance = float(slopes @ self.covariance @ slopes) + (level_sigma / self.fall) ** 2
        return Measured(self.end_s + self.span_s * after, self.span_s * math.sqrt(variance), "s")


def _line(
    t_s: FloatArray, light: FloatArray, sigma: FloatArray, used: NDArray[np.bool_]
) -> _Line | None:
    """Return the line through some readings; None if they are few, or do not fall clearly."""
    t_s, light, sigma = t_s[used], light[used], sigma[used]
    if len(t_s) < FEWEST or not (light > 0).any():
        return None
    end_s, span_s = float(t_s[-1]), float(t_s[-1] - t_s[0])
    powers = np.stack([np.ones_like(t_s), (t_s - end_s) / span_s], axis=1)

    def residuals(line: FloatArray) -> tuple[FloatArray, FloatArray]:
        model = np.exp(powers @ line)
        return (model - light) / sigma, powers * (model / sigma)[:, None]

    fit = least_squares(residuals, [math.log(float(np.mean(np.maximum(light, 0)))), 0.0])
    log_light, fall = float(fit.parameters[0]), -float(fit.parameters[1])
    if not fit.converged or not 0 < float(fit.sigma[1]) < UNCERTAIN_RATE * fall:
        return None
    covariance = max(1.0, fit.reduced_chi2) * fit.covariance
    return _Line(end_s, span_s, log_light, fall, covariance)


#: Most values, evenly spaced in ln t, and the fewest that a law is fitted to.
MAX_VALUES, MIN_VALUES = 32, 5
#: Rates of the reference: lowest in inverse last times, highest in inverse first times, number.
LOWEST_RATE, HIGHEST_RATE, N_RATES = 0.02, 8.0, 40
#: Least luminance of the reference, relative to its largest, and least slope −d ln L/d ln t.
MIN_REFERENCE, MIN_SLOPE = 1e-9, 0.05
#: Relative σ that the search for the scatter begins with, the least, and the number of its steps.
BEGIN_SCATTER, MIN_SCATTER, SCATTER_STEPS = 0.02, 1e-5, 4
#: Parameters of a reference, which follow the readings.
REFERENCE_PARAMETERS = 4
#: Degrees of freedom of differences of neighbours per reading, and σ of their mean square from
#: which given σ are too small.
DIFFERENCE_FREEDOM, TOO_SMALL_SIGMAS = 0.6, 2.0


@dataclass(frozen=True)
class LogDecay:
    """Values of ln L over ln t.

    Attributes
    ----------
    log_time
        ln(t / s), rising, shape (n,).
    log_light
        ln(L / (mcd/m²)), shape (n,).
    sigma
        σ of ln L without errors that all have in common, shape (n,).
    slope
        −d ln L/d ln t, > 0, shape (n,).
    """

    log_time: FloatArray
    log_light: FloatArray
    sigma: FloatArray
    slope: FloatArray

    @classmethod
    def of(cls, t_s: FloatArray, light: FloatArray, sigma: FloatArray) -> "LogDecay":
        """Return the values of readings with their σ, all (n,).

        Raises
        ------
        FitError
            Fewer than five means are above zero.
        """
        x = np.log(t_s)
        reference, slope = _reference(x, light, sigma)
        weights = np.square(reference / sigma)
        edges = np.linspace(x[0], x[-1], MAX_VALUES + 1)[1:-1]
        place = np.searchsorted(edges, x, side="right")
        # What falls below nothing has no logarithm.
        sums = np.bincount(place, weights * light / reference, MAX_VALUES)
        used = np.flatnonzero(sums > 0)
        if len(used) < MIN_VALUES:
            raise FitError(
                f"expected means above zero at {MIN_VALUES} times or more, got {len(used)}"
            )
        totals = np.bincount(place, weights, MAX_VALUES)[used]

        def mean(values: FloatArray) -> FloatArray:
            return np.asarray(np.bincount(place, weights * values, MAX_VALUES)[used] / totals)

        return cls(
            mean(x),
            np.log(sums[used] / totals) + mean(np.log(reference)),
            1 / np.sqrt(totals),
            np.maximum(mean(slope), MIN_SLOPE),
        )


def reading_sigma(t_s: FloatArray, light: FloatArray, sigma: FloatArray | None) -> FloatArray:
    """Return σ of readings (n,): those given, larger where neighbours scatter more, or the scatter.

    The scatter has a part of the luminance and a constant.
    """
    x = np.log(t_s)
    if sigma is not None:
        return sigma * _sigma_factor(x, light, sigma)
    scatter = BEGIN_SCATTER * np.maximum(np.abs(light), float(np.median(np.abs(light))))
    for _ in range(SCATTER_STEPS):
        reference, _ = _reference(x, light, scatter)
        difference, squares = _differences(x, light / reference)
        parts = np.stack([_of_three(squares, np.ones_like(x)), _of_three(squares, reference**-2)])
        expected = _of_three(squares, np.square(scatter / reference))
        variances = nonnegative_least_squares(
            (parts / expected).T, np.square(difference) / expected
        )
        relative = max(float(variances[0]), MIN_SCATTER**2)
        scatter = np.sqrt(relative * np.square(reference) + variances[1])
    # Parameters of the reference follow the readings.
    followed = math.sqrt(len(x) / max(len(x) - REFERENCE_PARAMETERS, 1))
    return np.asarray(followed * scatter)


def _reference(
    x: FloatArray, light: FloatArray, sigma: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the reference at ln t (n,), and −d ln L/d ln t of it."""
    t_s = np.exp(x)
    rates = np.geomspace(LOWEST_RATE / t_s[-1], HIGHEST_RATE / t_s[0], N_RATES)
    decays = np.exp(-np.multiply.outer(t_s, rates))
    amplitudes = nonnegative_least_squares(decays / sigma[:, None], light / sigma)
    value = decays @ amplitudes
    value = np.maximum(value, MIN_REFERENCE * float(value.max()))
    return value, t_s * (decays @ (amplitudes * rates)) / value


def _differences(x: FloatArray, ratio: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return values less the line through both neighbours, and the squares of the three weights."""
    early = (x[2:] - x[1:-1]) / (x[2:] - x[:-2])
    difference = ratio[1:-1] - early * ratio[:-2] - (1 - early) * ratio[2:]
    return difference, np.stack([np.square(early), np.ones_like(early), np.square(1 - early)])


def _of_three(squares: FloatArray, variance: FloatArray) -> FloatArray:
    """Return the variance of differences of neighbours."""
    neighbours = np.stack([variance[:-2], variance[1:-1], variance[2:]])
    return np.asarray((squares * neighbours).sum(axis=0))


def _sigma_factor(x: FloatArray, light: FloatArray, sigma: FloatArray) -> float:
    """Return the factor by which neighbours scatter more than their given σ, 1 or more."""
    reference, _ = _reference(x, light, sigma)
    difference, squares = _differences(x, light / reference)
    expected = _of_three(squares, np.square(sigma / reference))
    ratio = float(np.mean(np.square(difference) / expected))
    spread = math.sqrt(2 / (DIFFERENCE_FREEDOM * len(difference)))
    return math.sqrt(ratio) if ratio > 1 + TOO_SMALL_SIGMAS * spread else 1.0


#: Numbers of exponentials.
N_EXPONENTIALS = (2, 3)
#: Priors, mean and σ: ln of the amplitude above the first reading, ln of the rate times T, and the
#: logit of the shape.
AMPLITUDE, RATE, LOGIT = (1.0, 4.0), (1.5, 3.0), (0.0, 1.5)
#: Priors of exponentials: ln of the slowest one's amplitude above the last reading and of its rate
#: times T; ln of the ratio of amplitudes and of rates from one to the next faster.
SLOWEST_AMPLITUDE, SLOWEST_RATE = (1.5, 3.0), (0.7, 1.3)
NEXT_AMPLITUDE, NEXT_RATE = (1.3, 1.5), (1.6, 0.8)
#: Priors of an exponential that is added to a law: part of the last time at which its light is
#: given, and its ln relative to the whole there.
ADDED_AT, ADDED_LIGHT = 1 / 3, (-1.0, 1.5)
#: Least luminance of a law, of which the logarithm is finite.
LEAST = 1e-300

#: Parameters (b, p) and ln t (n,) → ln L (b, n).
Model = Callable[[FloatArray, FloatArray], FloatArray]


@dataclass(frozen=True)
class Candidate:
    """A law with normal priors.

    Attributes
    ----------
    name
        Name of the law.
    log_light
        Function of parameters (b, p) and ln t (n,) that returns ln L (b, n).
    mean, sigma
        Mean and σ of the parameters before the record, shape (p,).
    starts
        Parameters from which fits begin, shape (m, p).
    """

    name: str
    log_light: Model
    mean: FloatArray
    sigma: FloatArray
    starts: FloatArray


def candidates(decay: LogDecay) -> tuple[Candidate, ...]:
    """Return the laws with priors for a record."""
    becquerel, *others = (_law(name, decay) for name in DECAY_LAWS)
    exponentials = (_exponentials(n, decay) for n in N_EXPONENTIALS)
    return (becquerel, *others, *exponentials, _with_exponential(becquerel, decay))


def _law(name: str, decay: LogDecay) -> Candidate:
    value, (least, largest) = DECAY_LAWS[name].value, DECAY_LAWS[name].forecast_shapes

    def log_light(theta: FloatArray, x: FloatArray) -> FloatArray:
        shape = least + (largest - least) * expit(theta[:, 2:])
        light = value(np.exp(theta[:, 1:2] + x), shape)
        return np.asarray(theta[:, :1] + np.log(np.maximum(light, LEAST)))

    first, last = float(decay.log_light[0]), float(decay.log_time[-1])
    mean = np.array([first + AMPLITUDE[0], RATE[0] - last, LOGIT[0]])
    sigma = np.array([AMPLITUDE[1], RATE[1], LOGIT[1]])
    steps = sigma * np.array([[0.0, -0.3, 0.0], [0.0, 0.6, 0.3]])
    return Candidate(name, log_light, mean, sigma, mean + steps)


def _with_exponential(law: Candidate, decay: LogDecay) -> Candidate:
    """Return the sum of a law and one exponential, which may hide the law's tail."""
    n = len(law.mean)
    last_s = float(np.exp(decay.log_time[-1]))
    at_s = ADDED_AT * last_s
    level = float(np.interp(np.log(at_s), decay.log_time, decay.log_light))

    def log_light(theta: FloatArray, x: FloatArray) -> FloatArray:
        rate = np.exp(theta[:, n + 1 :])
        added = theta[:, n : n + 1] - rate * (np.exp(x) - at_s)
        return np.logaddexp(law.log_light(theta[:, :n], x), added)

    mean = np.array([*law.mean, ADDED_LIGHT[0] + level, SLOWEST_RATE[0] - np.log(last_s)])
    sigma = np.array([*law.sigma, ADDED_LIGHT[1], SLOWEST_RATE[1]])
    starts = np.stack([mean, mean])
    starts[:, :n] = law.starts
    starts[1, n + 1] += 0.8
    return Candidate(f"{law.name} and exponential", log_light, mean, sigma, starts)


def _exponentials(n: int, decay: LogDecay) -> Candidate:
    def log_light(theta: FloatArray, x: FloatArray) -> FloatArray:
        amplitudes = np.cumsum(theta[:, 0::2], axis=1)
        rates = np.exp(np.cumsum(theta[:, 1::2], axis=1))
        terms = amplitudes[:, :, None] - rates[:, :, None] * np.exp(x)
        highest = terms.max(axis=1)
        return np.asarray(highest + np.log(np.exp(terms - highest[:, None]).sum(axis=1)))

    level, last = float(decay.log_light[-1]), float(decay.log_time[-1])
    mean = np.array(
        [SLOWEST_AMPLITUDE[0] + level, SLOWEST_RATE[0] - last]
        + [NEXT_AMPLITUDE[0], NEXT_RATE[0]] * (n - 1)
    )
    sigma = np.array(
        [SLOWEST_AMPLITUDE[1], SLOWEST_RATE[1]] + [NEXT_AMPLITUDE[1], NEXT_RATE[1]] * (n - 1)
    )
    faster = np.zeros_like(mean)
    faster[1] = 0.8
    return Candidate(f"{n} exponentials", log_light, mean, sigma, np.stack([mean, mean + faster]))


#: Steps δ of the walk of a slope per root of ln t.
WALKS = (0.03, 0.1, 0.25)
#: Parts of the record, in ln t, whose fits predict the rest.
FIRST_PARTS = (0.5, 0.75)
#: Steps of the fits, first damping, its factors after a good and a bad step, and its limits.
N_STEPS, DAMPING, BETTER, WORSE = 24, 1e-2, 0.2, 6.0
MIN_DAMPING, MAX_DAMPING = 1e-9, 1e9
#: Change of a parameter, in its prior's σ, for slopes; largest change in a step.
SLOPE_STEP, MAX_STEP = 1e-5, 1.0
#: Degrees of freedom of the distributions of draws and of predictions.
STUDENT_FREEDOM = 6.0

#: Parameters that a record determines, of those that a law has.
SHAPE_PARAMETERS = 3


def walk_covariance(distance: FloatArray, slope: FloatArray, delta: float) -> FloatArray:
    """Return the covariance of ln L by a walk that begins at distance 0, shape (n, n).

    Distances (n,) are in ln t, all ≤ 0 or all ≥ 0; slopes (n,) are −d ln L/d ln t.
    """
    u = np.abs(distance)
    near, far = np.minimum.outer(u, u), np.maximum.outer(u, u)
    kernel = near**2 * (3 * far - near) / 6
    return np.asarray(delta**2 * np.outer(slope, slope) * kernel)


@dataclass(frozen=True)
class Posterior:
    """A law with a walk after a record.

    Attributes
    ----------
    law
        The law.
    delta
        Step of the walk.
    whitening
        Inverse of the lower Cholesky factor of the covariance of the values, shape (n, n).
    mode, root
        Most probable parameters (p,), and the root R of their covariance R Rᵀ, (p, p).
    misfit
        χ² per value, 1 or more.
    log_weight
        Logarithm of the probability density of the later parts by the first ones, its mean.
    """

    law: Candidate
    delta: float
    whitening: FloatArray
    mode: FloatArray
    root: FloatArray
    misfit: float
    log_weight: float

    def draws(self, decay: LogDecay, n: int, random: np.random.Generator) -> FloatArray:
        """Draw parameters, shape (n, p).

        Draws from Student's distribution about the mode are drawn again by their probabilities.
        """
        p = len(self.mode)
        normal = random.standard_normal((2 * n, p))
        normal *= np.sqrt(STUDENT_FREEDOM / random.chisquare(STUDENT_FREEDOM, (2 * n, 1)))
        theta = self.mode + math.sqrt(self.misfit) * normal @ self.root.T
        residual = decay.log_light - self.law.log_light(theta, decay.log_time)
        chi2 = np.square(residual @ self.whitening.T).sum(axis=1) / self.misfit
        chi2 += np.square((theta - self.law.mean) / self.law.sigma).sum(axis=1)
        log_drawn = (
            -(STUDENT_FREEDOM + p) / 2 * np.log1p(np.square(normal).sum(axis=1) / STUDENT_FREEDOM)
        )
        log_ratio = -chi2 / 2 - log_drawn
        log_ratio[~np.isfinite(log_ratio)] = -np.inf
        ratio = np.exp(log_ratio - log_ratio.max())
        return theta[random.choice(2 * n, n, p=ratio / ratio.sum())]


def posteriors(decay: LogDecay, laws: tuple[Candidate, ...]) -> list[Posterior]:
    """Return the posteriors of all laws with all walks."""
    x, n = decay.log_time, len(decay.log_time)
    fractions = (x - x[0]) / (x[-1] - x[0])
    counts = {int(np.searchsorted(fractions, part, side="right")) for part in FIRST_PARTS}
    first = sorted(count for count in counts if MIN_VALUES <= count < n)
    problems = [(delta, count) for delta in WALKS for count in (*first, n)]
    whitening = np.stack([_whitening(decay, *problem) for problem in problems])
    result = []
    for law in laws:
        mode, chi2, information = _fits(decay, law, whitening)
        for delta in WALKS:
            scores = [
                _log_prediction(decay, law, delta, count, mode[k], information[k])
                for k, (walk, count) in enumerate(problems)
                if walk == delta and count < n
            ]
            k = problems.index((delta, n))
            root = np.linalg.inv(np.linalg.cholesky(information[k])).T
            misfit = max(1.0, float(chi2[k]) / (n - SHAPE_PARAMETERS))
            weight = float(np.mean(scores)) if scores else 0.0
            result.append(Posterior(law, delta, whitening[k], mode[k], root, misfit, weight))
    return result


def _whitening(decay: LogDecay, delta: float, count: int) -> FloatArray:
    """Return the whitening (n, n) of the first values with a walk from the last of them."""
    part = slice(0, count)
    distance = decay.log_time[part] - decay.log_time[count - 1]
    covariance = walk_covariance(distance, decay.slope[part], delta)
    covariance[np.diag_indices(count)] += np.square(decay.sigma[part])
    n = len(decay.log_time)
    result = np.zeros((n, n))
    result[part, part] = np.linalg.inv(np.linalg.cholesky(covariance))
    return result


def _log_prediction(
    decay: LogDecay,
    law: Candidate,
    delta: float,
    count: int,
    mode: FloatArray,
    information: FloatArray,
) -> float:
    """Return the log probability density of the later values by a fit of the first ones."""
    later = slice(count, None)
    x, p = decay.log_time[later], len(mode)
    steps = SLOPE_STEP * law.sigma
    curves = law.log_light(mode + np.concatenate([np.zeros((1, p)), np.diag(steps)]), x)
    slopes = (curves[1:] - curves[0]) / steps[:, None]
    covariance = walk_covariance(x - decay.log_time[count - 1], decay.slope[later], delta)
    covariance += slopes.T @ np.linalg.solve(information, slopes)
    covariance[np.diag_indices(len(x))] += np.square(decay.sigma[later])
    chi2 = (curves[0] - decay.log_light[later]) @ np.linalg.solve(
        covariance, curves[0] - decay.log_light[later]
    )
    return (
        -float(
            np.linalg.slogdet(covariance)[1]
            + (STUDENT_FREEDOM + len(x)) * np.log1p(chi2 / STUDENT_FREEDOM)
        )
        / 2
    )


def _fits(
    decay: LogDecay, law: Candidate, whitening: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Fit a law with several whitenings (b, n, n) at once.

    Returns parameters (b, p), χ² with that of the priors (b,), and half of its curvature (b, p, p).
    """
    b, p = len(whitening), len(law.mean)
    n_starts = len(law.starts)
    theta = np.repeat(law.starts, b, axis=0)
    every = np.concatenate([whitening] * n_starts)
    steps = SLOPE_STEP * law.sigma

    def at(theta: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        shifted = theta[:, None, :] + np.concatenate([np.zeros((1, p)), np.diag(steps)])
        model = law.log_light(shifted.reshape(-1, p), decay.log_time)
        model = model.reshape(len(theta), p + 1, -1)
        slopes = (model[:, 1:] - model[:, :1]) / steps[:, None]
        rows = np.concatenate([model[:, :1] - decay.log_light, slopes], axis=1)
        rows = rows @ every.swapaxes(1, 2)
        residual, jacobian = rows[:, 0], rows[:, 1:]
        off = (theta - law.mean) / law.sigma
        chi2 = np.square(residual).sum(axis=1) + np.square(off).sum(axis=1)
        gradient = (jacobian @ residual[:, :, None])[:, :, 0] + off / law.sigma
        information = jacobian @ jacobian.swapaxes(1, 2) + np.diag(law.sigma**-2.0)
        return chi2, gradient, information, theta

    with np.errstate(all="ignore"):
        now = at(theta)
        damping = np.full(len(theta), DAMPING)
        for _ in range(N_STEPS):
            chi2, gradient, information, theta = now
            diagonal = np.einsum("bii->bi", information)
            damped = information + (damping[:, None] * diagonal)[:, :, None] * np.eye(p)
            step = -np.linalg.solve(damped, gradient[:, :, None])[:, :, 0]
            large = (np.abs(step) / law.sigma).max(axis=1, keepdims=True)
            step *= np.minimum(1.0, MAX_STEP / np.maximum(large, MAX_STEP))
            trial = at(theta + step)
            is_better = (trial[0] <= chi2) & np.isfinite(trial[2]).all(axis=(1, 2))
            damping = np.where(is_better, damping * BETTER, damping * WORSE)
            damping = np.clip(damping, MIN_DAMPING, MAX_DAMPING)
            now = (
                np.where(is_better, trial[0], chi2),
                np.where(is_better[:, None], trial[1], gradient),
                np.where(is_better[:, None, None], trial[2], information),
                np.where(is_better[:, None], trial[3], theta),
            )
    chi2, _, information, theta = now
    best = chi2.reshape(n_starts, b).argmin(axis=0) * b + np.arange(b)
    return theta[best], chi2[best], information[best]


#: Part of the draws of what the record does not foretell.
UNFORESEEN = 0.15
#: Number of draws, and least weight of a law that is drawn from.
N_DRAWS, MIN_WEIGHT = 2000, 2e-3
#: Probability on each side of the range.
OUTSIDE = 0.025
#: Ratio of its ends from which a time is not determined.
NOT_DETERMINED = 10.0
#: ln(t/T) before and after the end T up to which laws are followed, and numbers of times.
BEFORE, N_BEFORE = 0.7, 8
AFTER, N_AFTER = math.log(300.0), 101
#: Factors of the slope at the end that a law's later slope is taken as, least and largest.
SLOPES = (0.2, 5.0)
SEED = 20_260


def forecast_crossing(
    t_s: FloatArray,
    light: FloatArray,
    sigma: FloatArray | None,
    level: float,
    level_sigma: float,
) -> ForecastTime:
    """Forecast the time at which a decay falls to a level.

    Parameters
    ----------
    t_s, light
        Readings at rising times > 0 in seconds, eight or more, or five with σ, shape (n,).
    sigma
        σ of the readings, shape (n,); None takes their scatter.
    level, level_sigma
        The level, and σ of its logarithm: that of what all readings have in common.

    Returns
    -------
    ForecastTime
        The range, the earliest time and the weights of the laws.

    Raises
    ------
    FitError
        Hardly any reading is above its noise, or the decay is cut off more sharply than by an
        exponential.
    """
    sigma = reading_sigma(t_s, light, sigma)
    decay = LogDecay.of(t_s, light, sigma)
    rates = growing_rate(t_s, light, sigma)
    if rates is not None:
        raise FitError(
            f"the rate −d ln L/dt grows with time, from {rates[0]} to {rates[1]}, which that of no "
            "sum of decaying exponentials does: a zero that is subtracted too much, a sample that "
            "cools, or a detector that saturates"
        )
    at_least = earliest_crossing(t_s, light, sigma, level, level_sigma)
    every = posteriors(decay, candidates(decay))
    weights = _weights(every)
    random = np.random.default_rng(SEED)
    levels = math.log(level) + level_sigma * random.standard_normal(N_DRAWS)
    ends = np.cumsum(random.multinomial(N_DRAWS, weights))
    # Laws far from the record overflow, and are drawn by nobody.
    with np.errstate(all="ignore"):
        parts = zip(every, np.split(levels, ends[:-1]), strict=True)
        drawn = np.concatenate([_crossings(one, decay, part, random) for one, part in parts])
    low, middle, high = np.exp(np.quantile(drawn, [OUTSIDE, 0.5, 1 - OUTSIDE], method="lower"))
    if at_least is not None:
        earliest = at_least.value - NORMAL_95 * at_least.sigma
        low, middle, high = (max(float(end), earliest) for end in (low, middle, high))
    is_determined = high < NOT_DETERMINED * low
    names = dict.fromkeys(posterior.law.name for posterior in every)
    return ForecastTime(
        at_least=at_least,
        between_s=(float(low), float(high)) if is_determined else None,
        median_s=float(middle) if is_determined else None,
        laws={
            name: float(sum(w for w, p in zip(weights, every, strict=True) if p.law.name == name))
            for name in names
        },
    )


def _weights(every: list[Posterior]) -> FloatArray:
    """Return the probabilities with which laws are drawn from."""
    logs = np.array([posterior.log_weight for posterior in every])
    weights = np.exp(logs - logs.max())
    unforeseen = np.array([float(posterior.delta == max(WALKS)) for posterior in every])
    weights = (1 - UNFORESEEN) * weights / weights.sum() + UNFORESEEN * unforeseen / sum(unforeseen)
    weights[weights < MIN_WEIGHT] = 0.0
    return np.asarray(weights / weights.sum())


def _crossings(
    posterior: Posterior, decay: LogDecay, log_levels: FloatArray, random: np.random.Generator
) -> FloatArray:
    """Draw ln t at which ln L falls to levels (n,); infinite where it does not."""
    n = len(log_levels)
    if n == 0:
        return np.empty(0)
    theta = posterior.draws(decay, n, random)
    end = float(decay.log_time[-1])
    d = np.concatenate([np.linspace(-BEFORE, 0, N_BEFORE + 1)[:-1], np.linspace(0, AFTER, N_AFTER)])
    curve = posterior.law.log_light(theta, end + d)
    slope = -np.gradient(curve, d, axis=1)
    at_end = np.maximum(slope[:, N_BEFORE : N_BEFORE + 1], 1e-6)
    slope = decay.slope[-1] * np.clip(slope / at_end, *SLOPES)
    walked = posterior.delta * np.sqrt(np.maximum(d, 0) ** 3 / 3) * random.standard_normal((n, 1))
    curve = curve + slope * walked
    below = curve < log_levels[:, None]
    place = np.maximum(np.argmax(below, axis=1), 1)
    rows = np.arange(n)
    high, low = curve[rows, place - 1], curve[rows, place]
    part = (high - log_levels) / np.maximum(high - low, 1e-12)
    crossed = d[place - 1] + np.clip(part, 0, 1) * (d[place] - d[place - 1])
    return np.where(below.any(axis=1), end + crossed, np.inf)
