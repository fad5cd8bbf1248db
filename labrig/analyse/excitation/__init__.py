"""Excitation rates, from a run to a material."""

from labrig.analyse.excitation.processing import process

__all__ = ["process"]
