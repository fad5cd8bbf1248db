"""A bank of LEDs: narrow bands, switched at once by their relays."""

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
    """Return a lit LED's irradiance, relative as a `Lamp`'s, shape (160,) on `WAVELENGTH_NM`."""
    shape = np.exp(-(((WAVELENGTH_NM - led.centre) / led.fwhm * FWHM_OVER_SIGMA) ** 2) / 2)
    spectrum: FloatArray = led.level * BURNING_SPECTRUM.sum() / shape.sum() * shape
    return spectrum


@dataclass(frozen=True)
class Leds:
    """The bank with its history; values never change. Times are seconds of the room's clock.

    Several LEDs may be lit together: preventing that is up to the driver.

    Attributes
    ----------
    bank
        Settings of the LEDs.
    states
        Begin in seconds and closed relays of each state; the first from 0 on.
    dimmings
        Time in seconds, relay and fraction of the full light, of every change of an LED's
        brightness; full before the first one.
    """

    bank: tuple[LedSettings, ...] = ()
    states: tuple[tuple[float, frozenset[int]], ...] = ((0.0, frozenset()),)
    dimmings: tuple[tuple[float, int, float], ...] = ()

    @property
    def lit(self) -> frozenset[int]:
        """Relays whose LEDs are lit."""
        return self.states[-1][1]

    @property
    def were_lit(self) -> bool:
        """Whether any LED has ever been lit."""
        return len(self.states) > 1

    def switched(self, relay: int, on: bool, at_s: float) -> "Leds":
        """Return the bank after a relay has moved; one that has no LED does nothing."""
        relays = self.lit | {relay} if on else self.lit - {relay}
        if relays == self.lit or relay not in {led.relay for led in self.bank}:
            return self
        return replace(self, states=(*self.states, (at_s, relays)))

    def dimmed(self, relay: int, fraction: float, at_s: float) -> "Leds":
        """Return the bank after the brightness of an LED was changed, lit or not."""
        return replace(
            self,
            states=(*self.states, (at_s, self.lit)),
            dimmings=(*self.dimmings, (at_s, relay, fraction)),
        )

    def until(self, time_s: float) -> "Leds":
        """Return the bank without switches after `time_s`."""
        return replace(self, states=tuple(state for state in self.states if state[0] <= time_s))

    def last_switch_off(self, time_s: float) -> float | None:
        """Return the time at which an LED was last switched off, up to and including `time_s`."""
        off = [at_s for (_, previous), (at_s, relays) in pairwise(self.states) if previous - relays]
        return max((at_s for at_s in off if at_s <= time_s), default=None)

    def corners(self, start_s: float, end_s: float) -> list[float]:
        """Return the times strictly between at which the light is not smooth."""
        return [at_s for at_s, _ in self.states if start_s < at_s < end_s]

    def dark(self, start_s: float, end_s: float) -> bool:
        """Return whether there is no light from `start_s` to `end_s`."""
        times_s = [start_s, *self.corners(start_s, end_s)]
        return not any(self.states[self._place(at_s)][1] for at_s in times_s)

    def irradiance(self, time_s: float | FloatArray) -> FloatArray:
        """Return the relative spectral irradiance at the sample, shape (..., 160)."""
        since_s = [at_s for at_s, _ in self.states]
        irradiance: FloatArray = self._light[np.searchsorted(since_s, time_s, side="right") - 1]
        return irradiance

    def exposure(self, start_s: float, end_s: float) -> FloatArray:
        """Return ∫ irradiance dt over an interval, shape (160,)."""
        edges_s = [start_s, *self.corners(start_s, end_s), end_s]
        places = [self._place(begin_s) for begin_s in edges_s[:-1]]
        exposure: FloatArray = np.diff(edges_s) @ self._light[places]
        return exposure

    def _place(self, time_s: float) -> int:
        return bisect_right(self.states, time_s, key=lambda state: state[0]) - 1

    @cached_property
    def _light(self) -> FloatArray:
        """Return the irradiance of every state, shape (states, 160)."""
        spectra = {led.relay: led_spectrum(led) for led in self.bank}
        dark = np.zeros_like(WAVELENGTH_NM)
        return np.array(
            [
                sum((self._brightness(relay, at_s) * spectra[relay] for relay in relays), dark)
                for at_s, relays in self.states
            ]
        )

    def _brightness(self, relay: int, time_s: float) -> float:
        """Return the fraction of its full light that an LED has if it is lit."""
        changes = [part for at_s, of, part in self.dimmings if of == relay and at_s <= time_s]
        return changes[-1] if changes else 1.0
