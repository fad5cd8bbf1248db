"""The lamps that the relay may feed, behind the colour filter before them, and LEDs beside it."""

from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from labrig.foundation.arrays import FloatArray

from .illuminants import Illuminants
from .lamp import Lamp
from .leds import Leds
from .mercury import Mercury


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
