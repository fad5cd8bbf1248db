"""Readings of a decay as few values of ln L over ln t with their σ, and its slope there.

The reference that takes the fall out of the readings before they are averaged is a sum of
exponentials of fixed rates with amplitudes ≥ 0: it follows every decay of independent traps, and
has a slope everywhere.
"""

import math
from dataclasses import dataclass

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from labrig.foundation.nonnegative import nonnegative_least_squares

#: Most values, evenly spaced in ln t, and the fewest that a law is fitted to.
MOST_VALUES, FEWEST_VALUES = 32, 5
#: Rates of the reference: lowest in inverse last times, highest in inverse first times, number.
LOWEST_RATE, HIGHEST_RATE, N_RATES = 0.02, 8.0, 40
#: Least luminance of the reference, relative to its largest, and least slope −d ln L/d ln t.
LEAST_REFERENCE, LEAST_SLOPE = 1e-9, 0.05
#: Relative σ that the search for the scatter begins with, the least, and the number of its steps.
BEGIN_SCATTER, LEAST_SCATTER, SCATTER_STEPS = 0.02, 1e-5, 4
#: Parameters of a reference, which follow the readings.
REFERENCE_PARAMETERS = 4
#: Degrees of freedom of differences of neighbours per reading, and σ of their mean square from
#: which given σ are too small.
FREEDOM, TOO_SMALL_SIGMAS = 0.6, 2.0


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
        edges = np.linspace(x[0], x[-1], MOST_VALUES + 1)[1:-1]
        place = np.searchsorted(edges, x, side="right")
        # What falls below nothing has no logarithm.
        sums = np.bincount(place, weights * light / reference, MOST_VALUES)
        used = np.flatnonzero(sums > 0)
        if len(used) < FEWEST_VALUES:
            raise FitError(
                f"expected means above zero at {FEWEST_VALUES} times or more, got {len(used)}"
            )
        totals = np.bincount(place, weights, MOST_VALUES)[used]

        def mean(values: FloatArray) -> FloatArray:
            return np.asarray(np.bincount(place, weights * values, MOST_VALUES)[used] / totals)

        return cls(
            mean(x),
            np.log(sums[used] / totals) + mean(np.log(reference)),
            1 / np.sqrt(totals),
            np.maximum(mean(slope), LEAST_SLOPE),
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
        relative = max(float(variances[0]), LEAST_SCATTER**2)
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
    value = np.maximum(value, LEAST_REFERENCE * float(value.max()))
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
    spread = math.sqrt(2 / (FREEDOM * len(difference)))
    return math.sqrt(ratio) if ratio > 1 + TOO_SMALL_SIGMAS * spread else 1.0
