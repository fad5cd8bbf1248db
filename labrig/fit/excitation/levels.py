"""Concentration of every site at every exposure, with derivatives: exact steps, no integrator.

κ = Σ_j k_e,j E_j is constant within a step: the steady lamp is one, its turn-on and turn-off
transients a few dozen. Of first order steps are affine in r, and so is a charge: all charges of a
series are computed at once, each from r = 0, and then chained.

The steady lamp is one exact step. Its transients last so short that in a few parts of them r^b is a
straight line of r near the level in the part's middle, and the step is that of the rate equation:
for b = 1 it is exact. A step is not affine in r, so that one charge follows the other.
"""

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from labrig.fit.excitation.charging import MIN_KAPPA
from labrig.foundation.arrays import FloatArray, IntArray
from labrig.material import dark_step, lit_step, mean_emission, phi1, phi2, relaxation_with_slopes
from labrig.results import Charge, ChargingSeries, Transient


class Levels(NamedTuple):
    """Concentrations of N states at P sites, and their derivatives.

    Attributes
    ----------
    value
        Concentrations r, or light over that of full states rᵇ, mean over each exposure, shape (n,
        P, N).
    by_k_r
        Derivatives by the state's own k_r in s, shape (n, P, N).
    by_k_e
        Derivatives by the state's own k_e of every band in s, shape (n, P, N, B).
    by_order
        Derivatives by the state's own kinetic order, shape (n, P, N); 0 where it is held at 1.
    by_before
        Derivatives by the concentration that the charge before has left when its lamp was dark, or
        by that at the start, shape (n, P, N); 0 where there was neither.
    """

    value: FloatArray
    by_k_r: FloatArray
    by_k_e: FloatArray
    by_order: FloatArray
    by_before: FloatArray

    def of(self, which: NDArray[np.intp]) -> "Levels":
        """Return the levels at some indices, in their order."""
        return Levels(*(part[which] for part in self))

    def followed_by(self, later: "Levels") -> "Levels":
        """Return the levels, and later ones after them."""
        return Levels(*(np.concatenate(parts) for parts in zip(self, later, strict=True)))

    def meaned(self, places: int) -> "Levels":
        """Average over `places` per site, given all sites for one place after the other."""
        parts = (part.reshape(len(part), places, -1, *part.shape[2:]) for part in self)
        return Levels(*(part.mean(axis=1) for part in parts))

    def decayed(self, k_r_per_s: FloatArray, t_s: FloatArray, exposure_s: FloatArray) -> "Levels":
        """Return the levels in the dark of first order.

        They are averaged over exposures that begin `t_s` later, shape (n,).
        """
        t, x = t_s[:, None, None], exposure_s[:, None, None] * k_r_per_s
        mean = phi1(x)
        decay = np.exp(-k_r_per_s * t) * mean
        slope = exposure_s[:, None, None] * (phi2(x) - mean) / mean - t
        return Levels(
            self.value * decay,
            (self.by_k_r + self.value * slope) * decay,
            self.by_k_e * decay[..., None],
            self.by_order,
            self.by_before * decay,
        )


def mean_levels(of_parts: Sequence[Levels]) -> Levels:
    """Return the levels of a sample whose parts, each as large, have these."""
    return Levels(*(sum(values) / len(values) for values in zip(*of_parts, strict=True)))


class _Charges(NamedTuple):
    """Effect of K charges on r, from lamp on until the lamp is dark: r → kept r + gained.

    Attributes
    ----------
    elapsed_s, dose
        Derivatives −∂ ln kept by k_r in s (K,) and by k_e in s (K, P, B).
    kept
        Fraction of the initial concentration that is kept, shape (K, P, N).
    gained
        Levels reached from 0, n = K.
    """

    elapsed_s: FloatArray
    dose: FloatArray
    kept: FloatArray
    gained: Levels


class _Before(NamedTuple):
    """Concentrations (P, N) after a charge, when the lamp is dark at `dark_s`, and derivatives."""

    dark_s: float
    value: FloatArray
    by_k_r: FloatArray
    by_k_e: FloatArray


def levels(
    series: ChargingSeries,
    k_r_per_s: FloatArray,
    k_e_per_s: FloatArray,
    order: FloatArray | None = None,
) -> Levels:
    """Return the light rᵇ of all exposures of a series, over that of full states.

    Parameters
    ----------
    series
        The charging series.
    k_r_per_s, k_e_per_s
        Re-radiation rates (N,) and excitation rates (N, B) in 1/s.
    order
        Kinetic orders (N,); None: all are 1, and no derivative by them is wanted.
    """
    if (places := series.places) > 1:
        return levels(series.spread(), k_r_per_s, k_e_per_s, order).meaned(places)
    if series.arriving is not None:
        return mean_levels([levels(one, k_r_per_s, k_e_per_s, order) for one in series.at_depths()])
    after_charges = _levels_after_charges(series, k_r_per_s, k_e_per_s, order)
    return _photographed(series, after_charges, k_r_per_s, order)


def levels_and_slopes(
    series: ChargingSeries,
    k_r_per_s: FloatArray,
    k_e_per_s: FloatArray,
    order: FloatArray | None = None,
) -> tuple[Levels, FloatArray, FloatArray]:
    """Return the `levels`, and their derivatives by the light and by the start.

    What a charge has left at those after it is in them. Charges before the series come first.

    Returns
    -------
    levels, by_light, by_start
        Levels, and their derivatives by ln E of every charge and band, shape (n, K, P, N, B), and
        by the concentrations at the start, shape (n, P, N).
    """
    # Of first order the light of parts is that of their mean concentration, of other orders it is
    # not.
    if order is not None and (places := series.places) > 1:
        level, by_light, by_start = levels_and_slopes(series.spread(), k_r_per_s, k_e_per_s, order)
        return level.meaned(places), _meaned(by_light, 2, places), _meaned(by_start, 1, places)
    if order is not None and series.arriving is not None:
        each = [levels_and_slopes(one, k_r_per_s, k_e_per_s, order) for one in series.at_depths()]
        of_levels, lights, starts = zip(*each, strict=True)
        return mean_levels(of_levels), _mean(lights), _mean(starts)
    after, by_each, by_start = _left_by_charges(series, k_r_per_s, k_e_per_s, order)
    level = _photographed(series, after, k_r_per_s, order)
    of_charge, by_after = _charge_of_shots(series, len(after.value)), level.by_before
    return level, by_after[:, None, ..., None] * by_each[of_charge], by_after * by_start[of_charge]


def _left_by_charges(
    series: ChargingSeries, k_r_per_s: FloatArray, k_e_per_s: FloatArray, order: FloatArray | None
) -> tuple[Levels, FloatArray, FloatArray]:
    """Return concentrations when the lamp is dark after every charge, and derivatives.

    Of parts of a sample and of places within the sites they are means. The derivatives are those of
    `levels_and_slopes`, shape (K, K, P, N, B) and (K, P, N); `by_before` is 1, so that of a
    photograph it is that by what its charge has left.
    """
    if (places := series.places) > 1:
        after, by_light, by_begin = _left_by_charges(series.spread(), k_r_per_s, k_e_per_s, order)
        return after.meaned(places), _meaned(by_light, 2, places), _meaned(by_begin, 1, places)
    if series.arriving is not None:
        each = [_left_by_charges(one, k_r_per_s, k_e_per_s, order) for one in series.at_depths()]
        of_levels, of_light, of_start = zip(*each, strict=True)
        return mean_levels(of_levels), _mean(of_light), _mean(of_start)
    after = _levels_after_charges(series, k_r_per_s, k_e_per_s, order)
    charges = len(after.value)
    # By all light until then, by that of each charge, and by the start, before every charge.
    by_all = np.zeros((charges + 1, *after.by_k_e.shape[1:]))
    by_each = np.zeros((charges + 1, charges, *after.by_k_e.shape[1:]))
    by_start = np.ones((charges + 1, *after.value.shape[1:]))
    by_all[1:] = after.by_k_e * k_e_per_s
    for number, kept in enumerate(after.by_before):
        by_each[number + 1] = kept[..., None] * by_each[number]
        by_each[number + 1, number] = by_all[number + 1] - kept[..., None] * by_all[number]
        by_start[number + 1] = kept * by_start[number]
    return after._replace(by_before=np.ones_like(after.value)), by_each[1:], by_start[1:]


def _mean(parts: Sequence[FloatArray]) -> FloatArray:
    return np.asarray(sum(parts) / len(parts))


def _meaned(values: FloatArray, axis: int, places: int) -> FloatArray:
    """Average over `places` per site, given all sites for one place after the other in an axis."""
    shape = (*values.shape[:axis], places, -1, *values.shape[axis + 1 :])
    return np.asarray(values.reshape(shape).mean(axis=axis))


def levels_at_off(
    series: ChargingSeries,
    k_r_per_s: FloatArray,
    k_e_per_s: FloatArray,
    order: FloatArray | None = None,
) -> Levels:
    """Return the concentrations after every charge of the series, traced back to lamp off.

    The turn-off transient itself charges a little: this is the r(0) to which the amplitude of a
    decay belongs. The arguments are those of `levels`.
    """
    zeros = np.zeros(len(series.charges))
    back_s = zeros - series.fade.total_s
    after_charges = _levels_after_charges(series, k_r_per_s, k_e_per_s, order)
    own = after_charges.of(np.arange(len(after_charges.value))[-len(zeros) :])
    if order is None:
        return own.decayed(k_r_per_s, back_s, zeros)
    return decayed(own, k_r_per_s, order, back_s)


def _photographed(
    series: ChargingSeries, after_charges: Levels, k_r_per_s: FloatArray, order: FloatArray | None
) -> Levels:
    """Return the light of all exposures from the levels after every charge."""
    of_charge = _charge_of_shots(series, len(after_charges.value))
    exposure_s = np.concatenate([charge.exposure_s for charge in series.charges])
    start_s = np.concatenate([charge.start_s for charge in series.charges])
    shots = [len(charge.start_s) for charge in series.charges]
    dark_s = start_s - np.repeat(_dark_s(series), shots)
    begins = after_charges.of(of_charge)
    if order is None:
        return begins.decayed(k_r_per_s, dark_s, exposure_s)
    begins = decayed(begins, k_r_per_s, order, dark_s)
    return emitted(begins, k_r_per_s, order, exposure_s)


def _charge_of_shots(series: ChargingSeries, charges: int) -> IntArray:
    """Return the number of the charge before each photograph, of `charges` that end with them."""
    first = charges - len(series.charges)
    shots = [len(charge.start_s) for charge in series.charges]
    return np.repeat(np.arange(first, charges), shots)


def _dark_s(series: ChargingSeries) -> FloatArray:
    """Return the time at which the lamp is dark after each charge, in s, shape (K,)."""
    return np.array([charge.off_s for charge in series.charges]) + series.fade.total_s


def _levels_after_charges(
    series: ChargingSeries, k_r_per_s: FloatArray, k_e_per_s: FloatArray, order: FloatArray | None
) -> Levels:
    """Return the levels after every charge in the dark, those before the series first."""
    if order is not None:
        return levels_after_charges(series, k_r_per_s, k_e_per_s, order)
    charges = _independent_charges(series, k_r_per_s, k_e_per_s)
    value, by_k_r, by_k_e, _, by_before = charges.gained
    before, dark_s, after_earlier = None, _dark_s(series), None
    if (earlier := series.before()) is not None:
        after_earlier = _levels_after_charges(earlier, k_r_per_s, k_e_per_s, None)
        before = _Before(
            float(_dark_s(earlier)[-1]),
            after_earlier.value[-1],
            after_earlier.by_k_r[-1],
            after_earlier.by_k_e[-1],
        )
    elif series.start is not None:
        at_start = np.broadcast_to(series.start, value.shape[1:])
        nothing = np.zeros_like(value[0]), np.zeros_like(by_k_e[0])
        before = _Before(series.charges[0].on_s, at_start, *nothing)
    for number, charge in enumerate(series.charges):
        if charge.saturated:
            value[number] = np.exp(-k_r_per_s * series.fade.total_s)
            by_k_r[number] = -series.fade.total_s * value[number]
            by_k_e[number] = 0.0
        elif before is not None and not charge.fresh:
            wait_s = charge.on_s - before.dark_s
            decay = charges.kept[number] * np.exp(-k_r_per_s * wait_s)
            elapsed_s = charges.elapsed_s[number] + wait_s
            value[number] += decay * before.value
            by_k_r[number] += decay * (before.by_k_r - elapsed_s * before.value)
            by_k_e[number] += decay[..., None] * (
                before.by_k_e - before.value[..., None] * charges.dose[number, :, None]
            )
            by_before[number] = decay
        before = _Before(float(dark_s[number]), value[number], by_k_r[number], by_k_e[number])
    return charges.gained if after_earlier is None else after_earlier.followed_by(charges.gained)


def _independent_charges(
    series: ChargingSeries, k_r_per_s: FloatArray, k_e_per_s: FloatArray
) -> _Charges:
    """Compute the effect of every charge on its own."""
    duration_s, fraction = _steps(series)
    brightness = np.array([charge.brightness for charge in series.charges])
    sites, bands = series.sites, series.irradiance.shape[1]
    shape = (len(brightness), sites, len(k_r_per_s))
    # Sites and states in one axis, and all charges' steps side by side: long rows for numpy.
    k_r = np.tile(k_r_per_s, sites)
    kappa = brightness[:, None] * _steady_and_changing(series, k_e_per_s, fraction)
    tau = duration_s[:, :, None]
    step, slopes = relaxation_with_slopes(kappa, k_r, tau)
    r_before = np.zeros((len(tau) + 1, *kappa.shape[1:]))
    for number in range(len(tau)):
        np.multiply(step.kept[number], r_before[number], out=r_before[number + 1])
        r_before[number + 1] += step.gained[number]
    # What is left at the end of a change after each step, and of one before the first.
    after = np.ones_like(r_before)
    np.cumprod(step.kept[::-1], axis=0, out=after[-2::-1])
    by_kappa = after[1:] * (slopes.kept * r_before[:-1] + slopes.gained_by_kappa)
    by_k_r = (after[1:] * (slopes.kept * r_before[:-1] + slopes.gained_by_k_r)).sum(axis=0)
    by_fraction = (by_kappa.reshape(len(tau), -1).T @ fraction).reshape(*shape, bands)
    irradiance = [
        np.broadcast_to(series.irradiance_of(charge), (sites, bands)) for charge in series.charges
    ]
    light = brightness[:, None, None] * np.array(irradiance)
    return _Charges(
        duration_s.sum(axis=0),
        light * (duration_s.T @ fraction)[:, None, :],
        after[0].reshape(shape),
        Levels(
            r_before[-1].reshape(shape),
            by_k_r.reshape(shape),
            by_fraction * light[:, :, None, :],
            np.zeros(shape),
            np.zeros(shape),
        ),
    )


def _steady_and_changing(
    series: ChargingSeries, k_e_per_s: FloatArray, fraction: FloatArray
) -> FloatArray:
    """Return κ in every step at brightness 1, shape (m, K, P N); (m, 1, P N) if all are alike."""
    bands = series.irradiance.shape[1]
    rates = (series.irradiance[:, None, :] * k_e_per_s).reshape(-1, bands)
    kappa = (fraction @ rates.T).reshape(len(fraction), -1, len(k_e_per_s))
    if not series.is_by_light:
        return np.asarray(kappa.reshape(len(fraction), 1, -1))
    lights = [charge.light or 0 for charge in series.charges]
    return np.tile(kappa[:, lights], (1, 1, series.sites))


def _steps(series: ChargingSeries) -> tuple[FloatArray, FloatArray]:
    """Return durations (m, K) in s and relative irradiance (m, B) of the steps of all charges."""
    rise, fade = series.rise, series.fade
    steady_s = [charge.off_s - charge.on_s - rise.total_s for charge in series.charges]
    changes = len(rise.duration_s), len(fade.duration_s)
    duration_s = np.empty((sum(changes) + 1, len(steady_s)))
    duration_s[: changes[0]] = rise.duration_s[:, None]
    duration_s[changes[0]] = steady_s
    duration_s[changes[0] + 1 :] = fade.duration_s[:, None]
    return duration_s, np.vstack([rise.fraction, np.ones(rise.fraction.shape[1]), fade.fraction])


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
        kappa = np.maximum(light @ self.k_e_per_s.T, MIN_KAPPA)
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
