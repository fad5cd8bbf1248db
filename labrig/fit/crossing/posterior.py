"""Posteriors of laws from which the decay departs as a random walk of its slope.

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
from dataclasses import dataclass

import numpy as np

from labrig.fit.crossing.candidates import Candidate
from labrig.fit.crossing.readings import FEWEST_VALUES, LogDecay
from labrig.foundation.arrays import FloatArray

#: Steps δ of the walk of a slope per root of ln t.
WALKS = (0.03, 0.1, 0.25)
#: Parts of the record, in ln t, whose fits predict the rest.
FIRST_PARTS = (0.5, 0.75)
#: Steps of the fits, first damping, its factors after a good and a bad step, and its limits.
N_STEPS, DAMPING, BETTER, WORSE = 24, 1e-2, 0.2, 6.0
LEAST_DAMPING, MOST_DAMPING = 1e-9, 1e9
#: Change of a parameter, in its prior's σ, for slopes; largest change in a step.
SLOPE_STEP, LARGEST_STEP = 1e-5, 1.0
#: Degrees of freedom of the distributions of draws and of predictions.
FREEDOM = 6.0
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
        normal *= np.sqrt(FREEDOM / random.chisquare(FREEDOM, (2 * n, 1)))
        theta = self.mode + math.sqrt(self.misfit) * normal @ self.root.T
        residual = decay.log_light - self.law.log_light(theta, decay.log_time)
        chi2 = np.square(residual @ self.whitening.T).sum(axis=1) / self.misfit
        chi2 += np.square((theta - self.law.mean) / self.law.sigma).sum(axis=1)
        log_drawn = -(FREEDOM + p) / 2 * np.log1p(np.square(normal).sum(axis=1) / FREEDOM)
        log_ratio = -chi2 / 2 - log_drawn
        log_ratio[~np.isfinite(log_ratio)] = -np.inf
        ratio = np.exp(log_ratio - log_ratio.max())
        return theta[random.choice(2 * n, n, p=ratio / ratio.sum())]


def posteriors(decay: LogDecay, laws: tuple[Candidate, ...]) -> list[Posterior]:
    """Return the posteriors of all laws with all walks."""
    x, n = decay.log_time, len(decay.log_time)
    fractions = (x - x[0]) / (x[-1] - x[0])
    counts = {int(np.searchsorted(fractions, part, side="right")) for part in FIRST_PARTS}
    first = sorted(count for count in counts if FEWEST_VALUES <= count < n)
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
        -float(np.linalg.slogdet(covariance)[1] + (FREEDOM + len(x)) * np.log1p(chi2 / FREEDOM)) / 2
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
            step *= np.minimum(1.0, LARGEST_STEP / np.maximum(large, LARGEST_STEP))
            trial = at(theta + step)
            is_better = (trial[0] <= chi2) & np.isfinite(trial[2]).all(axis=(1, 2))
            damping = np.where(is_better, damping * BETTER, damping * WORSE)
            damping = np.clip(damping, LEAST_DAMPING, MOST_DAMPING)
            now = (
                np.where(is_better, trial[0], chi2),
                np.where(is_better[:, None], trial[1], gradient),
                np.where(is_better[:, None, None], trial[2], information),
                np.where(is_better[:, None], trial[3], theta),
            )
    chi2, _, information, theta = now
    best = chi2.reshape(n_starts, b).argmin(axis=0) * b + np.arange(b)
    return theta[best], chi2[best], information[best]
