"""The monochromator before the lamp: a band rounder than a triangle, and some stray light."""

import numpy as np

from labrig.foundation.arrays import FloatArray

from .bench_settings import MonochromatorSettings
from .lamp import WAVELENGTH_NM

#: Blaze of the grating and width of its efficiency in nm.
BLAZE_NM, BLAZE_WIDTH_NM = 480.0, 260.0
#: Equal slits give a triangle; lens errors round it by a normal curve of this part of its width.
ROUNDED = 0.18


def passed_by(settings: MonochromatorSettings, wavelength_nm: float) -> FloatArray:
    """Return the transmittance where the monochromator is tuned to, shape (wavelengths,)."""
    centre_nm = wavelength_nm + settings.off_nm
    spread_nm = ROUNDED * settings.fwhm * np.linspace(-3, 3, 25)
    weight = np.exp(-((spread_nm / (ROUNDED * settings.fwhm)) ** 2) / 2)
    away = np.abs(WAVELENGTH_NM - centre_nm - spread_nm[:, None]) / settings.fwhm
    band = weight @ np.clip(1 - away, 0.0, None) / weight.sum()
    blaze = np.exp(-(((WAVELENGTH_NM - BLAZE_NM) / BLAZE_WIDTH_NM) ** 2))
    passed: FloatArray = settings.level * blaze * (band + settings.stray)
    return passed
