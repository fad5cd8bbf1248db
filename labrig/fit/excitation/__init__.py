"""Excitation rates, fitted jointly with decays."""

from labrig.fit.excitation.charging import Charging, closure
from labrig.fit.excitation.course import ExcitationCourse, excitation_course
from labrig.fit.excitation.fit import fit_excitation
from labrig.fit.excitation.intervals import IntervalChoice
from labrig.fit.excitation.layer import layer_effect
from labrig.fit.excitation.levels import levels_at_off
from labrig.fit.excitation.parameters import RelativeSigmas

__all__ = [
    "Charging",
    "ExcitationCourse",
    "IntervalChoice",
    "RelativeSigmas",
    "closure",
    "excitation_course",
    "fit_excitation",
    "layer_effect",
    "levels_at_off",
]
