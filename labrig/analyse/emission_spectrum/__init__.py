"""From frames through the LVF to Λ*, constant in time and for every lamp or not."""

from labrig.analyse.emission_spectrum.analysis import analyse

__all__ = ["analyse"]
