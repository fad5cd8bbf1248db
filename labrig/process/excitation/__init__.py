"""Excitation rates, from a run to a material."""

from labrig.process.excitation.processing import process

__all__ = ["process"]
