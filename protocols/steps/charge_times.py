"""Duration of the next charge: doubling until the glow stops growing, then most informative.

y(t) = a (1 − e^(−s t)) is the glow of one state just after a charge of duration t; for two states
it is accurate enough to choose durations by. The final fit uses another model.
"""

import math
from collections.abc import Sequence

import numpy as np

from labrig.foundation.arrays import FloatArray

#: Number of a patch's places that decide: the brightest, where noise does not matter.
BRIGHTEST = 6
#: Number of charge times that are compared.
CANDIDATES = 33


def still_grows(glows: FloatArray, growth: float) -> bool:
    """Return whether any patch glowed brighter after the last charge than after the one before.

    Parameters
    ----------
    glows
        Glow after each charge, in their order, shape (charges, patches, places).
    growth
        Fraction below which growth does not count.
    """
    previous, last = _bright(glows)[-2:].sum(axis=2)
    return bool((last > (1 + growth) * previous).any())


def most_informative_s(charge_durations_s: Sequence[float], glows: FloatArray) -> float:
    """Return the charge time, between the shortest and the longest, that adds most information.

    D-optimal for a and s of every bright place (Fedorov, *Theory of Optimal Experiments*, 1972):
    the determinant of the information grows most. σ is taken as a constant fraction of the glow.

    Parameters
    ----------
    charge_durations_s
        Durations of the charges so far in seconds, shape (charges,).
    glows
        Glow just after each charge, shape (charges, patches, places).
    """
    done_s, bright = np.asarray(charge_durations_s, dtype=np.float64), _bright(glows)
    candidates_s = np.geomspace(done_s.min(), done_s.max(), CANDIDATES)
    gain = np.zeros(CANDIDATES)
    for place in bright.reshape(len(done_s), -1).T:
        s = _rate(done_s, place)
        done_slopes = _slopes(done_s, s)
        information = done_slopes.T @ done_slopes
        for row, slope in enumerate(_slopes(candidates_s, s)):
            gain[row] += np.log(np.linalg.det(information + np.outer(slope, slope)))
    return float(candidates_s[np.argmax(gain)])


def fades_below_s(glows: FloatArray, pause_s: float, below: float) -> float:
    """Return the time until every patch is below a fraction of its brightest glow, in seconds.

    The glow goes on fading at the rate of the last two photographs; infinity if it does not fade.

    Parameters
    ----------
    glows
        Glow of the patches in the photographs after one charge, shape (photographs, patches).
    pause_s
        Time between the last two photographs in seconds.
    below
        Fraction of the brightest glow.
    """
    previous, last = glows[-2:]
    wanted = below * glows.max(axis=0)
    is_bright = last > wanted
    if not is_bright.any():
        return 0.0
    fading_per_s = np.log(previous[is_bright] / last[is_bright]) / pause_s
    if (fading_per_s <= 0).any():
        return math.inf
    return float((np.log(last[is_bright] / wanted[is_bright]) / fading_per_s).max())


def _bright(glows: FloatArray) -> FloatArray:
    """Return the glow of every patch's brightest places, shape (charges, patches, places)."""
    order = np.argsort(-glows[-1], axis=1, kind="stable")[:, :BRIGHTEST]
    return np.maximum(np.take_along_axis(glows, order[np.newaxis], axis=2), 1e-9)


def _rate(charge_durations_s: FloatArray, glow: FloatArray) -> float:
    """Return s, by least squares on the logarithms, which gives a in closed form."""

    def residuals(log_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        s = float(np.exp(log_s[0]))
        difference = np.log(-np.expm1(-s * charge_durations_s)) - np.log(glow)
        slope = _slopes(charge_durations_s, s)[:, 1:]
        return difference - difference.mean(), slope - slope.mean(axis=0)

    from labrig.fit import least_squares  # plans and lists of runs need no SciPy

    low, high = np.log(0.01 / charge_durations_s.max()), np.log(10 / charge_durations_s.min())
    fit = least_squares(residuals, [(low + high) / 2], lower=low, upper=high, tolerance=1e-6)
    return float(np.exp(fit.parameters[0]))


def _slopes(charge_durations_s: FloatArray, s: float) -> FloatArray:
    """Return the derivatives of ln y by ln a and ln s, shape (n, 2)."""
    x = s * charge_durations_s
    return np.column_stack([np.ones_like(x), x / np.expm1(x)])
