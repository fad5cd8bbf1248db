"""The lamps that the relay may feed, behind the colour filter before them, and LEDs beside it.

Real lamps are not the curves that a rig file names: a halogen lamp burns cooler, a xenon arc has
its lines, a daylight simulator is a filtered filament, a black light leaks mercury's violet.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from labrig.foundation.arrays import FloatArray

from .bench_settings import IlluminantSettings
from .lamp import BURNING_LIGHT, C2_NM_K, WAVELENGTH_NM, Lamp, Mercury, filament_spectrum
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


@dataclass(frozen=True)
class FilteredLamps:
    """Light of the lamps with its history, in place of a `Lamp`.

    Attributes
    ----------
    halogen, mercury
        Lamps, of which one is fed at a time; a filament still fades after it was switched off.
    filters
        Begin in seconds and transmittance (wavelengths,) of each filter; the first from 0 on.
    leds
        LEDs, whose light does not pass the filter.
    illuminants
        Broadband lamps with filters of their own.
    """

    halogen: Lamp
    mercury: Mercury
    filters: tuple[tuple[float, FloatArray], ...]
    leds: Leds = field(default_factory=Leds)
    illuminants: Illuminants = field(default_factory=Illuminants)

    def until(self, time_s: float) -> "FilteredLamps":
        """Return the lamps without switches after `time_s`."""
        return replace(
            self,
            halogen=self.halogen.until(time_s),
            mercury=self.mercury.until(time_s),
            leds=self.leds.until(time_s),
            illuminants=self.illuminants.until(time_s),
        )

    def last_switch_off(self, time_s: float) -> float | None:
        """Return the time at which a lamp was last switched off, up to and including `time_s`."""
        off = [light.last_switch_off(time_s) for light in self._lights]
        return max((off_s for off_s in off if off_s is not None), default=None)

    def corners(self, start_s: float, end_s: float) -> list[float]:
        """Return the times strictly between at which the light is not smooth."""
        changes = {since_s for since_s, _ in self.filters if start_s < since_s < end_s}
        changes.update(self.halogen.corners(start_s, end_s), self.mercury.corners(start_s, end_s))
        for bank in self._banks:
            changes.update(bank.corners(start_s, end_s))
        return sorted(changes)

    def dark(self, start_s: float, end_s: float) -> bool:
        """Return whether there is no light at all from `start_s` to `end_s`."""
        return all(light.dark(start_s, end_s) for light in self._lights)

    def irradiance(self, time_s: float | FloatArray) -> FloatArray:
        """Return the relative spectral irradiance at the sample, shape (..., wavelengths)."""
        light = self.halogen.irradiance(time_s)
        if self.mercury.was_on:
            light = light + self.mercury.irradiance(time_s)
        light = light * self._passed(time_s)
        for bank in self._banks:
            light = light + bank.irradiance(time_s)
        return light

    def exposure(self, start_s: float, end_s: float) -> FloatArray:
        """Return ∫ irradiance dt over an interval, shape (wavelengths,)."""
        changes = [since_s for since_s, _ in self.filters if start_s < since_s < end_s]
        total = np.zeros_like(self.filters[0][1])
        for begin_s, stop_s in pairwise([start_s, *changes, end_s]):
            light = self.halogen.exposure(begin_s, stop_s)
            if self.mercury.was_on:
                light = light + self.mercury.exposure(begin_s, stop_s)
            total += light * self._passed(begin_s)
        for bank in self._banks:
            total = total + bank.exposure(start_s, end_s)
        return total

    @property
    def _banks(self) -> tuple[Leds, ...]:
        """Banks of which a light has ever been lit."""
        return tuple(bank for bank in (self.leds, self.illuminants) if bank.were_lit)

    @property
    def _lights(self) -> tuple[Lamp | Mercury | Leds, ...]:
        return self.halogen, self.mercury, self.leds, self.illuminants

    def _passed(self, time_s: float | FloatArray) -> FloatArray:
        since_s = [since_s for since_s, _ in self.filters]
        passed: FloatArray = np.array([passed for _, passed in self.filters])
        return passed[np.searchsorted(since_s, time_s, side="right") - 1]
