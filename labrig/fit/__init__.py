"""Fits: the least-squares core, and decays, spectra, filters and excitation fitted with it."""

from labrig.fit.decay import DecayFit, fit_decay
from labrig.fit.least_squares import EPSILON, FloatArray, LeastSquaresFit, least_squares

__all__ = [
    "EPSILON",
    "DecayFit",
    "FloatArray",
    "LeastSquaresFit",
    "fit_decay",
    "least_squares",
]
