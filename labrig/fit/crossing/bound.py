"""Earliest time at which a decay falls to a level, by its convexity and no law.

ln L is convex in t for every sum of decaying exponentials with amplitudes ≥ 0 (Cauchy and Schwarz),
among which are Becquerel's law and stretched exponentials of β ≤ 1, and for one trap with
retrapping. It then lies above its tangents: with the rate k = −d ln L/dt at the end T,

    T* ≥ T + ln(L(T)/L*)/k.

A line through the last readings lies below ln L at the end and is as steep or steeper, so that its
bound is earlier. A decay that is cut off more sharply than an exponential is no such sum: the light
of a sample that is heated or lit with infrared, or of a battery, may end before.
"""

import math

import numpy as np

from labrig.fit.least_squares import FloatArray, least_squares
from labrig.results import SIGMAS_95, Measured

#: Factors in time of the last readings that lines are laid through, and fewest readings of a line.
WINDOWS = (1.25, 1.6, 2.5, 5.0)
FEWEST = 5
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
        used = t_s >= t_s[-1] / window
        if np.count_nonzero(used) < FEWEST or not (light[used] > 0).any():
            continue
        bound = _by_line(t_s[used], light[used], sigma[used], level, level_sigma)
        if bound is not None:
            bounds.append(bound)
    return max(bounds, key=lambda one: one.value - SIGMAS_95 * one.sigma, default=None)


def _by_line(
    t_s: FloatArray, light: FloatArray, sigma: FloatArray, level: float, level_sigma: float
) -> Measured | None:
    last_s, span_s = float(t_s[-1]), float(t_s[-1] - t_s[0])
    powers = np.stack([np.ones_like(t_s), (t_s - last_s) / span_s], axis=1)

    def residuals(line: FloatArray) -> tuple[FloatArray, FloatArray]:
        model = np.exp(powers @ line)
        return (model - light) / sigma, powers * (model / sigma)[:, None]

    start = [math.log(float(np.mean(np.maximum(light, 0)))), 0.0]
    fit = least_squares(residuals, start)
    above, fall = float(fit.parameters[0]) - math.log(level), -float(fit.parameters[1])
    if not fit.converged or not 0 < float(fit.sigma[1]) < UNCERTAIN_RATE * fall:
        return None
    after = above / fall
    slopes = np.array([1.0, after]) / fall
    misfit = max(1.0, fit.reduced_chi2) if fit.dof > 0 else 1.0
    variance = misfit * float(slopes @ fit.covariance @ slopes) + (level_sigma / fall) ** 2
    return Measured(last_s + span_s * after, span_s * math.sqrt(variance), "s")
