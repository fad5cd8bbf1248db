"""Luminance in the simulated room: its absolute scale, from the illuminance by its lamp."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from .lamp import BURNING_SPECTRUM, CELL_NM, WAVELENGTH_NM
from .optics import REFLECTED
from .simulation import LampSettings

FloatArray = NDArray[np.float64]

#: Luminous efficacy of light of 540 THz in lm/W (SI, since 2019), and mcd in a cd.
KM_LM_PER_W = 683.0
MCD = 1000.0


@cache
def _photopic() -> FloatArray:
    """Return V(λ) of CIE 1924 on `WAVELENGTH_NM`."""
    import colour  # takes seconds to load

    table = colour.SDS_LEFS["CIE 1924 Photopic Standard Observer"]
    return np.asarray(np.interp(WAVELENGTH_NM, table.wavelengths, table.values, left=0, right=0))


def luminance_mcd_per_m2(radiance: FloatArray, lamp: LampSettings) -> FloatArray:
    """Return the luminance of spectra (…, wavelengths) in the room's scale of radiance, (…).

    In that scale a white surface under the lamp has `REFLECTED` times the irradiance; its
    luminance is the illuminance over π.
    """
    seen = CELL_NM * KM_LM_PER_W * (radiance @ _photopic())
    white = CELL_NM * KM_LM_PER_W * float(BURNING_SPECTRUM @ _photopic())
    scale = lamp.illuminance / np.pi / (REFLECTED * lamp.irradiance * white)
    return np.asarray(MCD * scale * seen)
