"""Spectra from pictures through a variable filter, or from any sensor with known channels."""

from labrig.fit.spectrum.fit import (
    BandedSpectrum,
    SpectrumFit,
    fit_spectrum,
)
from labrig.fit.spectrum.line import LineFit, fit_line
from labrig.fit.spectrum.lines import DECISIVE
from labrig.fit.spectrum.system import (
    CurveError,
    SpectralSystem,
    camera_modes,
    curve_modes,
    nonnegative_minimum,
    smooth_modes,
    system_through_lvf,
)

__all__ = [
    "DECISIVE",
    "BandedSpectrum",
    "CurveError",
    "LineFit",
    "SpectralSystem",
    "SpectrumFit",
    "camera_modes",
    "curve_modes",
    "fit_line",
    "fit_spectrum",
    "nonnegative_minimum",
    "smooth_modes",
    "system_through_lvf",
]
