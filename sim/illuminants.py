"""Broadband lamps beside the LEDs, each on its relay: what they truly send out.

Real lamps are not the curves that a rig file names: a halogen lamp burns cooler, a xenon arc has
its lines, a daylight simulator is a filtered filament, a black light leaks mercury's violet.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from labrig.foundation.arrays import FloatArray

from .bench_settings import IlluminantSettings
from .lamp import BURNING_LIGHT, C2_NM_K, WAVELENGTH_NM, filament_spectrum
from .leds import Leds, led_shape

#: Lines of the xenon arc: wavelength in nm, height over the continuum, width (1 σ) in nm.
XENON_LINES = (
    (450.1, 0.08, 2.5), (462.4, 0.12, 2.5), (467.1, 0.32, 3.0), (473.4, 0.14, 2.5),
    (480.7, 0.10, 2.5), (492.3, 0.08, 3.0), (617.8, 0.04, 4.0), (647.3, 0.05, 4.0),
)  # fmt: skip
#: Temperature of its continuum in K, and edges in nm of the projector's filters with their widths.
XENON_K, XENON_ULTRAVIOLET_NM, XENON_INFRARED_NM = 5600.0, (405.0, 12.0), (682.0, 8.0)
#: A daylight simulator: temperature in K, and the ultraviolet that its glass takes away.
DAYLIGHT_K, DAYLIGHT_ULTRAVIOLET_NM = 6350.0, (360.0, 15.0)
#: A black light: width at half maximum in nm, and mercury's lines through its glass.
BLACK_LIGHT_LINES = ((404.7, 0.02, 1.5), (435.8, 0.008, 1.5))


@dataclass(frozen=True)
class Illuminants(Leds):
    """The bank of lamps with its history, as that of LEDs; warm lamps give more light, not less.

    Attributes
    ----------
    lamps
        Settings of the lamps.
    filters
        Transmittance of the filter before each lamp, shape (lamps, wavelengths).
    """

    lamps: tuple[IlluminantSettings, ...] = ()
    filters: tuple[FloatArray, ...] = ()

    @cached_property
    def members(self) -> Sequence[IlluminantSettings]:
        """Settings of the lamps."""
        return self.lamps

    @cached_property
    def spectra(self) -> dict[int, tuple[FloatArray, FloatArray]]:
        """Light of each lamp when cold and when warm."""
        warm = {
            lamp.relay: self.passed * passed * illuminant_spectrum(lamp)
            for lamp, passed in zip(self.lamps, self.filters, strict=True)
        }
        return {
            lamp.relay: ((1 - lamp.warm_up_deficit) * warm[lamp.relay], warm[lamp.relay])
            for lamp in self.lamps
        }


def illuminant_spectrum(lamp: IlluminantSettings) -> FloatArray:
    """Return a warm lamp's irradiance without filter, relative as a `Lamp`'s, (wavelengths,)."""
    match lamp.kind:
        case "halogen":
            shape = filament_spectrum(lamp.temperature)
        case "xenon":
            shape = _planck(XENON_K)
            shape = shape * (1 + _lines(XENON_LINES))
            shape *= _edge(*XENON_ULTRAVIOLET_NM) * (1 - _edge(*XENON_INFRARED_NM))
        case "daylight":
            shape = _planck(DAYLIGHT_K) * _edge(*DAYLIGHT_ULTRAVIOLET_NM)
        case "ultraviolet":
            shape = led_shape(lamp.centre, lamp.fwhm, 1.2) + _lines(BLACK_LIGHT_LINES)
    spectrum: FloatArray = lamp.level * BURNING_LIGHT / shape.sum() * shape
    return spectrum


def _planck(temperature_k: float) -> FloatArray:
    """Return a black body's spectrum, 1 at 560 nm."""
    shape = 1 / (WAVELENGTH_NM**5 * np.expm1(C2_NM_K / (WAVELENGTH_NM * temperature_k)))
    return np.asarray(shape / np.interp(560.0, WAVELENGTH_NM, shape))


def _edge(at_nm: float, width_nm: float) -> FloatArray:
    """Return a step from 0 to 1."""
    return np.asarray(1 / (1 + np.exp(-(WAVELENGTH_NM - at_nm) / width_nm)))


def _lines(lines: Sequence[tuple[float, float, float]]) -> FloatArray:
    peaks = [
        height * np.exp(-(((WAVELENGTH_NM - at_nm) / sigma_nm) ** 2) / 2)
        for at_nm, height, sigma_nm in lines
    ]
    return np.asarray(np.sum(peaks, axis=0))
