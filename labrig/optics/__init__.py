"""Spectra and the optical elements between light and camera signal."""

from labrig.optics.camera import (
    CHANNELS,
    CameraResponse,
    read_camera,
    read_monochrome_camera,
    read_sound_curves,
)
from labrig.optics.camera_model import (
    CameraModel,
    Factor,
    Flat,
    rho_squared,
    stop_text,
)
from labrig.optics.curve_file import (
    Curve,
    CurveFile,
    read_curve_file,
    read_spectrum,
    read_transmittance,
)
from labrig.optics.lvf import (
    NOMINAL_FWHM_NM,
    Bands,
    Lvf,
    WavelengthMap,
    nominal_lvf,
    peak_shape,
    seen_through,
)
from labrig.optics.piecewise import band_integrals, band_means, edges_about, hats, quadrature
from labrig.optics.spectrum import Spectrum, Transmittance
from labrig.optics.strip import SLICES, Strip

__all__ = [
    "CHANNELS",
    "NOMINAL_FWHM_NM",
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
    "band_integrals",
    "band_means",
    "edges_about",
    "hats",
    "nominal_lvf",
    "peak_shape",
    "quadrature",
    "read_camera",
    "read_curve_file",
    "read_monochrome_camera",
    "read_sound_curves",
    "read_spectrum",
    "read_transmittance",
    "rho_squared",
    "seen_through",
    "stop_text",
]
