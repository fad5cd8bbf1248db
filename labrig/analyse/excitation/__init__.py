"""Excitation rates, from the frames of a run to a material of each patch."""

from labrig.analyse.excitation.analysis import analyse

__all__ = ["analyse"]
