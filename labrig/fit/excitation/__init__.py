"""Excitation rates, jointly with decays."""

from labrig.fit.excitation.fit import fit_excitation
from labrig.fit.excitation.parameters import Uncertain
from labrig.fit.excitation.result import ExcitationFit, ExcitedState, LevelAtOff
from labrig.fit.excitation.series import Charge, ChargingSeries, Transient

__all__ = [
    "Charge",
    "ChargingSeries",
    "ExcitationFit",
    "ExcitedState",
    "LevelAtOff",
    "Transient",
    "Uncertain",
    "fit_excitation",
]
