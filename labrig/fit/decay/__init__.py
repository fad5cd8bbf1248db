"""Decay fits: rates and amplitudes of the states of a phosphor after lamp off."""

from labrig.fit.decay.fit import fit_decay
from labrig.fit.decay.result import DecayFit

__all__ = ["DecayFit", "fit_decay"]
