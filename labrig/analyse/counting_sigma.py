"""σ that a table computed from its own values, such as √N, and σ that follows the fitted curve.

A value that is low by chance then has a small σ and weighs too much: fits come out low, and rates
high. Of counts around 100 the mean pull of a rate is 1 σ. The variance has to be that of the
expected value, which the fit knows.
"""

from dataclasses import dataclass

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.nonnegative import nonnegative_least_squares

#: Fewest values that tell how σ follows from them.
FEWEST = 6
#: Relative deviation that still is rounding, and the most decimals of σ that are looked at.
ROUNDING, MOST_DECIMALS = 1e-4, 6
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
    for decimals in range(MOST_DECIMALS):
        scaled = numbers * 10.0**decimals
        if np.allclose(scaled, np.round(scaled), rtol=0.0, atol=1e-6):
            return float(10.0**-decimals)
    return 0.0
