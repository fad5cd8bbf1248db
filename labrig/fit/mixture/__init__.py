"""Mixtures of normal densities that stand for re-radiation matrices."""

from labrig.fit.mixture.fit import fit_mixture
from labrig.fit.mixture.result import HeldOutError, LightKept, MixtureCandidate, MixtureFit
from labrig.fit.mixture.texture import MixtureTexture, fit_mixture_texture

__all__ = [
    "HeldOutError",
    "LightKept",
    "MixtureCandidate",
    "MixtureFit",
    "MixtureTexture",
    "fit_mixture",
    "fit_mixture_texture",
]
