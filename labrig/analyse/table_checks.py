"""Doubts about another program's table: its σ, and first values of a saturated detector.

A table may compute σ from its own values, such as √N. A value that is low by chance then has a
small σ and weighs too much: fits come out low, and rates high. Of counts around 100 the mean pull
of a rate is 1 σ. The variance has to be that of the expected value, which the fit knows.

A decay that is a sum of positive exponentials falls ever more slowly, and the law of its later
values never overestimates its first ones by more than noise. Where it does, they are too low. That
the detector was at its ceiling is certain if several of them are equal.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from labrig.fit import DecayFit
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from labrig.foundation.nonnegative import nonnegative_least_squares
from labrig.results import Series

#: Largest number of first values that are left out to see whether they are too low.
MAX_LEFT_OUT = 3
#: Fewest values that have to remain.
MIN_LEFT = 8
#: Distance below the law of the others from which a value is too low, in σ; of values that are
#: equal, which is evidence, too.
LOW_SIGMAS, LOW_SIGMAS_IF_EQUAL = 4.5, 1.5
#: Residuals over the value below which they are those of numbers' last digits.
EXACT_SCATTER = 1e-6
#: Largest chance of noise to make values equal after rounding.
EQUAL_CHANCE = 0.02


@dataclass(frozen=True)
class LowStart:
    """First values that lie below the law of the others.

    Attributes
    ----------
    number
        How many.
    sigmas
        How far the first one lies below.
    is_ceiling
        Whether they are equal and the largest ones, at the ceiling of a detector.
    """

    number: int
    sigmas: float
    is_ceiling: bool


def low_start(series: Series, fit: Callable[[Series], DecayFit]) -> LowStart | None:
    """Return which first values of a series of one channel are too low; None if none are.

    Parameters
    ----------
    series
        Series of one decay.
    fit
        Fit of a series.
    """
    if len(series.channels) > 1 or len(set(series.unit)) > 1:
        return None
    rows = np.flatnonzero(series.usable)
    rows = rows[np.argsort(series.t_s[rows], kind="stable")]
    ceiling = _equal_maxima(series.values[rows, 0])
    if len(rows) - ceiling >= MIN_LEFT and ceiling > 1:
        sigmas = _sigmas_below(series, rows, ceiling, fit)
        if sigmas > LOW_SIGMAS_IF_EQUAL:
            return LowStart(ceiling, sigmas, is_ceiling=True)
    numbers = range(1, min(MAX_LEFT_OUT, len(rows) - MIN_LEFT) + 1)
    below = [_sigmas_below(series, rows, number, fit) for number in numbers]
    if not below or max(below) < LOW_SIGMAS:
        return None
    return LowStart(int(np.argmax(below)) + 1, max(below), is_ceiling=False)


def _equal_maxima(values: FloatArray) -> int:
    """Return how many first values (n,) are equal and the largest; 1 if that may be chance."""
    number = int(np.argmin(np.append(values == values[0], False)))
    others = values[number:]
    if number < 2 or len(others) < MIN_LEFT or others.max() >= values[0]:
        return 1
    steps = np.diff(np.unique(values))
    second = others[2:] - 2 * others[1:-1] + others[:-2]
    scatter = 1.4826 * float(np.median(np.abs(second[:MIN_LEFT]))) / np.sqrt(6)
    equal = float(steps.min()) / max(2 * np.sqrt(np.pi) * scatter, np.finfo(float).tiny)
    return number if min(equal, 1.0) ** (number - 1) < EQUAL_CHANCE else 1


def _sigmas_below(
    series: Series, rows: NDArray[np.intp], number: int, fit: Callable[[Series], DecayFit]
) -> float:
    """Return by how many σ the first value lies below the law of those after `number` ones."""
    try:
        law = fit(series.take(rows[number:]))
    except FitError:
        return 0.0
    first = rows[:1]
    expected, variance = law.signal(series.t_s[first], series.exposure_s[first], with_offset=True)
    signal = float(expected[0])
    own = float(series.sigma[first[0], 0])
    if law.scatter is not None:
        scatter = law.scatter
        if scatter.is_of_residuals and scatter.constant < EXACT_SCATTER * signal:
            return 0.0
        own = np.sqrt(
            scatter.constant**2 + scatter.counting * signal + (scatter.proportional * signal) ** 2
        )
    total = variance[0] + (own * law.sigma_factor) ** 2 + (law.flicker * signal) ** 2
    return float((signal - series.values[first[0], 0]) / np.sqrt(total))


#: Fewest values that tell how σ follows from them.
FEWEST = 6
#: Relative deviation that still is rounding, and the most decimals of σ that are looked at.
ROUNDING, MAX_DECIMALS = 1e-4, 6
#: Range of σ in units of their rounding that tells a dependence from chance.
RANGE_OF_ROUNDING = 6.0
#: Least counts in a variance, since fewer would weigh a point too much.
MIN_COUNTS = 5.0


@dataclass(frozen=True)
class VarianceOfValue:
    """Variance of a value y: constant + counting · y + proportional · y².

    Attributes
    ----------
    constant, counting, proportional
        Coefficients; `counting` is the value of one count.
    least
        Least value at which it is taken.
    """

    constant: float
    counting: float
    proportional: float
    least: float

    def sigma(self, expected: FloatArray) -> FloatArray:
        """Return the σ (n,) of values whose expectation is given (n,)."""
        level = np.maximum(expected, self.least)
        return np.asarray(
            np.sqrt(self.constant + self.counting * level + self.proportional * level**2)
        )

    def __str__(self) -> str:
        """Return the formula."""
        parts = [
            f"{coefficient:.3g}{times}"
            for coefficient, times in (
                (self.constant, ""),
                (self.counting, " · value"),
                (self.proportional, " · value²"),
            )
            if coefficient
        ]
        return f"σ² = {' + '.join(parts)}"


#: Coefficients that may be above zero, fewer first.
_SUBSETS = ([1], [2], [0, 1], [0, 2], [1, 2], [0, 1, 2])
#: Poisson counts.
COUNTS = VarianceOfValue(0.0, 1.0, 0.0, MIN_COUNTS)


def variance_of_values(values: FloatArray, sigma: FloatArray) -> VarianceOfValue | None:
    """Return how σ follows from the values, to rounding; None if it does not.

    A σ that never falls below a least one, such as that of no count, may do so besides.

    Parameters
    ----------
    values, sigma
        Values and their σ, shape (n,).
    """
    if not (np.isfinite(sigma).all() and (sigma > 0).all()):
        return None
    above = sigma > sigma.min()
    rounding = np.maximum(_last_digit(sigma) / 2, ROUNDING * sigma)
    if above.sum() < FEWEST or np.ptp(sigma[above]) < RANGE_OF_ROUNDING * rounding.max():
        return None
    # Coefficients that were fitted to rounded σ are a little off, too.
    tolerance = 1.5 * rounding
    kinds = np.stack([np.ones_like(values), values, values**2], axis=1)
    for used in _SUBSETS:
        coefficients = np.zeros(3)
        weights = 1 / (sigma * rounding)[above]
        coefficients[used] = nonnegative_least_squares(
            kinds[above][:, used] * weights[:, None], sigma[above] ** 2 * weights
        )
        off = np.sqrt(np.maximum(kinds @ coefficients, 0.0)) - sigma
        if (np.abs(off[above]) <= tolerance[above]).all() and (off <= tolerance).all():
            break
    else:
        return None
    constant, counting, proportional = coefficients.tolist()
    least = MIN_COUNTS * counting if counting else max(float(values.min()), 0.0)
    return VarianceOfValue(constant, counting, proportional, least)


def _last_digit(numbers: FloatArray) -> float:
    """Return the power of ten of which all numbers are multiples; 0 if there is none."""
    for decimals in range(MAX_DECIMALS):
        scaled = numbers * 10.0**decimals
        if np.allclose(scaled, np.round(scaled), rtol=0.0, atol=1e-6):
            return float(10.0**-decimals)
    return 0.0
