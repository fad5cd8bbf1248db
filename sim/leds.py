"""A bank of LEDs: narrow bands that droop as they warm, behind relays or outputs, with faults."""

import math
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Protocol, Self

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.clock import VirtualClock

from .bench_settings import LedSettings
from .faults import Fault, OfLed, given
from .filters import read_curve
from .lamp import BURNING_LIGHT, WAVELENGTH_NM

#: Full width at half maximum of Ohno's shape with width 1.
OHNO_FWHM = 0.9215


class Banked(Protocol):
    """A light of a bank: its relay, and the time constant with which it warms."""

    @property
    def relay(self) -> int:
        """Relay that switches it."""

    @property
    def warm_up(self) -> float:
        """Time constant in seconds."""


def led_spectrum(led: LedSettings, shift_nm: float = 0.0) -> FloatArray:
    """Return a lit, cold LED's irradiance, relative as a `Lamp`'s, shape (wavelengths,)."""
    if led.spectrum is not None:
        curve = read_curve(Path(led.spectrum))
        shape = np.interp(WAVELENGTH_NM - shift_nm, WAVELENGTH_NM, curve)
    else:
        shape = led_shape(led.centre + shift_nm, led.fwhm, led.asymmetry)
    spectrum: FloatArray = led.level * BURNING_LIGHT / shape.sum() * shape
    return spectrum


def led_shape(centre_nm: float, fwhm_nm: float, asymmetry: float) -> FloatArray:
    """Return a band with a peak of 1, shape (wavelengths,).

    Its shape is that of Y. Ohno, *Spectral design considerations for white LED color rendering*
    (Optical Engineering 44, 2005), each side with its own width: narrower at the top than a normal
    curve, and with wider wings.
    """
    off_nm = WAVELENGTH_NM - centre_nm
    short_nm = 2 * fwhm_nm / OHNO_FWHM / (1 + asymmetry)
    width_nm = np.where(off_nm < 0, short_nm, short_nm * asymmetry)
    peak = np.exp(-((off_nm / width_nm) ** 2))
    shape: FloatArray = (peak + 2 * peak**5) / 3
    return shape


@dataclass(frozen=True)
class Leds:
    """The bank with its history; values never change. Times are seconds of the room's clock.

    The light of an LED goes from that of a cold one to that of a warm one as 1 − exp(−t/warm_up).
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
    passed
        Part of the light that reaches the sample, of all wavelengths, shape (wavelengths,).
    """

    bank: tuple[LedSettings, ...] = ()
    states: tuple[tuple[float, frozenset[int]], ...] = ((0.0, frozenset()),)
    dimmings: tuple[tuple[float, int, float], ...] = ()
    passed: FloatArray | float = 1.0

    @cached_property
    def members(self) -> "Sequence[Banked]":
        """Settings of all lights of the bank."""
        return self.bank

    @property
    def lit(self) -> frozenset[int]:
        """Relays whose LEDs are lit."""
        return self.states[-1][1]

    @property
    def were_lit(self) -> bool:
        """Whether any LED has ever been lit."""
        return len(self.states) > 1

    def switched(self, relay: int, on: bool, at_s: float) -> Self:
        """Return the bank after a relay has moved; one that has no LED does nothing."""
        relays = self.lit | {relay} if on else self.lit - {relay}
        if relays == self.lit or relay not in {light.relay for light in self.members}:
            return self
        return replace(self, states=(*self.states, (at_s, relays)))

    def dimmed(self, relay: int, fraction: float, at_s: float) -> Self:
        """Return the bank after the brightness of an LED was changed, lit or not."""
        return replace(
            self,
            states=(*self.states, (at_s, self.lit)),
            dimmings=(*self.dimmings, (at_s, relay, fraction)),
        )

    def until(self, time_s: float) -> Self:
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
        """Return the relative spectral irradiance at the sample, shape (..., wavelengths)."""
        times_s = np.asarray(time_s, dtype=np.float64)
        since_s = [at_s for at_s, _ in self.states]
        place = np.searchsorted(since_s, times_s, side="right") - 1
        light = np.zeros((*times_s.shape, len(WAVELENGTH_NM)))
        for state in np.unique(place):
            here = place == state
            for led, start, cold, warm in self._lit(int(state)):
                gone_s = times_s[here] - since_s[state]
                warmth = 1 - (1 - start) * np.exp(-gone_s / led.warm_up)
                light[here] += cold + warmth[..., np.newaxis] * (warm - cold)
        return light

    def exposure(self, start_s: float, end_s: float) -> FloatArray:
        """Return ∫ irradiance dt over an interval, shape (wavelengths,)."""
        total = np.zeros_like(WAVELENGTH_NM)
        for begin_s, stop_s in pairwise([start_s, *self.corners(start_s, end_s), end_s]):
            state = self._place(begin_s)
            since_s, lasting_s = self.states[state][0], stop_s - begin_s
            for led, start, cold, warm in self._lit(state):
                cooler = [math.exp((since_s - at_s) / led.warm_up) for at_s in (begin_s, stop_s)]
                warmth_s = lasting_s - (1 - start) * led.warm_up * (cooler[0] - cooler[1])
                total += lasting_s * cold + warmth_s * (warm - cold)
        return total

    def _place(self, time_s: float) -> int:
        return bisect_right(self.states, time_s, key=lambda state: state[0]) - 1

    def _lit(self, state: int) -> Iterator[tuple[Banked, float, FloatArray, FloatArray]]:
        """Yield the LEDs of a state: warmth at its start, light of the cold and of the warm one."""
        for led in self.members:
            if led.relay in self.states[state][1]:
                brightness = self._brightness(led.relay, self.states[state][0])
                cold, warm = self.spectra[led.relay]
                yield led, self._warmth[state][led.relay], brightness * cold, brightness * warm

    @cached_property
    def spectra(self) -> dict[int, tuple[FloatArray, FloatArray]]:
        """Light of each LED when cold and when warm."""
        return {
            led.relay: (
                self.passed * led_spectrum(led),
                self.passed * (1 - led.droop) * led_spectrum(led, led.shift_nm),
            )
            for led in self.bank
        }

    @cached_property
    def _warmth(self) -> list[dict[int, float]]:
        """Warmth of each LED at the start of each state, from 0 to 1."""
        warmth = [{led.relay: 0.0 for led in self.members}]
        for (since_s, relays), (until_s, _) in pairwise(self.states):
            warmth.append({})
            for led in self.members:
                goal = float(led.relay in relays)
                remains = math.exp((since_s - until_s) / led.warm_up)
                warmth[-1][led.relay] = goal + (warmth[-2][led.relay] - goal) * remains
        return warmth

    def _brightness(self, relay: int, time_s: float) -> float:
        """Return the fraction of its full light that an LED has if it is lit."""
        changes = [part for at_s, of, part in self.dimmings if of == relay and at_s <= time_s]
        return changes[-1] if changes else 1.0


class LedCircuit:
    """The bank of LEDs and the contacts that feed them.

    Nothing runs in the background: the states of contacts and LEDs are computed when they are asked
    for.

    Parameters
    ----------
    leds
        The LEDs, all dark.
    lit
        Relays that are closed when the room is opened.
    faults
        Faults of the room, of which `led_dark` and `led_stuck` are the circuit's.
    clock
        The room's clock.
    """

    def __init__(
        self,
        leds: Leds,
        lit: Iterable[int],
        faults: Sequence[Fault],
        clock: VirtualClock,
    ) -> None:
        self._clock = clock
        self._dark = given(fault.led_dark for fault in faults)
        self._stuck = given(fault.led_stuck for fault in faults)
        changes = {
            time_s for span in (*self._dark, *self._stuck) for time_s in (span.at, span.until)
        }
        self._changes_s = sorted(time_s for time_s in changes if time_s > 0)
        self._asked = set(lit)
        # Stuck before the room was opened: it was lit then, and has not let go.
        self._closed = {
            span.relay
            for span in self._stuck
            if span.relay is not None and span.at < 0 and span.is_on(0.0)
        }
        self._leds = leds
        self._settle(0.0)

    @property
    def leds(self) -> Leds:
        """The LEDs with their history up to now."""
        self._follow()
        return self._leds

    def ask(self, relay: int, on: bool) -> None:
        """Have a relay or an output switched now."""
        self._follow()
        (self._asked.add if on else self._asked.discard)(relay)
        self._settle(self._clock.now())

    def dim(self, relay: int, fraction: float) -> None:
        """Change the brightness of an LED now, as a fraction of its full light."""
        self._follow()
        self._leds = self._leds.dimmed(relay, fraction, self._clock.now())

    def _follow(self) -> None:
        while self._changes_s and self._changes_s[0] <= self._clock.now():
            self._settle(self._changes_s.pop(0))

    def _settle(self, time_s: float) -> None:
        stays = {relay for relay in self._closed if _has(self._stuck, relay, time_s)}
        self._closed = self._asked | stays
        for relay in (led.relay for led in self._leds.bank):
            lit = relay in self._closed and not _has(self._dark, relay, time_s)
            self._leds = self._leds.switched(relay, lit, time_s)


def _has(spans: Sequence[OfLed], relay: int, time_s: float) -> bool:
    return any(span.is_on(time_s) for span in spans if span.relay in (None, relay))
