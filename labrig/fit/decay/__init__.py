"""Decay fits: rates and amplitudes of the states of a phosphor after lamp off."""

from labrig.fit.decay.diagnostics import Periodogram, periodogram
from labrig.fit.decay.fit import fit_decay
from labrig.fit.decay.result import DecayFit
from labrig.fit.decay.selection import F_TEST_LEVEL
from labrig.fit.decay.shared import DecayTable, fit_shared_rates
from labrig.fit.decay.states import APART_SIGMAS

__all__ = [
    "APART_SIGMAS",
    "F_TEST_LEVEL",
    "DecayFit",
    "DecayTable",
    "Periodogram",
    "fit_decay",
    "fit_shared_rates",
    "periodogram",
]
