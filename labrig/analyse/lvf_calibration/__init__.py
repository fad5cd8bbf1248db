"""Calibration of a linear variable filter: strip, mercury lines, colour filters."""

from labrig.analyse.lvf_calibration.stage import process

__all__ = ["process"]
