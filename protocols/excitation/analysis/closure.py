"""Closure: charging by the lamp itself, predicted from charges through the filter."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np

from labrig.fit.excitation import Charging, RelativeSigmas, closure, levels_at_off
from labrig.foundation.arrays import FloatArray
from labrig.material import dark_concentration
from labrig.protocols.excitation.result import PatchCharging
from labrig.results import ChargingSeries, Closure, FittedExcitation

#: Step of the derivatives as a fraction of σ, or of the parameter where σ is larger than it.
STEP = 0.01


def predicted_charging(
    charging: PatchCharging,
    relative_sigmas: RelativeSigmas,
    fit_of: Callable[[PatchCharging], FittedExcitation],
) -> Closure | None:
    """Predict charging by the lamp itself from charges through the filter.

    The longest charge by the lamp itself stays in the fit, since it determines the level of charge;
    the shorter ones are predicted. With fewer than two of those there is no test, nor where the
    other charges do not determine every rate.

    Parameters
    ----------
    charging
        Charging of a patch.
    relative_sigmas
        Relative uncertainties of the measurement.
    fit_of
        Function that fits the charging without the charges that are predicted.
    """
    direct = charging.direct
    lengths = np.array([charge.off_s - charge.on_s for charge in direct.charges])
    longest = int(np.argmax(lengths))
    charge_number = np.repeat(
        np.arange(len(lengths)), [len(charge.start_s) for charge in direct.charges]
    )
    is_longest = charge_number == longest
    longest_only = replace(
        charging,
        direct=replace(direct, values=np.where(is_longest[:, None, None], direct.values, np.nan)),
    )
    channel = int(np.argmax(np.nanmean(direct.values, axis=(0, 1))))
    usable = np.asarray(np.isfinite(direct.values[..., channel]).all(axis=1))
    first = direct.first_frames(usable)
    if len(first) < 3:
        return None
    fit = fit_of(longest_only)
    if not np.isfinite(fit.covariance).all():
        return None
    rows = np.array(list(first.values()))
    charges = [direct.charges[number] for number in first]
    values, sigma = direct.values[rows, :, channel], direct.sigma[rows, :, channel]
    level = values.mean(axis=1)
    noise = np.hypot(
        np.sqrt((sigma**2).sum(axis=1)) / sigma.shape[1], relative_sigmas.flicker * level
    )
    if fit.veil is not None and direct.frame_light is not None:
        frame_light = direct.frame_light[rows, :, channel].mean(axis=1)
        level = level - fit.veil.value * frame_light
        noise = np.hypot(noise, fit.veil.sigma * frame_light)
    # Every site is under the same lamp.
    steady = direct.irradiance[0]
    charge_s = _equivalent_charge_s(direct, fit, steady)[list(first)]
    starts, exposures = (
        np.concatenate([getattr(charge, name) for charge in direct.charges])[rows]
        for name in ("start_s", "exposure_s")
    )
    dark_s = starts - np.array([charge.off_s for charge in charges])
    initial = _initial_concentrations(direct, fit)[:, list(first)]
    order = np.array([state.kinetic_order for state in fit.states])

    n, end = len(fit.states), 2 * len(fit.states) + fit.k_e().size

    def predicted(theta: FloatArray) -> FloatArray:
        """Return the levels by k_r, amplitudes, k_e, fitted orders and ln of the light."""
        light = steady * np.exp(theta[-1])
        sample = Charging(
            theta[2 * n : end].reshape(n, -1),
            theta[:n],
            theta[n : 2 * n],
            light,
            theta[end:-1] if fit.are_orders_fitted else order,
        )
        return sample.level(charge_s, initial, dark_s, exposures)

    theta = np.array(
        [
            *(state.k_r_per_s for state in fit.states),
            *(state.amplitude for state in fit.states),
            *fit.k_e().ravel(),
            *(order if fit.are_orders_fitted else ()),
            0.0,
        ]
    )
    theta_sigma = np.sqrt(np.append(np.diag(fit.covariance), max(relative_sigmas.scale, 1e-6) ** 2))
    # Rates without a level have a σ larger than themselves, and must stay above 0.
    size = np.ones(len(theta))
    size[: 2 * n] = theta[: 2 * n]
    size[2 * n : end] = np.repeat(fit.k_e().max(axis=1), fit.k_e().shape[1])
    slopes = _slopes(predicted, theta, np.minimum(theta_sigma, size))
    cold_deficit = np.array([charge.cold_deficit for charge in charges])
    charge_variance = slopes[-1] ** 2 * (
        relative_sigmas.scale**2
        + fit.lamp_sigma**2
        + (relative_sigmas.cold_deficit * cold_deficit) ** 2
    )
    rate_variance = np.einsum("ic,ij,jc->c", slopes[:-1], fit.covariance, slopes[:-1])
    return closure(
        charge_s,
        level,
        np.sqrt(noise**2 + np.maximum(rate_variance, 0.0) + charge_variance),
        irradiance=steady,
        k_e_per_s=fit.k_e(),
        k_r_per_s=[state.k_r_per_s for state in fit.states],
        full_level=[state.amplitude for state in fit.states],
        r0=initial,
        dark_s=dark_s,
        exposure_s=exposures,
        kinetic_order=order,
    )


def _equivalent_charge_s(
    direct: ChargingSeries, fit: FittedExcitation, steady: FloatArray
) -> FloatArray:
    """Return the durations of the K charges in seconds, corrected for the lamp's transients."""
    weight = fit.k_e().sum(axis=0) * steady
    weight /= weight.sum()
    lost_s = direct.rise.duration_s @ (1 - direct.rise.fraction @ weight)
    gained_s = direct.fade.duration_s @ (direct.fade.fraction @ weight)
    return np.array(
        [
            charge.brightness * (charge.off_s - charge.on_s - lost_s + gained_s)
            for charge in direct.charges
        ]
    )


def _initial_concentrations(direct: ChargingSeries, fit: FittedExcitation) -> FloatArray:
    """Return what the charge before has left at every site at the start of each, (P, K, N)."""
    k_r = np.array([state.k_r_per_s for state in fit.states])
    order = np.array([state.kinetic_order for state in fit.states])
    charges = direct.charges
    level = levels_at_off(direct, k_r, fit.k_e(), fit.orders()).value
    initial = np.zeros_like(level)
    if (before := direct.before()) is not None:
        charges = (before.charges[-1], *charges)
        last = levels_at_off(before, k_r, fit.k_e(), fit.orders()).value[-1:]
        level = np.concatenate([last, level])
    waited_s = [after.on_s - charge.off_s for charge, after in pairwise(charges)]
    is_fresh = [charge.fresh for charge in charges[1:]]
    left = dark_concentration(level[:-1], k_r, order, np.array(waited_s)[:, None, None])
    initial[len(initial) - len(left) :] = np.where(np.array(is_fresh)[:, None, None], 0.0, left)
    return initial.swapaxes(0, 1)


def _slopes(
    function: Callable[[FloatArray], FloatArray], theta: FloatArray, largest: FloatArray
) -> FloatArray:
    """Return the slopes (θ, n), by differences of a fraction of each parameter's largest change."""
    steps = np.diag(STEP * np.maximum(largest, 1e-12))
    return np.array(
        [(function(theta + step) - function(theta - step)) / (2 * step.sum()) for step in steps]
    )
