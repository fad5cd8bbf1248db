"""First values of a decay that lie below its law, as those of a saturated detector do.

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
from labrig.results import Series

#: Largest number of first values that are left out to see whether they are too low.
MOST_LEFT_OUT = 3
#: Fewest values that have to remain.
FEWEST_LEFT = 8
#: Distance below the law of the others from which a value is too low, in σ; of values that are
#: equal, which is evidence, too.
LOW_SIGMAS, LOW_SIGMAS_IF_EQUAL = 4.5, 1.5
#: Residuals over the value below which they are those of numbers' last digits.
ROUNDING = 1e-6
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
    if len(rows) - ceiling >= FEWEST_LEFT and ceiling > 1:
        sigmas = _sigmas_below(series, rows, ceiling, fit)
        if sigmas > LOW_SIGMAS_IF_EQUAL:
            return LowStart(ceiling, sigmas, is_ceiling=True)
    numbers = range(1, min(MOST_LEFT_OUT, len(rows) - FEWEST_LEFT) + 1)
    below = [_sigmas_below(series, rows, number, fit) for number in numbers]
    if not below or max(below) < LOW_SIGMAS:
        return None
    return LowStart(int(np.argmax(below)) + 1, max(below), is_ceiling=False)


def _equal_maxima(values: FloatArray) -> int:
    """Return how many first values (n,) are equal and the largest; 1 if that may be chance."""
    number = int(np.argmin(np.append(values == values[0], False)))
    others = values[number:]
    if number < 2 or len(others) < FEWEST_LEFT or others.max() >= values[0]:
        return 1
    steps = np.diff(np.unique(values))
    second = others[2:] - 2 * others[1:-1] + others[:-2]
    scatter = 1.4826 * float(np.median(np.abs(second[:FEWEST_LEFT]))) / np.sqrt(6)
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
        if scatter.is_of_residuals and scatter.constant < ROUNDING * signal:
            return 0.0
        own = np.sqrt(
            scatter.constant**2 + scatter.counting * signal + (scatter.proportional * signal) ** 2
        )
    total = variance[0] + (own * law.sigma_factor) ** 2 + (law.flicker * signal) ** 2
    return float((signal - series.values[first[0], 0]) / np.sqrt(total))
