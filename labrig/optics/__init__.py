"""Spectra and the optical elements between light and camera signal."""

from labrig.optics.absolute_irradiance import absolute_irradiance
from labrig.optics.camera import (
    CHANNELS,
    CURVES_FILE,
    CameraResponse,
    read_camera,
    read_checked_curves,
    read_monochrome_camera,
)
from labrig.optics.camera_model import (
    CameraModel,
    Factor,
    Flat,
    Glare,
    f_number_text,
    rho_squared,
)
from labrig.optics.chart import CHART_PATCHES, read_colour_chart
from labrig.optics.colorimetry import (
    CIE_1931,
    CIE_2015,
    Observer,
    delta_e,
    illuminant,
    lab,
    observer,
    white_xyz,
)
from labrig.optics.curve_file import (
    Curve,
    CurveFile,
    read_curve_file,
    read_spectrum,
    read_transmittance,
)
from labrig.optics.foreign_spectra import foreign_spectra
from labrig.optics.hyperspectral import HyperspectralCube, read_hyperspectral_cube
from labrig.optics.lights import is_narrow, read_light
from labrig.optics.lvf import (
    NOMINAL_FWHM_NM,
    Bands,
    Lvf,
    WavelengthMap,
    nominal_lvf,
    peak_shape,
    signal_through,
)
from labrig.optics.ordinate import Quantity
from labrig.optics.photometry import (
    mesopic_adaptation,
    mesopic_ratio,
    photopic_efficacy,
    scotopic_efficacy,
)
from labrig.optics.piecewise import (
    band_integrals,
    band_means,
    edges_from_centres,
    hat_functions,
    quadrature,
)
from labrig.optics.shipped_cameras import ShippedCamera, shipped_camera, shipped_cameras
from labrig.optics.spectrometer import (
    MeasuredSpectrum,
    SpectrometerReading,
    lamp_calibration,
    read_spectrometer_reading,
)
from labrig.optics.spectrum import Spectrum, Transmittance
from labrig.optics.srgb import XYZ_TO_SRGB, srgb_bytes
from labrig.optics.strip import SLICES, Strip

__all__ = [
    "CHANNELS",
    "CHART_PATCHES",
    "CIE_1931",
    "CIE_2015",
    "CURVES_FILE",
    "NOMINAL_FWHM_NM",
    "SLICES",
    "XYZ_TO_SRGB",
    "Bands",
    "CameraModel",
    "CameraResponse",
    "Curve",
    "CurveFile",
    "Factor",
    "Flat",
    "Glare",
    "HyperspectralCube",
    "Lvf",
    "MeasuredSpectrum",
    "Observer",
    "Quantity",
    "ShippedCamera",
    "SpectrometerReading",
    "Spectrum",
    "Strip",
    "Transmittance",
    "WavelengthMap",
    "absolute_irradiance",
    "band_integrals",
    "band_means",
    "delta_e",
    "edges_from_centres",
    "f_number_text",
    "foreign_spectra",
    "hat_functions",
    "illuminant",
    "is_narrow",
    "lab",
    "lamp_calibration",
    "mesopic_adaptation",
    "mesopic_ratio",
    "nominal_lvf",
    "observer",
    "peak_shape",
    "photopic_efficacy",
    "quadrature",
    "read_camera",
    "read_checked_curves",
    "read_colour_chart",
    "read_curve_file",
    "read_hyperspectral_cube",
    "read_light",
    "read_monochrome_camera",
    "read_spectrometer_reading",
    "read_spectrum",
    "read_transmittance",
    "rho_squared",
    "scotopic_efficacy",
    "shipped_camera",
    "shipped_cameras",
    "signal_through",
    "srgb_bytes",
    "white_xyz",
]
