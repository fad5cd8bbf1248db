"""Fits: the least-squares core, and what is measured with it."""

from labrig.fit.decay import Candidate, DecayFit, DecayState, Rival, fit_decay
from labrig.fit.least_squares import LeastSquaresFit, least_squares
from labrig.fit.nonnegative import nonnegative_least_squares

__all__ = [
    "Candidate",
    "DecayFit",
    "DecayState",
    "LeastSquaresFit",
    "Rival",
    "fit_decay",
    "least_squares",
    "nonnegative_least_squares",
]
