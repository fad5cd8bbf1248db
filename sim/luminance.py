"""Luminance in the simulated room: its absolute scale, from the illuminance by its lamp."""

import numpy as np
from scipy.interpolate import PchipInterpolator

from labrig.foundation.arrays import FloatArray

from .lamp import BURNING_SPECTRUM, CELL_NM, WAVELENGTH_NM
from .optics import REFLECTED
from .simulation import LampSettings

#: Luminous efficacy of light of 540 THz in lm/W (SI, since 2019), and mcd in a cd.
KM_LM_PER_W = 683.0
MCD = 1000.0


#: V(λ) of CIE 1924 from 380 nm to 780 nm in steps of 10 nm.
STEPS_NM: FloatArray = np.arange(380.0, 781.0, 10.0)
STEPS = (
    3.9e-05, 0.00012, 0.000396, 0.00121, 0.004, 0.0116, 0.023, 0.038,
    0.06, 0.09098, 0.13902, 0.20802, 0.323, 0.503, 0.71, 0.862,
    0.954, 0.99495, 0.995, 0.952, 0.87, 0.757, 0.631, 0.503,
    0.381, 0.265, 0.175, 0.107, 0.061, 0.032, 0.017, 0.00821,
    0.004102, 0.002091, 0.001047, 0.00052, 0.0002492, 0.00012, 6e-05, 3e-05,
    1.499e-05,
)  # fmt: skip
PHOTOPIC: FloatArray = np.nan_to_num(
    PchipInterpolator(STEPS_NM, STEPS, extrapolate=False)(WAVELENGTH_NM)
)


def luminance_mcd_per_m2(radiance: FloatArray, lamp: LampSettings) -> FloatArray:
    """Return the luminance of spectra (…, wavelengths) in the room's scale of radiance, (…).

    In that scale a white surface under the lamp has `REFLECTED` times the irradiance; its
    luminance is the illuminance over π.
    """
    seen = CELL_NM * KM_LM_PER_W * (radiance @ PHOTOPIC)
    white = CELL_NM * KM_LM_PER_W * float(BURNING_SPECTRUM @ PHOTOPIC)
    scale = lamp.illuminance / np.pi / (REFLECTED * lamp.irradiance * white)
    return np.asarray(MCD * scale * seen)
