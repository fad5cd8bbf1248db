"""From frames through the LVF to the emission spectrum Λ*, and its dependence on time and lamp."""

from labrig.analyse.emission_spectrum.analysis import analyse

__all__ = ["analyse"]
