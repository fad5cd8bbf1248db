"""From decays after several charges: is r(0) = 1, and do rates depend on the charge."""

from labrig.analyse.saturation.analysis import analyse

__all__ = ["analyse"]
