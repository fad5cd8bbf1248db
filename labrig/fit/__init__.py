"""Fits: the least-squares core; decays, spectra, filters, excitation, mixtures fitted with it."""

from labrig.fit.decay import DecayFit, fit_decay
from labrig.fit.least_squares import EPSILON, FloatArray, LeastSquaresFit, least_squares
from labrig.fit.mixture import (
    HeldOutError,
    MixtureCandidate,
    MixtureFit,
    MixtureTexture,
    fit_mixture,
    fit_mixture_texture,
)

__all__ = [
    "EPSILON",
    "DecayFit",
    "FloatArray",
    "HeldOutError",
    "LeastSquaresFit",
    "MixtureCandidate",
    "MixtureFit",
    "MixtureTexture",
    "fit_decay",
    "fit_mixture",
    "fit_mixture_texture",
    "least_squares",
]
