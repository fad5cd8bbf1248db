"""Concentration of every site at every exposure, with derivatives: exact steps, no integrator.

κ = Σ_j k_e,j E_j is constant within a step: the steady lamp is one, its turn-on and turn-off
transients a few dozen. Of first order steps are affine in r, and so is a charge: all charges of a
series are computed at once, each from r = 0, and then chained. Other orders are those of
`levels_of_order`.
"""

from typing import NamedTuple

import numpy as np

from labrig.fit.excitation import levels_of_order
from labrig.fit.excitation.level_slopes import Levels
from labrig.material import phi1, relaxation_with_slopes
from labrig.results import ChargingSeries, FloatArray


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
    if series.across is not None:
        spread_levels = levels(series.spread(), k_r_per_s, k_e_per_s, order)
        return spread_levels.meaned(len(series.across))
    charges = series.charges
    shots = [len(charge.start_s) for charge in charges]
    exposure_s = np.concatenate([charge.exposure_s for charge in charges])
    dark_s = np.concatenate([charge.start_s for charge in charges]) - np.repeat(
        _dark_s(series), shots
    )
    of_charge = np.repeat(np.arange(len(charges)), shots)
    if order is None:
        after_charges = _levels_after_charges(series, k_r_per_s, k_e_per_s).of(of_charge)
        return after_charges.decayed(k_r_per_s, dark_s, exposure_s)
    after_charges = levels_of_order.levels_after_charges(series, k_r_per_s, k_e_per_s, order)
    begins = levels_of_order.decayed(after_charges.of(of_charge), k_r_per_s, order, dark_s)
    return levels_of_order.emitted(begins, k_r_per_s, order, exposure_s)


def levels_at_off(
    series: ChargingSeries,
    k_r_per_s: FloatArray,
    k_e_per_s: FloatArray,
    order: FloatArray | None = None,
) -> Levels:
    """Return the concentrations after every charge, traced back in the dark to lamp off.

    The turn-off transient itself charges a little: this is the r(0) to which the amplitude of a
    decay belongs. The arguments are those of `levels`.
    """
    zeros = np.zeros(len(series.charges))
    back_s = zeros - series.fade.total_s
    if order is None:
        after_charges = _levels_after_charges(series, k_r_per_s, k_e_per_s)
        return after_charges.decayed(k_r_per_s, back_s, zeros)
    after_charges = levels_of_order.levels_after_charges(series, k_r_per_s, k_e_per_s, order)
    return levels_of_order.decayed(after_charges, k_r_per_s, order, back_s)


def slopes_by_light(
    series: ChargingSeries, k_r_per_s: FloatArray, k_e_per_s: FloatArray
) -> FloatArray:
    """Return the derivatives of the levels of all exposures by ln E of every charge and band.

    Of first order, and with what a charge has left at those after it.

    Returns
    -------
    ndarray
        Derivatives, shape (n, K, P, N, B).
    """
    charges = _independent_charges(series, k_r_per_s, k_e_per_s)
    dark_s = _dark_s(series)
    own = charges.gained.by_k_e * k_e_per_s
    after = np.zeros((len(series.charges), *own.shape))
    value = charges.gained.value
    for number, charge in enumerate(series.charges):
        after[number, number] = own[number]
        if number and not charge.fresh:
            wait_s = charge.on_s - float(dark_s[number - 1])
            kept = charges.kept[number] * np.exp(-k_r_per_s * wait_s)
            left = kept * value[number - 1]
            value[number] += left
            after[number, :number] = kept[..., None] * after[number - 1, :number]
            dose = charges.dose[number, :, None] * k_e_per_s
            after[number, number] -= left[..., None] * dose
    shots = [len(charge.start_s) for charge in series.charges]
    of_charge = np.repeat(np.arange(len(shots)), shots)
    starts_s = np.concatenate([charge.start_s for charge in series.charges]) - dark_s[of_charge]
    exposure_s = np.concatenate([charge.exposure_s for charge in series.charges])
    decay = np.exp(-k_r_per_s * starts_s[:, None]) * phi1(k_r_per_s * exposure_s[:, None])
    return np.asarray(after[of_charge] * decay[:, None, None, :, None])


def _dark_s(series: ChargingSeries) -> FloatArray:
    """Return the time at which the lamp is dark after each charge, in s, shape (K,)."""
    return np.array([charge.off_s for charge in series.charges]) + series.fade.total_s


def _levels_after_charges(
    series: ChargingSeries, k_r_per_s: FloatArray, k_e_per_s: FloatArray
) -> Levels:
    """Return the levels after every charge, when the lamp is dark, n = K."""
    charges = _independent_charges(series, k_r_per_s, k_e_per_s)
    value, by_k_r, by_k_e, _ = charges.gained
    before, dark_s = _level_before(series, k_r_per_s, k_e_per_s), _dark_s(series)
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
        before = _Before(float(dark_s[number]), value[number], by_k_r[number], by_k_e[number])
    return charges.gained


def _level_before(
    series: ChargingSeries, k_r_per_s: FloatArray, k_e_per_s: FloatArray
) -> _Before | None:
    """Return the level after the last charge before the series; None if there was none."""
    earlier = series.before()
    if earlier is None:
        return None
    value, by_k_r, by_k_e, _ = _levels_after_charges(earlier, k_r_per_s, k_e_per_s)
    return _Before(float(_dark_s(earlier)[-1]), value[-1], by_k_r[-1], by_k_e[-1])


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
