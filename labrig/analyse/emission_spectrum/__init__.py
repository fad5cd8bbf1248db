"""Processing of `emission_spectrum`: Λ* through the LVF, constant in time and for every lamp."""

from labrig.analyse.emission_file import (
    EmissionSpectrum,
    read_emission_spectrum,
    write_emission_spectrum,
)
from labrig.analyse.emission_spectrum.process import process

__all__ = ["EmissionSpectrum", "process", "read_emission_spectrum", "write_emission_spectrum"]
