"""A low-pressure mercury lamp: lines, a faint continuum, and an arc that warms up."""

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from labrig.foundation.arrays import FloatArray

from .lamp import CELL_NM, WAVELENGTH_NM

#: Lines in air [nm] (Sansonetti, Salit and Reader, Applied Optics 35, 1996) and their light over
#: the strongest's, about that of a germicidal lamp. Their own width, a hundredth of a nanometre,
#: does not matter.
LINES = (
    (404.6565, 0.38),
    (407.7837, 0.08),
    (435.8335, 1.0),
    (546.0750, 0.7),
    (576.9610, 0.09),
    (579.0670, 0.09),
    (690.7500, 0.006),
)
#: Light of the strongest line over the warm halogen lamp's in 1 nm at 560 nm.
STRONGEST = 40.0
#: Continuum in 1 nm over the strongest line.
CONTINUUM = 1e-4

#: Light of the cold arc, and the time constant with which it warms.
COLD = 0.4
WARM_UP_S = 45.0


def line_spectrum() -> FloatArray:
    """Return the warm lamp's irradiance, relative as a `Lamp`'s, shape (wavelengths,).

    Each line is shared by the two cells about it so that its centroid is exact.
    """
    spectrum = np.full_like(WAVELENGTH_NM, CONTINUUM * STRONGEST)
    for line_nm, strength in LINES:
        cell = int((line_nm - WAVELENGTH_NM[0]) // CELL_NM)
        right_fraction = (line_nm - WAVELENGTH_NM[cell]) / CELL_NM
        light = STRONGEST * strength / CELL_NM
        spectrum[cell] += (1 - right_fraction) * light
        spectrum[cell + 1] += right_fraction * light
    return spectrum


@dataclass(frozen=True)
class Mercury:
    """The lamp with its history; values never change. Times are seconds of the room's clock.

    Attributes
    ----------
    switches
        Time and new state of each switch.
    """

    switches: tuple[tuple[float, bool], ...] = ((0.0, False),)

    @property
    def on(self) -> bool:
        """Whether there is an arc."""
        return self.switches[-1][1]

    @property
    def was_on(self) -> bool:
        """Whether there has ever been an arc."""
        return len(self.switches) > 1

    def switched(self, on: bool, at_s: float) -> "Mercury":
        """Return the lamp after one more switch; switching to the present state does nothing."""
        if on == self.on:
            return self
        return replace(self, switches=(*self.switches, (at_s, on)))

    def until(self, time_s: float) -> "Mercury":
        """Return the lamp without switches after `time_s`."""
        return replace(self, switches=tuple(s for s in self.switches if s[0] <= time_s))

    def last_switch_off(self, time_s: float) -> float | None:
        """Return the time at which the lamp was last switched off, up to and including `time_s`."""
        off = [at_s for at_s, on in self.switches[1:] if not on and at_s <= time_s]
        return max(off, default=None)

    def corners(self, start_s: float, end_s: float) -> list[float]:
        """Return the times strictly between at which the light is not smooth."""
        return [at_s for at_s, _ in self.switches if start_s < at_s < end_s]

    def irradiance(self, time_s: float | FloatArray) -> FloatArray:
        """Return the relative spectral irradiance at the sample, shape (..., wavelengths)."""
        return np.multiply.outer(np.vectorize(self._gain, otypes=[float])(time_s), line_spectrum())

    def exposure(self, start_s: float, end_s: float) -> FloatArray:
        """Return ∫ irradiance dt over an interval, shape (wavelengths,)."""
        corners = [start_s, *self.corners(start_s, end_s), end_s]
        total_s = 0.0
        for begin_s, stop_s in pairwise(corners):
            at_s, on = self._switch(begin_s)
            if on:
                cold = [math.exp(-(time_s - at_s) / WARM_UP_S) for time_s in (begin_s, stop_s)]
                total_s += stop_s - begin_s - (1 - COLD) * WARM_UP_S * (cold[0] - cold[1])
        return total_s * line_spectrum()

    def dark(self, start_s: float, end_s: float) -> bool:
        """Return whether there is no light from `start_s` to `end_s`."""
        return not (self._switch(start_s)[1] or self.corners(start_s, end_s))

    def _switch(self, time_s: float) -> tuple[float, bool]:
        return next(s for s in reversed(self.switches) if s[0] <= time_s)

    def _gain(self, time_s: float) -> float:
        at_s, on = self._switch(time_s)
        return 1 - (1 - COLD) * math.exp(-(time_s - at_s) / WARM_UP_S) if on else 0.0
