"""All that shines on the samples: the lamp, and the room's own light where somebody left it on."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from .faults import When
from .lamp import BURNING_K, Lamp, filament_spectrum

FloatArray = NDArray[np.float64]

#: The room light's irradiance at the sample over the warm lamp's.
ROOM_LIGHT = 8e-3


@dataclass(frozen=True)
class Lights:
    """A lamp, and when the room light is on; irradiances as `Lamp`'s."""

    lamp: Lamp
    room_light: Sequence[When] = ()

    def corners(self, start_s: float, end_s: float) -> list[float]:
        """Times strictly between at which the light does not go on smoothly."""
        switches = {time_s for when in self.room_light for time_s in (when.at, when.until)}
        inside = {time_s for time_s in switches if start_s < time_s < end_s}
        return sorted(inside.union(self.lamp.corners(start_s, end_s)))

    def dark(self, start_s: float, end_s: float) -> bool:
        """Whether there is no light at all from `start_s` to `end_s`."""
        return self._room_light_s(start_s, end_s) == 0 and self.lamp.dark(start_s, end_s)

    def irradiance(self, time_s: float) -> FloatArray:
        """Relative spectral irradiance at the sample, shape (160,), on `WAVELENGTH_NM`."""
        light = self.lamp.irradiance(time_s)
        if any(when.is_on(time_s) for when in self.room_light):
            light = light + room_light_spectrum()
        return light

    def exposure(self, start_s: float, end_s: float) -> FloatArray:
        """∫ irradiance dt over an interval, shape (160,)."""
        light_s = self._room_light_s(start_s, end_s)
        return self.lamp.exposure(start_s, end_s) + light_s * room_light_spectrum()

    def _room_light_s(self, start_s: float, end_s: float) -> float:
        """For how long of an interval the room light is on."""
        corners = [start_s, *self.corners(start_s, end_s), end_s]
        return sum(
            right - left
            for left, right in pairwise(corners)
            if any(when.is_on((left + right) / 2) for when in self.room_light)
        )


def room_light_spectrum() -> FloatArray:
    """Of the room light, shape (160,): incandescent, too."""
    spectrum: FloatArray = ROOM_LIGHT * filament_spectrum(BURNING_K)
    return spectrum
