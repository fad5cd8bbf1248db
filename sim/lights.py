"""All light on the samples, and the camera's part of it by reflection.

There are the lamp, the room's own light if it was left on, and light that leaks in; between them
and the samples there may be a shield before the lamp and a trap door, which turns the samples from
lamp to camera.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from labrig.foundation.arrays import FloatArray

from .door import Door
from .faults import FaultTime
from .lamp import (
    BURNING_K,
    BURNING_LIGHT,
    PANEL_FADING_S,
    WAVELENGTH_NM,
    Lamp,
    filament_spectrum,
    nodes,
)
from .lamps import FilteredLamps

#: Function of time: fraction of a light.
UnitFraction = Callable[[float], float]

#: The room light's irradiance at the sample over the warm lamp's.
ROOM_LIGHT = 8e-3
#: Light that leaks in is a white LED's: peaks [nm], their widths (1 σ) and heights.
LEAK_PEAKS = ((452.0, 10.0, 1.0), (560.0, 52.0, 0.9))


@dataclass(frozen=True)
class VisibleLight:
    """∫ irradiance × visible fraction dt that the camera sees reflected, each (wavelengths,).

    Attributes
    ----------
    sample
        Light on the samples from the lamp's side, as far as the door is open; without a door all
        light.
    sample_stray
        Light on the samples from the camera's side, as far as the door is open.
    door
        Light on the door's outside, as far as it is closed.
    cloth
        Light on the cloth around.
    """

    sample: FloatArray
    sample_stray: FloatArray
    door: FloatArray
    cloth: FloatArray


@dataclass(frozen=True)
class Stray:
    """Light from all directions, on at some times.

    Attributes
    ----------
    fault_times
        Times at which the light is on.
    spectrum : ndarray, shape (wavelengths,)
        Irradiance on `WAVELENGTH_NM`, relative as a `Lamp`'s.
    """

    fault_times: Sequence[FaultTime]
    spectrum: FloatArray

    def is_on(self, time_s: float) -> bool:
        """Return whether the light is on at a time."""
        return any(span.is_on(time_s) for span in self.fault_times)


@dataclass(frozen=True)
class Lights:
    """A lamp, and the times of the room light; irradiances are relative as a `Lamp`'s.

    The lamp reaches the sample as far as the trap door is closed and the shield open; the room
    light, and light that leaks in, come from all directions.
    """

    lamp: Lamp | FilteredLamps
    room_light: Sequence[FaultTime] = ()
    door: Door | None = None
    shield: Door | None = None
    leaks: Sequence[Stray] = ()

    def corners(self, start_s: float, end_s: float) -> list[float]:
        """Return the times strictly between at which light or door is not smooth."""
        spans = [span for stray in self._strays for span in stray.fault_times]
        switches = {time_s for span in spans for time_s in (span.at, span.until)}
        inside = {time_s for time_s in switches if start_s < time_s < end_s}
        moving = [time_s for door in self._doors for time_s in door.corners(start_s, end_s)]
        return sorted(inside.union(self.lamp.corners(start_s, end_s), moving))

    def dark(self, start_s: float, end_s: float) -> bool:
        """Return whether there is no light at all from `start_s` to `end_s`."""
        if not self.lamp.dark(start_s, end_s):
            return False
        corners = [start_s, *self.corners(start_s, end_s), end_s]
        middles = [(begin_s + stop_s) / 2 for begin_s, stop_s in pairwise(corners)]
        return not any(stray.is_on(at_s) for stray in self._strays for at_s in middles)

    def irradiance(self, time_s: float | FloatArray) -> FloatArray:
        """Return the relative spectral irradiance at the sample, shape (..., wavelengths)."""
        light = self.lamp.irradiance(time_s)
        if self._doors:
            arriving = _at(time_s, lambda at_s: self._unshielded(at_s) * self._facing_lamp(at_s))
            light = light * arriving[..., None]
        for stray in self._strays:
            light = light + _at(time_s, stray.is_on)[..., None] * stray.spectrum
        return light

    def openness(self, time_s: float) -> float:
        """Return the fraction of the samples that the camera sees."""
        return 1.0 if self.door is None else self.door.openness(time_s)

    def exposure(self, start_s: float, end_s: float) -> FloatArray:
        """Return ∫ irradiance dt over an interval without doors, shape (wavelengths,)."""
        lamp = self.lamp.exposure(start_s, end_s)
        return lamp + self._stray(start_s, end_s, lambda _: 1.0)

    def seen(self, start_s: float, end_s: float) -> VisibleLight:
        """Return the light that the camera sees by reflection in an interval."""
        if not self._doors:
            light, none = self.exposure(start_s, end_s), np.zeros_like(WAVELENGTH_NM)
            return VisibleLight(light, none, none, light)
        shield, opened = self._unshielded, self.openness

        def closed(time_s: float) -> float:
            return 1 - opened(time_s)

        def on_sample(time_s: float) -> float:
            return shield(time_s) * self._facing_lamp(time_s) * opened(time_s)

        def on_door(time_s: float) -> float:
            return shield(time_s) * closed(time_s)

        sample, door, cloth = self._lamp(start_s, end_s, (on_sample, on_door, shield))
        return VisibleLight(
            sample=sample,
            sample_stray=self._stray(start_s, end_s, opened),
            door=door + self._stray(start_s, end_s, closed),
            cloth=cloth + self._stray(start_s, end_s, lambda _: 1.0),
        )

    @property
    def _doors(self) -> tuple[Door, ...]:
        return tuple(door for door in (self.door, self.shield) if door is not None)

    @property
    def _strays(self) -> tuple[Stray, ...]:
        if not self.room_light:
            return tuple(self.leaks)
        return (Stray(self.room_light, room_light_spectrum()), *self.leaks)

    def _facing_lamp(self, time_s: float) -> float:
        return 1.0 if self.door is None else 1 - self.door.openness(time_s)

    def _unshielded(self, time_s: float) -> float:
        return 1.0 if self.shield is None else self.shield.openness(time_s)

    def _lamp(self, start_s: float, end_s: float, fractions: Sequence[UnitFraction]) -> FloatArray:
        """Return ∫ shares of the lamp dt, shape (shares, wavelengths)."""
        total = np.zeros((len(fractions), len(WAVELENGTH_NM)))
        for begin_s, stop_s in pairwise([start_s, *self.corners(start_s, end_s), end_s]):
            if self.lamp.dark(begin_s, stop_s):
                continue
            if self._is_still(begin_s, stop_s):
                parts = [fraction((begin_s + stop_s) / 2) for fraction in fractions]
                total += np.outer(parts, self.lamp.exposure(begin_s, stop_s))
                continue
            times_s, part_s = nodes(begin_s, stop_s, PANEL_FADING_S)
            parts_s = part_s * np.array([_at(times_s, fraction) for fraction in fractions])
            total += parts_s @ self.lamp.irradiance(times_s)
        return total

    def _stray(self, start_s: float, end_s: float, fraction: UnitFraction) -> FloatArray:
        """Return ∫ share of the light from all directions dt, shape (wavelengths,)."""
        total = np.zeros_like(WAVELENGTH_NM)
        strays = self._strays
        if not strays:
            return total
        for begin_s, stop_s in pairwise([start_s, *self.corners(start_s, end_s), end_s]):
            middle_s = (begin_s + stop_s) / 2
            light = sum(stray.spectrum for stray in strays if stray.is_on(middle_s))
            if self._is_still(begin_s, stop_s):
                share_s = fraction(middle_s) * (stop_s - begin_s)
            else:
                times_s, part_s = nodes(begin_s, stop_s, PANEL_FADING_S)
                share_s = float(part_s @ _at(times_s, fraction))
            total += light * share_s
        return total

    def _is_still(self, start_s: float, end_s: float) -> bool:
        return all(door.is_still(start_s, end_s) for door in self._doors)


def _at(time_s: float | FloatArray, fraction: UnitFraction) -> FloatArray:
    """Return a share at every time."""
    times_s = np.asarray(time_s)
    return np.array([fraction(at_s) for at_s in times_s.ravel().tolist()]).reshape(times_s.shape)


def room_light_spectrum() -> FloatArray:
    """Return the spectrum of the room light, incandescent, too, shape (wavelengths,)."""
    spectrum: FloatArray = ROOM_LIGHT * filament_spectrum(BURNING_K)
    return spectrum


def leak(level: float, fault_times: Sequence[FaultTime]) -> Stray:
    """Return light from a screen or a crack, of `level` times the warm lamp's irradiance."""
    peaks = [
        height * np.exp(-(((WAVELENGTH_NM - at_nm) / wide_nm) ** 2) / 2)
        for at_nm, wide_nm, height in LEAK_PEAKS
    ]
    shape: FloatArray = np.sum(peaks, axis=0)
    return Stray(fault_times, level * BURNING_LIGHT / shape.sum() * shape)
