"""For how long to charge next: until the glow stops growing, then where it tells most.

y(t) = a (1 − e^(−s t)) is what one state charged for t glows like just after lamp off; two states
are near enough to it to choose by, and the fit that matters is another one.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from labrig.fit import least_squares

FloatArray = NDArray[np.float64]

#: Places of a patch whose glow is chosen by: the brightest, where noise does not decide.
BRIGHTEST = 6
#: Charge times that are weighed against each other.
CANDIDATES = 33


def still_grows(glows: FloatArray, growth: float) -> bool:
    """Whether any patch glowed brighter after the last charge than after the one before.

    Parameters
    ----------
    glows
        (charges, patches, places), in the order of the charges.
    growth
        Less than this share is none.
    """
    before, last = _bright(glows)[-2:].sum(axis=2)
    return bool((last > (1 + growth) * before).any())


def most_informative_s(charges_s: Sequence[float], glows: FloatArray) -> float:
    """The charge time, among those between the shortest and the longest, that adds most.

    D-optimal for a and s of every bright place (Fedorov, *Theory of Optimal Experiments*, 1972):
    the determinant of the information grows most. σ is taken as a constant share of the glow.

    Parameters
    ----------
    charges_s
        (charges,) done so far.
    glows
        (charges, patches, places) just after each.
    """
    done_s, bright = np.asarray(charges_s, dtype=np.float64), _bright(glows)
    candidates_s = np.geomspace(done_s.min(), done_s.max(), CANDIDATES)
    gain = np.zeros(CANDIDATES)
    for place in bright.reshape(len(done_s), -1).T:
        s = _rate(done_s, place)
        known = _slopes(done_s, s)
        information = known.T @ known
        for row, slope in enumerate(_slopes(candidates_s, s)):
            gain[row] += np.log(np.linalg.det(information + np.outer(slope, slope)))
    return float(candidates_s[np.argmax(gain)])


def _bright(glows: FloatArray) -> FloatArray:
    """(charges, patches, places) of every patch's brightest places."""
    order = np.argsort(-glows[-1], axis=1, kind="stable")[:, :BRIGHTEST]
    return np.maximum(np.take_along_axis(glows, order[np.newaxis], axis=2), 1e-9)


def _rate(charges_s: FloatArray, glow: FloatArray) -> float:
    """s, by least squares on the logarithms, which gives a at once."""

    def residuals(log_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        s = float(np.exp(log_s[0]))
        left = np.log(-np.expm1(-s * charges_s)) - np.log(glow)
        slope = _slopes(charges_s, s)[:, 1:]
        return left - left.mean(), slope - slope.mean(axis=0)

    low, high = np.log(0.01 / charges_s.max()), np.log(10 / charges_s.min())
    found = least_squares(residuals, [(low + high) / 2], lower=low, upper=high, tolerance=1e-6)
    return float(np.exp(found.parameters[0]))


def _slopes(charges_s: FloatArray, s: float) -> FloatArray:
    """(n, 2) of ln y by ln a and ln s."""
    x = s * charges_s
    return np.column_stack([np.ones_like(x), x / np.expm1(x)])
