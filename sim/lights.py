"""All that shines on the samples, and what the camera sees of it.

The lamp, and the room's own light where somebody left it on; between them and the samples there
may be a shield before the lamp and a trap door, which turns the samples from lamp to camera.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from .door import Door
from .faults import When
from .lamp import BURNING_K, PANEL_FADING_S, Lamp, filament_spectrum

FloatArray = NDArray[np.float64]
#: Part of a light at a time.
Share = Callable[[float], float]

#: The room light's irradiance at the sample over the warm lamp's.
ROOM_LIGHT = 8e-3


@dataclass(frozen=True)
class Seen:
    """∫ irradiance × visible part dt of what the camera sees by reflection, each shape (160,).

    Attributes
    ----------
    sample
        As far as the door is open.
    door
        Its outside, as far as it is closed.
    cloth
        All around.
    """

    sample: FloatArray
    door: FloatArray
    cloth: FloatArray


@dataclass(frozen=True)
class Lights:
    """A lamp, and when the room light is on; irradiances as `Lamp`'s.

    The lamp reaches the sample as far as the trap door is closed and the shield open; the room
    light comes from everywhere.
    """

    lamp: Lamp
    room_light: Sequence[When] = ()
    door: Door | None = None
    shield: Door | None = None

    def corners(self, start_s: float, end_s: float) -> list[float]:
        """Times strictly between at which light or door does not go on smoothly."""
        switches = {time_s for when in self.room_light for time_s in (when.at, when.until)}
        inside = {time_s for time_s in switches if start_s < time_s < end_s}
        moving = [time_s for door in self._doors for time_s in door.corners(start_s, end_s)]
        return sorted(inside.union(self.lamp.corners(start_s, end_s), moving))

    def dark(self, start_s: float, end_s: float) -> bool:
        """Whether there is no light at all from `start_s` to `end_s`."""
        return self._room_light_s(start_s, end_s) == 0 and self.lamp.dark(start_s, end_s)

    def irradiance(self, time_s: float) -> FloatArray:
        """Relative spectral irradiance at the sample, shape (160,), on `WAVELENGTH_NM`."""
        light = self.lamp.irradiance(time_s)
        if self._doors:
            light = light * self._unshielded(time_s) * self._facing_lamp(time_s)
        if self._room_light_is_on(time_s):
            light = light + room_light_spectrum()
        return light

    def openness(self, time_s: float) -> float:
        """Part of the samples that the camera sees."""
        return 1.0 if self.door is None else self.door.openness(time_s)

    def exposure(self, start_s: float, end_s: float) -> FloatArray:
        """∫ irradiance dt over an interval without doors, shape (160,)."""
        light_s = self._room_light_s(start_s, end_s)
        return self.lamp.exposure(start_s, end_s) + light_s * room_light_spectrum()

    def seen(self, start_s: float, end_s: float) -> Seen:
        """What the camera sees by reflection in an interval."""
        if not self._doors:
            light = self.exposure(start_s, end_s)
            return Seen(light, np.zeros_like(light), light)
        shield, opened = self._unshielded, self.openness

        def on_sample(time_s: float) -> float:
            return shield(time_s) * self._facing_lamp(time_s) * opened(time_s)

        def on_door(time_s: float) -> float:
            return shield(time_s) * (1 - opened(time_s))

        return Seen(
            sample=self._integral(start_s, end_s, on_sample, opened),
            door=self._integral(start_s, end_s, on_door, lambda time_s: 1 - opened(time_s)),
            cloth=self._integral(start_s, end_s, shield, lambda _: 1.0),
        )

    @property
    def _doors(self) -> tuple[Door, ...]:
        return tuple(door for door in (self.door, self.shield) if door is not None)

    def _facing_lamp(self, time_s: float) -> float:
        return 1.0 if self.door is None else 1 - self.door.openness(time_s)

    def _unshielded(self, time_s: float) -> float:
        return 1.0 if self.shield is None else self.shield.openness(time_s)

    def _integral(
        self, start_s: float, end_s: float, lamp_share: Share, room_share: Share
    ) -> FloatArray:
        """∫ (share of the lamp + share of the room light) dt, shape (160,)."""
        nodes, weights = np.polynomial.legendre.leggauss(8)
        total = np.zeros_like(self.lamp.irradiance(start_s))
        for left, right in pairwise([start_s, *self.corners(start_s, end_s), end_s]):
            middle_s = (left + right) / 2
            lit = self._room_light_is_on(middle_s)
            if all(door.is_still(left, right) for door in self._doors):
                total += lamp_share(middle_s) * self.lamp.exposure(left, right)
                total += lit * room_share(middle_s) * (right - left) * room_light_spectrum()
                continue
            edges = np.linspace(left, right, math.ceil((right - left) / PANEL_FADING_S) + 1)
            for low, high in pairwise(edges):
                for node, weight in zip(nodes, weights, strict=True):
                    at_s = (low + high + (high - low) * node) / 2
                    part_s = weight * (high - low) / 2
                    total += part_s * lamp_share(at_s) * self.lamp.irradiance(at_s)
                    total += part_s * lit * room_share(at_s) * room_light_spectrum()
        return total

    def _room_light_is_on(self, time_s: float) -> bool:
        return any(when.is_on(time_s) for when in self.room_light)

    def _room_light_s(self, start_s: float, end_s: float) -> float:
        """For how long of an interval the room light is on."""
        corners = [start_s, *self.corners(start_s, end_s), end_s]
        return sum(
            right - left
            for left, right in pairwise(corners)
            if self._room_light_is_on((left + right) / 2)
        )


def room_light_spectrum() -> FloatArray:
    """Of the room light, shape (160,): incandescent, too."""
    spectrum: FloatArray = ROOM_LIGHT * filament_spectrum(BURNING_K)
    return spectrum
