"""Spectra and what light passes on its way to a number."""

from labrig.optics.band import Bands
from labrig.optics.camera import CameraResponse, read_camera, read_monochrome_camera
from labrig.optics.camera_model import CameraModel, Factor, Flat, rho_squared
from labrig.optics.curve_file import (
    Curve,
    CurveFile,
    read_curve_file,
    read_spectrum,
    read_transmittance,
)
from labrig.optics.lvf import Lvf, nominal_lvf, seen_through
from labrig.optics.spectrum import Spectrum, Transmittance
from labrig.optics.strip import SLICES, Strip
from labrig.optics.wavelength_map import WavelengthMap

__all__ = [
    "SLICES",
    "Bands",
    "CameraModel",
    "CameraResponse",
    "Curve",
    "CurveFile",
    "Factor",
    "Flat",
    "Lvf",
    "Spectrum",
    "Strip",
    "Transmittance",
    "WavelengthMap",
    "nominal_lvf",
    "read_camera",
    "read_curve_file",
    "read_monochrome_camera",
    "read_spectrum",
    "read_transmittance",
    "rho_squared",
    "seen_through",
]
