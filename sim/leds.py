"""A bank of LEDs: narrow bands, there at once when their relays close and gone when they open."""

import math
from bisect import bisect_right
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from .bench_settings import LedSettings
from .lamp import BURNING_SPECTRUM, WAVELENGTH_NM

FloatArray = NDArray[np.float64]

FWHM_OVER_SIGMA = 2 * math.sqrt(2 * math.log(2))


def led_spectrum(led: LedSettings) -> FloatArray:
    """Of a lit LED, relative as a `Lamp`'s irradiance, shape (160,) on `WAVELENGTH_NM`."""
    shape = np.exp(-(((WAVELENGTH_NM - led.centre) / led.fwhm * FWHM_OVER_SIGMA) ** 2) / 2)
    spectrum: FloatArray = led.level * BURNING_SPECTRUM.sum() / shape.sum() * shape
    return spectrum


@dataclass(frozen=True)
class Leds:
    """The bank with its history; values never change. Times are seconds of the room's clock.

    Nothing keeps two from being lit together: that is for who switches the relays.

    Attributes
    ----------
    bank
        Its LEDs.
    states
        From when on, and the relays that were closed then; the first from 0 on.
    """

    bank: tuple[LedSettings, ...] = ()
    states: tuple[tuple[float, frozenset[int]], ...] = ((0.0, frozenset()),)

    @property
    def lit(self) -> frozenset[int]:
        """Relays whose LEDs are lit."""
        return self.states[-1][1]

    @property
    def were_lit(self) -> bool:
        """Whether there has ever been light."""
        return len(self.states) > 1

    def switched(self, relay: int, on: bool, at_s: float) -> "Leds":
        """The bank after a relay has moved; one that has no LED does nothing."""
        lit = self.lit | {relay} if on else self.lit - {relay}
        if lit == self.lit or relay not in {led.relay for led in self.bank}:
            return self
        return replace(self, states=(*self.states, (at_s, lit)))

    def until(self, time_s: float) -> "Leds":
        """The bank as if nobody had touched it after `time_s`."""
        return replace(self, states=tuple(state for state in self.states if state[0] <= time_s))

    def last_switch_off(self, time_s: float) -> float | None:
        """When one was last switched off, up to and including `time_s`."""
        off = [at_s for (_, before), (at_s, after) in pairwise(self.states) if before - after]
        return max((at_s for at_s in off if at_s <= time_s), default=None)

    def corners(self, start_s: float, end_s: float) -> list[float]:
        """Times strictly between at which the light does not go on smoothly."""
        return [at_s for at_s, _ in self.states if start_s < at_s < end_s]

    def dark(self, start_s: float, end_s: float) -> bool:
        """Whether there is no light from `start_s` to `end_s`."""
        times_s = [start_s, *self.corners(start_s, end_s)]
        return not any(self.states[self._place(at_s)][1] for at_s in times_s)

    def irradiance(self, time_s: float | FloatArray) -> FloatArray:
        """Relative spectral irradiance at the sample, shape (..., 160)."""
        since_s = [at_s for at_s, _ in self.states]
        found: FloatArray = self._light[np.searchsorted(since_s, time_s, side="right") - 1]
        return found

    def exposure(self, start_s: float, end_s: float) -> FloatArray:
        """∫ irradiance dt over an interval, shape (160,)."""
        edges_s = [start_s, *self.corners(start_s, end_s), end_s]
        places = [self._place(left) for left in edges_s[:-1]]
        found: FloatArray = np.diff(edges_s) @ self._light[places]
        return found

    def _place(self, time_s: float) -> int:
        return bisect_right(self.states, time_s, key=lambda state: state[0]) - 1

    @cached_property
    def _light(self) -> FloatArray:
        """Of every state, shape (states, 160)."""
        spectra = {led.relay: led_spectrum(led) for led in self.bank}
        dark = np.zeros_like(WAVELENGTH_NM)
        return np.array([sum((spectra[one] for one in lit), dark) for _, lit in self.states])
