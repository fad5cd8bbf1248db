"""Concentration of every site after every charge for states of general kinetic order.

The steady lamp is one exact step. Its transients last so short that in a few parts of them r^b is a
straight line of r near the level in the part's middle, and the step is that of the rate equation:
for b = 1 it is exact. A step is not affine in r, so that one charge follows the other.
"""

from typing import NamedTuple, Self

import numpy as np

from labrig.fit.excitation.charging import LEAST_KAPPA
from labrig.fit.excitation.level_slopes import Levels
from labrig.foundation.arrays import FloatArray
from labrig.material import dark_step, lit_step, mean_emission, relaxation_with_slopes
from labrig.results import Charge, ChargingSeries, Transient

#: Parts of a transient, each with its mean light.
PARTS = 4


class _State(NamedTuple):
    """Concentrations (P, N) at some time, and their derivatives; by_k_e has bands, (P, N, B).

    by_before is that by the concentration when the lamp was dark after the charge before.
    """

    value: FloatArray
    by_k_r: FloatArray
    by_order: FloatArray
    by_k_e: FloatArray
    by_before: FloatArray

    @classmethod
    def of(cls, value: FloatArray, bands: int) -> Self:
        """Return concentrations that depend on nothing."""
        nothing = np.zeros_like(value)
        return cls(value, nothing, nothing, np.zeros((*value.shape, bands)), nothing)

    def stepped(
        self,
        value: FloatArray,
        by_start: FloatArray,
        by_k_r: FloatArray,
        by_order: FloatArray,
        by_k_e: FloatArray | float = 0.0,
    ) -> Self:
        """Return the state after a step with these derivatives."""
        return type(self)(
            value,
            by_start * self.by_k_r + by_k_r,
            by_start * self.by_order + by_order,
            by_start[..., None] * self.by_k_e + by_k_e,
            by_start * self.by_before,
        )


class _Sample(NamedTuple):
    """Rates of N states and the light of P sites in B bands."""

    k_r_per_s: FloatArray
    k_e_per_s: FloatArray
    order: FloatArray
    irradiance: FloatArray

    def in_steady_light(self, state: _State, brightness: float, duration_s: float) -> _State:
        """Return the state after constant light."""
        light = brightness * self.irradiance
        kappa = np.maximum(light @ self.k_e_per_s.T, LEAST_KAPPA)
        step = lit_step(state.value, kappa, self.k_r_per_s, self.order, duration_s)
        by_k_e = step.by_kappa[..., None] * light[:, None, :]
        return state.stepped(step.value, step.by_start, step.by_k_r, step.by_order, by_k_e)

    def in_darkness(self, state: _State, duration_s: float) -> _State:
        """Return the state after darkness."""
        return state.stepped(*dark_step(state.value, self.k_r_per_s, self.order, duration_s))

    def in_transient(self, state: _State, brightness: float, parts: "_Parts") -> _State:
        """Return the state after a transient of the lamp."""
        for duration_s, fraction in parts:
            light = brightness * fraction * self.irradiance
            state = self._in_short_light(state, light, duration_s)
        return state

    def _in_short_light(self, state: _State, light: FloatArray, duration_s: float) -> _State:
        """Return the state after light so short that r hardly changes."""
        kappa, k, b, r = light @ self.k_e_per_s.T, self.k_r_per_s, self.order, state.value
        power = r ** (b - 1)
        growth = kappa * (1 - r) - k * r * power
        middle = r + growth * duration_s / (2 + (kappa + b * k * power) * duration_s)
        power = middle ** (b - 1)
        escape, drift = b * k * power, (b - 1) * k * middle * power
        step, slopes = relaxation_with_slopes(kappa + drift, escape - drift, duration_s)
        after = step.kept * r + step.gained
        by_escape = slopes.kept * r + slopes.gained_by_k_r
        by_drift = slopes.gained_by_kappa - slopes.gained_by_k_r
        log_middle = np.log(np.maximum(middle, np.finfo(float).tiny))
        return state.stepped(
            after,
            step.kept,
            (by_escape * escape + by_drift * drift) / k,
            by_escape * escape * (1 / b + log_middle)
            + by_drift * k * middle * power * (1 + (b - 1) * log_middle),
            (slopes.kept * r + slopes.gained_by_kappa)[..., None] * light[:, None, :],
        )


def levels_after_charges(
    series: ChargingSeries, k_r_per_s: FloatArray, k_e_per_s: FloatArray, order: FloatArray
) -> Levels:
    """Return the concentrations after every charge, when the lamp is dark.

    Charges before the series come first.
    """
    sample = _Sample(k_r_per_s, k_e_per_s, order, series.irradiance)
    return Levels(*(np.stack(parts) for parts in _columns(_after_charges(series, sample))))


def _after_charges(series: ChargingSeries, sample: _Sample) -> list[_State]:
    """Return the states after every charge, those before the series first."""
    shape = series.sites, len(sample.k_r_per_s)
    bands = series.irradiance.shape[1]
    empty = _State.of(np.zeros(shape), bands)
    transients = _parts(series.rise), _parts(series.fade)
    state, dark_s, ends = empty, -np.inf, []
    if (earlier := series.before()) is not None:
        ends = _after_charges(earlier, sample._replace(irradiance=earlier.irradiance))
        state = ends[-1]
        dark_s = earlier.charges[-1].off_s + earlier.fade.total_s
    elif series.start is not None:
        state = _State.of(np.broadcast_to(series.start, shape), bands)
        dark_s = series.charges[0].on_s
    for charge in series.charges:
        if charge.saturated:
            full = _State.of(np.ones(shape), bands)
            state = sample.in_darkness(full, series.fade.total_s)
        else:
            is_empty = charge.fresh or np.isinf(dark_s)
            if is_empty:
                state = empty
            else:
                left = state._replace(by_before=np.ones(shape))
                state = sample.in_darkness(left, charge.on_s - dark_s)
            lit = sample._replace(irradiance=series.irradiance_of(charge))
            state = _charged(lit, state, transients, charge)
        dark_s = charge.off_s + series.fade.total_s
        ends.append(state)
    return ends


def decayed(levels: Levels, k_r_per_s: FloatArray, order: FloatArray, t_s: FloatArray) -> Levels:
    """Return concentrations in the dark `t_s` (n,) later."""
    return _chained(levels, *dark_step(levels.value, k_r_per_s, order, t_s[:, None, None]))


def emitted(
    levels: Levels, k_r_per_s: FloatArray, order: FloatArray, exposure_s: FloatArray
) -> Levels:
    """Return the light of the states over that of full ones, mean over exposures (n,)."""
    length_s = exposure_s[:, None, None]
    return _chained(levels, *mean_emission(levels.value, k_r_per_s, order, length_s))


def _charged(
    sample: _Sample, state: _State, transients: tuple["_Parts", "_Parts"], charge: Charge
) -> _State:
    """Return the state after a charge, when the lamp is dark."""
    rise, fade = transients
    steady_s = charge.off_s - charge.on_s - sum(duration_s for duration_s, _ in rise)
    state = sample.in_transient(state, charge.brightness, rise)
    state = sample.in_steady_light(state, charge.brightness, steady_s)
    return sample.in_transient(state, charge.brightness, fade)


#: Duration in s and mean fraction (B,) of each part of a transient.
_Parts = list[tuple[float, FloatArray]]


def _parts(transient: Transient) -> _Parts:
    """Divide a transient into few parts; an instant one has none."""
    steps = len(transient.duration_s) if transient.total_s else 0
    return [
        (
            float(transient.duration_s[part].sum()),
            np.average(transient.fraction[part], axis=0, weights=transient.duration_s[part]),
        )
        for part in np.array_split(np.arange(steps), min(PARTS, steps) or 1)
        if len(part)
    ]


def _chained(
    levels: Levels,
    value: FloatArray,
    by_start: FloatArray,
    by_k_r: FloatArray,
    by_order: FloatArray,
) -> Levels:
    return Levels(
        value,
        by_start * levels.by_k_r + by_k_r,
        by_start[..., None] * levels.by_k_e,
        by_start * levels.by_order + by_order,
        by_start * levels.by_before,
    )


def _columns(states: list[_State]) -> tuple[list[FloatArray], ...]:
    """Return values and derivatives of all charges in the order of `Levels`."""
    return (
        [state.value for state in states],
        [state.by_k_r for state in states],
        [state.by_k_e for state in states],
        [state.by_order for state in states],
        [state.by_before for state in states],
    )
