"""Decay fits: rates and amplitudes of the states of a phosphor after lamp off."""

from labrig.fit.decay.fit import fit_decay
from labrig.fit.decay.power_law import PowerLaw
from labrig.fit.decay.result import DecayFit, DecayState
from labrig.fit.decay.selection import Candidate

__all__ = ["Candidate", "DecayFit", "DecayState", "PowerLaw", "fit_decay"]
