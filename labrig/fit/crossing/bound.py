"""Earliest time at which a decay falls to a level, by its convexity and no law.

ln L is convex in t for every sum of decaying exponentials with amplitudes ≥ 0 (by the inequality of
Cauchy and Schwarz), among which are Becquerel's law and stretched exponentials of β ≤ 1, and for
one trap with retrapping. It then lies above its tangents: with the rate k = −d ln L/dt at the end T

    T* ≥ T + ln(L(T)/L*)/k.

A line through the last readings lies below ln L at the end and is as steep or steeper, so that its
bound is earlier. A light that is cut off more sharply than by an exponential is no such sum: that
of a sample that cools, of a stretched exponential of β > 1, or of a lamp that runs empty. Its rate
grows with time, which is looked for.
"""

import math
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from labrig.fit.least_squares import least_squares
from labrig.foundation.arrays import FloatArray
from labrig.results import NORMAL_95, Measured

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
