"""Decay fits: rates and amplitudes of the states of a phosphor after lamp off."""

from labrig.fit.decay.fit import fit_decay
from labrig.fit.decay.result import DecayFit, DecayState
from labrig.fit.decay.rivals import Rival
from labrig.fit.decay.selection import Candidate

__all__ = ["Candidate", "DecayFit", "DecayState", "Rival", "fit_decay"]
