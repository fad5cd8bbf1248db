"""From frames of a strip to a calibrated variable filter: place, mercury lines, colour filters."""

from labrig.analyse.lvf_calibration.analysis import analyse

__all__ = ["analyse"]
