"""What the states of a material re-radiate at the keys, for one Λ, with derivatives.

Light is constant in each step, so the rate equation is solved exactly. Of the first order r at a
key is a sum over all steps before it, r = Σ_j g_j e^(S_j − S) with g_j what step j gains from an
empty state, and S the sum of (κ + k_r) τ up to the end of a step: one product of matrices instead
of a loop, for the derivatives, too.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from labrig.design.light import Steps
from labrig.foundation.arrays import FloatArray
from labrig.material import (
    dark_step,
    lit_concentration,
    lit_step,
    phi1,
    phi2,
    relaxation_with_slopes,
)

#: κ τ of a step below which its light excites nothing.
NO_LIGHT = 1e-200
#: Parts of a step over which a level is integrated.
PARTS = 64


class Emission(NamedTuple):
    """Emission k_r rᵇ of states at the keys, and its derivatives.

    Attributes
    ----------
    value
        Emission in 1/s, shape (…, keys).
    slopes
        Derivatives by k_e of each band, by log k_r and by b, shape (…, keys, bands + 2).
    """

    value: FloatArray
    slopes: FloatArray


def emission(
    steps: Sequence[Steps], n_keys: int, k_e: FloatArray, k_r: FloatArray, order: float
) -> Emission:
    """Return the emission of states at all keys.

    Parameters
    ----------
    steps
        Steps of each place.
    n_keys
        Number of keys.
    k_e
        Excitation rates in 1/s per irradiance, shape (…, bands).
    k_r
        Re-radiation rates in 1/s, shape (…).
    order
        Kinetic order b ≥ 1 of all.
    """
    if order != 1:
        return _of_order(steps, n_keys, k_e, k_r, order)
    value = np.zeros((*k_r.shape, n_keys))
    slopes = np.zeros((*k_r.shape, n_keys, k_e.shape[-1] + 2))
    for place in steps:
        if len(place.duration_s):
            level, by_rate = _first_order(place, k_e, k_r)
            value[..., place.keys], slopes[..., place.keys, :-1] = level, by_rate
    value *= k_r[..., np.newaxis]
    slopes *= k_r[..., np.newaxis, np.newaxis]
    slopes[..., -2] += value
    return Emission(value, slopes)


def _of_order(
    steps: Sequence[Steps], n_keys: int, k_e: FloatArray, k_r: FloatArray, order: float
) -> Emission:
    value = np.zeros((*k_r.shape, n_keys))
    slopes = np.zeros((*k_r.shape, n_keys, k_e.shape[-1] + 2))
    for index in np.ndindex(k_r.shape):
        rate = float(k_r[index])
        for place in steps:
            level, by_level = _by_steps(place, k_e[index], rate, order)
            is_charged = level > 0
            safe = np.where(is_charged, level, 1.0)
            power = np.where(is_charged, safe ** (order - 1), 0.0)
            by_level = by_level * (rate * order * power)[:, np.newaxis]
            glow = rate * level * power
            by_level[:, -2] += glow
            by_level[:, -1] += glow * np.log(safe)
            value[(*index, place.keys)] = glow
            slopes[(*index, place.keys)] = by_level
    return Emission(value, slopes)


def grid_emission(
    steps: Sequence[Steps], n_keys: int, k_e: FloatArray, k_r: FloatArray
) -> FloatArray:
    """Return the emission of many states of the first order at all keys.

    Parameters
    ----------
    steps
        Steps of each place.
    n_keys
        Number of keys.
    k_e
        Excitation rates, shape (n, bands).
    k_r
        Re-radiation rates in 1/s, shape (m,); every one with every k_e.

    Returns
    -------
    ndarray
        Emission in 1/s, shape (n, m, keys).
    """
    found = np.zeros((n_keys, len(k_e), len(k_r)))
    for place in steps:
        level = np.zeros((len(k_e), len(k_r)))
        kappa = k_e @ place.irradiance.T
        lit = np.exp(-kappa * place.duration_s)
        dark = np.exp(-np.multiply.outer(place.duration_s, k_r))
        at_end: dict[int, list[int]] = {}
        for key, taken in zip(place.keys.tolist(), place.taken.tolist(), strict=True):
            at_end.setdefault(taken, []).append(key)
        for number in range(len(place.duration_s)):
            steady = kappa[:, number, np.newaxis] / (kappa[:, number, np.newaxis] + k_r)
            level -= steady
            level *= lit[:, number, np.newaxis]
            level *= dark[number]
            level += steady
            for key in at_end.get(number + 1, ()):
                found[key] = level
    found *= k_r
    return np.moveaxis(found, 0, -1)


def captures(steps: Steps, k_e: FloatArray, k_r: float, order: float) -> float:
    """Return how often a unit of material was filled during the steps.

    All of it is emitted in the end: it is the emission without end.
    """
    kappa = steps.irradiance @ k_e
    if order == 1:
        return _first_order_captures(kappa, k_r, steps.duration_s)
    total, level = 0.0, 0.0
    for rate, duration in zip(kappa.tolist(), steps.duration_s.tolist(), strict=True):
        if rate * duration < NO_LIGHT:
            level = float(dark_step(level, k_r, order, duration).value)
            continue
        # The level is nearly a parabola in each of many parts: Simpson's rule.
        ends = duration * np.linspace(0, 1, PARTS + 1) ** 2
        middles = (ends[1:] + ends[:-1]) / 2
        levels = lit_concentration(level, rate, k_r, order, ends)
        inside = lit_concentration(level, rate, k_r, order, middles)
        total += float(np.diff(ends) @ (rate * (1 - (levels[1:] + levels[:-1] + 4 * inside) / 6)))
        level = float(levels[-1])
    return total


def _first_order_captures(kappa: FloatArray, k_r: float, duration_s: FloatArray) -> float:
    """Return ∫ κ (1 − r) dt."""
    x = (kappa + k_r) * duration_s
    kept, first = np.exp(-x), phi1(x)
    gained = kappa * duration_s * first
    levels = np.zeros(len(kappa))
    level = 0.0
    for number, (fraction, more) in enumerate(zip(kept.tolist(), gained.tolist(), strict=True)):
        levels[number] = level
        level = fraction * level + more
    mean = levels * first + kappa * duration_s * phi2(x)
    return float((kappa * duration_s * (1 - mean)).sum())


def _first_order(steps: Steps, k_e: FloatArray, k_r: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return levels (…, k), and their slopes by k_e and log k_r (…, k, bands + 1), of a place."""
    tau = steps.duration_s
    kappa = k_e @ steps.irradiance.T
    rate = k_r[..., np.newaxis]
    step, by = relaxation_with_slopes(kappa, rate, tau)
    # Slopes of g, and those of S, which are sums.
    shape = (*kappa.shape, k_e.shape[-1] + 1)
    gained, summed = np.empty(shape), np.empty(shape)
    gained[..., :-1] = by.gained_by_kappa[..., np.newaxis] * steps.irradiance
    gained[..., -1] = by.gained_by_k_r * rate
    summed[..., :-1] = np.cumsum(steps.irradiance * tau[:, np.newaxis], axis=0)
    summed[..., -1] = np.cumsum(tau) * rate
    total = np.cumsum((kappa + rate) * tau, axis=-1)
    at_key = steps.taken - 1
    is_before = np.arange(len(tau)) <= at_key[:, np.newaxis]
    phase = total[..., at_key, np.newaxis] - total[..., np.newaxis, :]
    left = np.exp(-np.where(is_before, phase, np.inf))
    level = (left @ step.gained[..., np.newaxis])[..., 0]
    slopes = left @ (gained + step.gained[..., np.newaxis] * summed)
    slopes -= level[..., np.newaxis] * summed[..., at_key, :]
    return level, slopes


def _by_steps(
    steps: Steps, k_e: FloatArray, k_r: float, order: float
) -> tuple[FloatArray, FloatArray]:
    """Return levels and slopes at the keys of a place, for an order above 1."""
    levels = np.zeros(len(steps.duration_s) + 1)
    slopes = np.zeros((len(levels), len(k_e) + 2))
    kappa = steps.irradiance @ k_e
    for number, duration in enumerate(steps.duration_s):
        level, now = levels[number], number + 1
        if kappa[number] * duration < NO_LIGHT:
            dark = dark_step(level, k_r, order, duration)
            levels[now], by_start, by_k_r, by_order = (float(each) for each in dark)
            slopes[now] = by_start * slopes[number]
        else:
            lit = lit_step(level, kappa[number], k_r, order, duration)
            levels[now], by_start, by_kappa, by_k_r, by_order = (float(each) for each in lit)
            slopes[now] = by_start * slopes[number]
            slopes[now, :-2] += by_kappa * steps.irradiance[number]
        slopes[now, -2] += by_k_r * k_r
        slopes[now, -1] += by_order
    return levels[steps.taken], slopes[steps.taken]
