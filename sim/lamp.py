"""Lamps of the simulated room: a halogen lamp's glowing filament, a mercury lamp's arc.

The fade after switching off results from the model: the filament cools by radiation and conduction,
and its emission follows Planck's law, so that the blue fades first.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.interpolate import BSpline, make_interp_spline

from labrig.foundation.arrays import FloatArray

from .simulation import LampSettings

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

#: Time after a switch until the filament has settled to the last digits.
SETTLED_S = 3.0

#: Cells of the wavelength grid: 300–780 nm; borders of Table 1's bands are borders of cells.
CELL_NM = 2.5
CELL_EDGES_NM: FloatArray = np.linspace(300.0, 780.0, 193)
WAVELENGTH_NM: FloatArray = CELL_EDGES_NM[:-1] + CELL_NM / 2
#: Where an amount of light is "that of the lamp", whatever ultraviolet comes with it.
IS_VISIBLE: NDArray[np.bool_] = WAVELENGTH_NM > 380.0

#: Temperatures at so many times interpolate a settling filament to a part in 10¹².
SETTLING_TIMES = 1001

#: Gauss and Legendre's nodes and weights for a panel, and how long a panel resolves a fading lamp,
#: and a burning one.
PANEL = np.polynomial.legendre.leggauss(8)
PANEL_FADING_S = 0.02
PANEL_SETTLED_S = 300.0


#: Tungsten's, which falls linearly over the visible: 0.47 at 400 nm to 0.41 at 700 nm, about what
#: de Vos measured in 1954.
_EMISSIVITY: FloatArray = 0.47 - 2e-4 * (WAVELENGTH_NM - 400.0)
_FIFTH_POWER: FloatArray = WAVELENGTH_NM**5
_AT_560_NM = (0.47 - 2e-4 * 160.0) / (560.0**5 * math.expm1(C2_NM_K / (560.0 * BURNING_K)))


def filament_spectrum(temperature_k: float | FloatArray) -> FloatArray:
    """Return the spectrum of a tungsten filament relative to one at 3000 K and 560 nm.

    Planck's law times tungsten's emissivity.

    Returns
    -------
    ndarray, shape (..., wavelengths)
        Spectrum at every temperature, on `WAVELENGTH_NM`.
    """
    each_k = np.asarray(temperature_k)[..., None]
    exponent = np.minimum(C2_NM_K / (WAVELENGTH_NM * each_k), 700.0)
    planck: FloatArray = _EMISSIVITY / (_FIFTH_POWER * np.expm1(exponent)) / _AT_560_NM
    return planck


#: Spectrum of the burning lamp.
BURNING_SPECTRUM: FloatArray = filament_spectrum(BURNING_K)
#: Its visible light.
BURNING_LIGHT = float(BURNING_SPECTRUM[IS_VISIBLE].sum())


def _warming_k_per_s(temperature_k: float, powered: bool) -> float:
    """Return the filament's energy balance, relative to the burning state."""
    t = temperature_k / BURNING_K
    room = ROOM_K / BURNING_K
    radiated = (t**RADIATION_EXPONENT - room**RADIATION_EXPONENT) / (1 - room**RADIATION_EXPONENT)
    lost = (1 - CONDUCTED) * radiated + CONDUCTED * (t - room) / (1 - room)
    gained = t**-RESISTANCE_EXPONENT if powered else 0.0
    heat_capacity = COLD_HEAT_CAPACITY + (1 - COLD_HEAT_CAPACITY) * t**2
    return BURNING_K / FILAMENT_S * (gained - lost) / heat_capacity


@lru_cache(maxsize=32)
def _settling(begin_k: float, powered: bool) -> BSpline:
    """Return the temperature of a filament over time after a switch, until it has settled."""
    temperature_k = solve_ivp(
        lambda _, t: [_warming_k_per_s(t[0], powered)],
        (0.0, SETTLED_S),
        [begin_k],
        method="DOP853",
        rtol=1e-11,
        atol=1e-8,
        dense_output=True,
    ).sol
    assert temperature_k is not None
    # Closer together at first, when a cold filament warms within milliseconds.
    times_s = SETTLED_S * np.linspace(0.0, 1.0, SETTLING_TIMES) ** 2
    return make_interp_spline(times_s, temperature_k(times_s)[0], k=7)


@dataclass(frozen=True)
class _Phase:
    """Time from one switch to the next, from `start_s` on.

    `begin_k` is the filament's temperature at its start, `warmth` the housing's, 0 cold to 1 warm;
    `glowing` the fraction of the afterglow, 0 to 1.
    """

    start_s: float
    powered: bool
    warmth: float
    glowing: float
    begin_k: float

    @property
    def settled_k(self) -> float:
        """Temperature of the settled filament in K."""
        return BURNING_K if self.powered else ROOM_K

    @property
    def settled_s(self) -> float:
        """Time at which the filament has settled."""
        return self.start_s if self.begin_k == self.settled_k else self.start_s + SETTLED_S

    def temperature_k(self, time_s: FloatArray) -> FloatArray:
        """Return the temperature of the filament in K."""
        if self.begin_k == self.settled_k:
            return np.full_like(time_s, self.settled_k)
        after_s = time_s - self.start_s
        settling_k = _settling(self.begin_k, self.powered)(np.clip(after_s, 0.0, SETTLED_S))
        return np.where(time_s >= self.settled_s, self.settled_k, settling_k)


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
        """Return a lamp that has long been on (and is warm), or off (and is cold), at time zero."""
        begin_k = BURNING_K if on else ROOM_K
        return cls(settings, (_Phase(0.0, on, float(on), float(on), begin_k),))

    @property
    def on(self) -> bool:
        """Whether the lamp is switched on."""
        return self.phases[-1].powered

    def switched(self, on: bool, at_s: float) -> "Lamp":
        """Return the lamp after one more switch; switching to the present state does nothing."""
        if on == self.on:
            return self
        warmth, glowing = float(self._warmth(at_s)), float(self._glowing(at_s))
        phase = _Phase(at_s, on, warmth, glowing, float(self.temperature_k(at_s)))
        return replace(self, phases=(*self.phases, phase))

    def until(self, time_s: float) -> "Lamp":
        """Return the lamp without switches after `time_s`."""
        return replace(self, phases=tuple(p for p in self.phases if p.start_s <= time_s))

    def last_switch_off(self, time_s: float) -> float | None:
        """Return the time at which the lamp was last switched off, up to and including `time_s`."""
        off = [p.start_s for p in self.phases[1:] if not p.powered and p.start_s <= time_s]
        return max(off, default=None)

    def corners(self, start_s: float, end_s: float) -> list[float]:
        """Return the times strictly between at which the light is not smooth."""
        times = {t for p in self.phases for t in (p.start_s, p.start_s + SETTLED_S)}
        return sorted(t for t in times if start_s < t < end_s)

    def temperature_k(self, time_s: float | FloatArray) -> FloatArray:
        """Return the temperature of the filament at every time, in K."""
        return self._by_phase(time_s, lambda phase, at_s: phase.temperature_k(at_s))

    def dark(self, start_s: float, end_s: float) -> bool:
        """Return whether there is no light at all from `start_s` to `end_s`."""
        if self.settings.afterglow and self._glowing(start_s):
            return False
        cold = self._settled(start_s) and not self._phase(start_s).powered
        return cold and not self.corners(start_s, end_s)

    def irradiance(self, time_s: float | FloatArray) -> FloatArray:
        """Return the relative spectral irradiance at the sample, shape (..., wavelengths)."""
        temperature_k = self.temperature_k(time_s)
        if np.all(temperature_k == BURNING_K):
            spectrum = BURNING_SPECTRUM
        else:
            spectrum = filament_spectrum(temperature_k)
        gain = np.where(temperature_k == ROOM_K, 0.0, self._gain(time_s))
        light = gain[..., None] * spectrum
        if self.settings.afterglow:
            afterglow = self.settings.afterglow * self._glowing(time_s)
            light += afterglow[..., None] * BURNING_SPECTRUM
        if self.settings.cooling_per_hour:
            light = light * _reddened(self.settings.cooling_per_hour * np.asarray(time_s) / 3600.0)
        return light

    def exposure(self, start_s: float, end_s: float) -> FloatArray:
        """Return ∫ irradiance dt over an interval, shape (wavelengths,)."""
        total = np.zeros_like(WAVELENGTH_NM)
        for begin_s, stop_s in pairwise([start_s, *self.corners(start_s, end_s), end_s]):
            if not self.dark(begin_s, stop_s):
                panel_s = PANEL_SETTLED_S if self._settled(begin_s) else PANEL_FADING_S
                at_s, part_s = nodes(begin_s, stop_s, panel_s)
                total += part_s @ self.irradiance(at_s)
        return total

    def _phase(self, time_s: float) -> _Phase:
        return next(p for p in reversed(self.phases) if p.start_s <= time_s)

    def _settled(self, time_s: float) -> bool:
        return time_s >= self._phase(time_s).settled_s

    def _by_phase(
        self, time_s: float | FloatArray, value: Callable[[_Phase, FloatArray], FloatArray]
    ) -> FloatArray:
        """Return `value` at every time, in the phase of that time."""
        times_s = np.asarray(time_s)
        if np.all(times_s >= self.phases[-1].start_s):
            return value(self.phases[-1], times_s)
        starts_s = [phase.start_s for phase in self.phases]
        phase_index = np.searchsorted(starts_s, times_s, side="right") - 1
        first, last = phase_index.min(), phase_index.max()
        values = value(self.phases[first], times_s)
        for index in range(first + 1, last + 1):
            values = np.where(phase_index < index, values, value(self.phases[index], times_s))
        return values

    def _warmth(self, time_s: float | FloatArray) -> FloatArray:
        """Return the housing's warmth by Newton's law, 0 cold to 1 warm."""
        constant_s = self.settings.warm_up
        return self._by_phase(time_s, lambda p, at_s: _approach(p, p.warmth, at_s, constant_s))

    def _glowing(self, time_s: float | FloatArray) -> FloatArray:
        """Return the fraction of the afterglow behind the filament, 0 to 1."""
        constant_s = self.settings.afterglow_fades
        return self._by_phase(time_s, lambda p, at_s: _approach(p, p.glowing, at_s, constant_s))

    def _gain(self, time_s: float | FloatArray) -> FloatArray:
        hours = np.asarray(time_s) / 3600.0
        aged = np.exp(math.log1p(-self.settings.drift_per_hour) * hours)
        return aged * (1 - self.settings.warm_up_deficit * (1 - self._warmth(time_s)))


def _reddened(cooler_k: FloatArray) -> FloatArray:
    """Return a cooler burning filament's light over that of a new one, (..., wavelengths).

    Wien's approximation; 1 at 560 nm.
    """
    per_k = 1 / (BURNING_K - cooler_k) - 1 / BURNING_K
    factor: FloatArray = np.exp(C2_NM_K * per_k[..., None] * (1 / 560.0 - 1 / WAVELENGTH_NM))
    return factor


def _approach(phase: _Phase, begin: float, time_s: FloatArray, constant_s: float) -> FloatArray:
    """Return the exponential approach from `begin` to 1 with power, to 0 without."""
    goal = float(phase.powered)
    elapsed_s = np.maximum(time_s - phase.start_s, 0.0)
    return goal + (begin - goal) * np.exp(-elapsed_s / constant_s)


def nodes(start_s: float, end_s: float, panel_s: float) -> tuple[FloatArray, FloatArray]:
    """Return times and weights of Gauss–Legendre quadrature in panels no longer than `panel_s`."""
    node, weight = PANEL
    edges = np.linspace(start_s, end_s, math.ceil((end_s - start_s) / panel_s) + 1)
    half, middle = np.diff(edges)[:, None] / 2, (edges[:-1, None] + edges[1:, None]) / 2
    return (middle + half * node).ravel(), (half * weight).ravel()


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
        """True while there is an arc."""
        return self.switches[-1][1]

    @property
    def was_on(self) -> bool:
        """True if there has ever been an arc."""
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
