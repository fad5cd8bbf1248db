"""A halogen lamp: a glowing filament with a heat capacity, in a housing that warms slowly.

The fade after switching off is not put in but comes out: the filament cools by radiation and
conduction, and what it still emits follows Planck's law, so the blue goes first.
"""

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import OdeSolution, solve_ivp

from .simulation import LampSettings

FloatArray = NDArray[np.float64]

#: Second radiation constant hc/k, nm K (CODATA 2018).
C2_NM_K = 1.438776877e7
BURNING_K = 3000.0
ROOM_K = 295.0

#: The filament's heat content over its power when burning. With the next two tuned to the fade of
#: the paper's lamp: 1/e after 31 ms at 419 nm and 51 ms at 650 nm, dark (1e-4) after 320 ms.
FILAMENT_S = 0.366
#: Part of the power that leaves by conduction, through gas and leads. By radiation alone the red
#: afterglow would last a second.
CONDUCTED = 0.57
#: Tungsten's specific heat when cold over that at 3000 K.
COLD_HEAT_CAPACITY = 0.6
#: Total emissivity of tungsten grows with T, so radiation with the fifth power of it.
RADIATION_EXPONENT = 5
#: Cold tungsten conducts better and draws an inrush current: P = U²/R, R growing as this power.
RESISTANCE_EXPONENT = 1.2

#: This long after a switch the filament has settled to the last digits.
SETTLED_S = 3.0

#: Cells of the wavelength grid: 380–780 nm; borders of Table 1's bands are borders of cells.
CELL_NM = 2.5
CELL_EDGES_NM: FloatArray = np.linspace(380.0, 780.0, 161)
WAVELENGTH_NM: FloatArray = CELL_EDGES_NM[:-1] + CELL_NM / 2

#: Gauss–Legendre panels no longer than this resolve a fading lamp, and a burning one.
PANEL_FADING_S = 0.02
PANEL_SETTLED_S = 300.0


def filament_spectrum(temperature_k: float) -> FloatArray:
    """Spectrum of a tungsten filament relative to one at 3000 K and 560 nm.

    Planck's law times tungsten's emissivity, which falls linearly over the visible
    (0.47 at 400 nm to 0.41 at 700 nm, about what de Vos measured in 1954).

    Returns
    -------
    ndarray, shape (160,)
        On `WAVELENGTH_NM`.
    """
    emissivity = 0.47 - 2e-4 * (WAVELENGTH_NM - 400.0)
    exponent = np.minimum(C2_NM_K / (WAVELENGTH_NM * temperature_k), 700.0)
    reference = (0.47 - 2e-4 * 160.0) / (560.0**5 * math.expm1(C2_NM_K / (560.0 * BURNING_K)))
    planck: FloatArray = emissivity / (WAVELENGTH_NM**5 * np.expm1(exponent)) / reference
    return planck


#: Of the burning lamp.
BURNING_SPECTRUM: FloatArray = filament_spectrum(BURNING_K)


def _warming_k_per_s(temperature_k: float, powered: bool) -> float:
    """Energy balance of the filament, everything relative to the burning state."""
    t = temperature_k / BURNING_K
    room = ROOM_K / BURNING_K
    radiated = (t**RADIATION_EXPONENT - room**RADIATION_EXPONENT) / (1 - room**RADIATION_EXPONENT)
    lost = (1 - CONDUCTED) * radiated + CONDUCTED * (t - room) / (1 - room)
    gained = t**-RESISTANCE_EXPONENT if powered else 0.0
    heat_capacity = COLD_HEAT_CAPACITY + (1 - COLD_HEAT_CAPACITY) * t**2
    return BURNING_K / FILAMENT_S * (gained - lost) / heat_capacity


@dataclass(frozen=True)
class _Phase:
    """From one switch to the next, at `start_s`.

    `warmth` is the housing's then, 0 cold to 1 warm; `glowing` what is left behind of the light
    that the lamp gave, 0 to 1.
    """

    start_s: float
    powered: bool
    warmth: float
    glowing: float
    settled_k: float
    settling: OdeSolution | None


@dataclass(frozen=True)
class Lamp:
    """The lamp with its history of switches; values never change, `switched` gives a new one.

    Times are seconds of the room's clock. Irradiances are relative: 1 at 560 nm from the warm,
    new lamp.
    """

    settings: LampSettings
    phases: tuple[_Phase, ...]

    @classmethod
    def found(cls, settings: LampSettings, on: bool) -> Self:
        """A lamp that has been on (and is warm), or off (and is cold), for long at time zero."""
        settled_k = BURNING_K if on else ROOM_K
        return cls(settings, (_Phase(0.0, on, float(on), float(on), settled_k, None),))

    @property
    def on(self) -> bool:
        """Whether the lamp is switched on."""
        return self.phases[-1].powered

    def switched(self, on: bool, at_s: float) -> "Lamp":
        """The lamp after one more switch; switching to what it is already does nothing."""
        if on == self.on:
            return self
        settled_k = BURNING_K if on else ROOM_K
        settling = solve_ivp(
            lambda _, t: [_warming_k_per_s(t[0], on)],
            (at_s, at_s + SETTLED_S),
            [self.temperature_k(at_s)],
            method="DOP853",
            rtol=1e-9,
            atol=1e-6,
            dense_output=True,
        ).sol
        phase = _Phase(at_s, on, self._warmth(at_s), self._glowing(at_s), settled_k, settling)
        return replace(self, phases=(*self.phases, phase))

    def until(self, time_s: float) -> "Lamp":
        """The lamp as if nobody had touched it after `time_s`."""
        return replace(self, phases=tuple(p for p in self.phases if p.start_s <= time_s))

    def last_switch_off(self, time_s: float) -> float | None:
        """When the lamp was last switched off, up to and including `time_s`."""
        off = [p.start_s for p in self.phases[1:] if not p.powered and p.start_s <= time_s]
        return max(off, default=None)

    def corners(self, start_s: float, end_s: float) -> list[float]:
        """Times strictly between at which the light does not go on smoothly."""
        times = {t for p in self.phases for t in (p.start_s, p.start_s + SETTLED_S)}
        return sorted(t for t in times if start_s < t < end_s)

    def temperature_k(self, time_s: float) -> float:
        """Of the filament."""
        phase = self._phase(time_s)
        if phase.settling is None or time_s >= phase.start_s + SETTLED_S:
            return phase.settled_k
        return float(phase.settling(time_s)[0])

    def dark(self, start_s: float, end_s: float) -> bool:
        """Whether no light at all is to be expected from `start_s` to `end_s`."""
        if self.settings.afterglow and self._glowing(start_s):
            return False
        cold = self._settled(start_s) and self._phase(start_s).settled_k == ROOM_K
        return cold and not self.corners(start_s, end_s)

    def irradiance(self, time_s: float) -> FloatArray:
        """Relative spectral irradiance at the sample, shape (160,), on `WAVELENGTH_NM`."""
        temperature_k = self.temperature_k(time_s)
        afterglow = self.settings.afterglow and self.settings.afterglow * self._glowing(time_s)
        if temperature_k == ROOM_K:
            return afterglow * BURNING_SPECTRUM
        burning = temperature_k == BURNING_K
        spectrum = BURNING_SPECTRUM if burning else filament_spectrum(temperature_k)
        light = self._gain(time_s) * spectrum
        return light + afterglow * BURNING_SPECTRUM if afterglow else light

    def exposure(self, start_s: float, end_s: float) -> FloatArray:
        """∫ irradiance dt over an interval, shape (160,)."""
        nodes, weights = np.polynomial.legendre.leggauss(8)
        total = np.zeros_like(WAVELENGTH_NM)
        for left, right in pairwise([start_s, *self.corners(start_s, end_s), end_s]):
            if self.dark(left, right):
                continue
            settled = self._settled(left)
            panels = math.ceil((right - left) / (PANEL_SETTLED_S if settled else PANEL_FADING_S))
            edges = np.linspace(left, right, panels + 1)
            for low, high in pairwise(edges):
                for node, weight in zip(nodes, weights, strict=True):
                    at_s = (low + high + (high - low) * node) / 2
                    total += weight * (high - low) / 2 * self.irradiance(at_s)
        return total

    def _phase(self, time_s: float) -> _Phase:
        return next(p for p in reversed(self.phases) if p.start_s <= time_s)

    def _settled(self, time_s: float) -> bool:
        phase = self._phase(time_s)
        return phase.settling is None or time_s >= phase.start_s + SETTLED_S

    def _warmth(self, time_s: float) -> float:
        """Newton's law for the housing, 0 cold to 1 warm."""
        phase = self._phase(time_s)
        return _approach(phase, phase.warmth, time_s, self.settings.warm_up)

    def _glowing(self, time_s: float) -> float:
        """What glows on behind the filament, 0 to 1."""
        phase = self._phase(time_s)
        return _approach(phase, phase.glowing, time_s, self.settings.afterglow_fades)

    def _gain(self, time_s: float) -> float:
        aged = math.exp(math.log1p(-self.settings.drift_per_hour) * time_s / 3600.0)
        return aged * (1 - self.settings.warm_up_deficit * (1 - self._warmth(time_s)))


def _approach(phase: _Phase, begin: float, time_s: float, constant_s: float) -> float:
    """From `begin` towards 1 while there is power, towards 0 while there is none."""
    goal = float(phase.powered)
    elapsed_s = max(time_s - phase.start_s, 0.0)
    return goal + (begin - goal) * math.exp(-elapsed_s / constant_s)
