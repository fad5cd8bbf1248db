"""Decays whose truth is known, made without labrig's formulae: exposures integrated numerically."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from labrig.foundation.arrays import FloatArray

#: Gauss–Legendre on [0, 1]: exact to rounding for any decay that varies less than e^10 in a frame.
_NODES, _FRACTIONS = np.polynomial.legendre.leggauss(24)
NODES, FRACTIONS = (_NODES + 1) / 2, _FRACTIONS / 2

#: A frame every 5 s for 180 s, as in Nalbach et al. sec. 4.4.
TIMES_S: FloatArray = 0.3 + 5.0 * np.arange(37, dtype=np.float64)
RGB_WEIGHTS = np.array([0.6, 1.0, 0.3])

Decay = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True)
class Observed:
    """What a camera saw of a decay; values and σ (n, C)."""

    t_s: FloatArray
    exposure_s: FloatArray
    values: FloatArray
    sigma: FloatArray


def exponentials(*states: tuple[float, float]) -> Decay:
    """Sum of a e^(−k t) over (k, a)."""
    return lambda t: np.sum([a * np.exp(-k * t) for k, a in states], axis=0)


def power_law(tau_s: float, exponent: float) -> Decay:
    """(1 + t/τ)^(−p)."""
    return lambda t: (1 + t / tau_s) ** -exponent


def stretched(tau_s: float, beta: float) -> Decay:
    """exp(−(t/τ)^β)."""
    return lambda t: np.exp(-((t / tau_s) ** beta))


def exposed(decay: Decay, t_s: FloatArray, exposure_s: FloatArray) -> FloatArray:
    """Mean of the decay over each exposure (n,)."""
    inside = t_s[:, None] + exposure_s[:, None] * NODES
    return np.asarray(decay(inside) @ FRACTIONS)


def observe(
    decay: Decay,
    seed: int,
    *,
    snr: float = 300.0,
    flicker: float = 0.007,
    exposure_s: float | FloatArray = 1.5,
    t_s: FloatArray = TIMES_S,
    weights: FloatArray = RGB_WEIGHTS,
    heavy_tails: bool = False,
    dark_sigma: float = 0.0,
) -> Observed:
    """Photon noise of `snr` at signal 1, a read noise of 1/100 of that, and flicker.

    Flicker is Gaussian, or Student's t with 3 degrees of freedom scaled to the same σ. The dark
    level of each channel is wrong by a constant of its own, of `dark_sigma`.
    """
    rng = np.random.default_rng(seed)
    exposure = np.broadcast_to(np.asarray(exposure_s, dtype=np.float64), t_s.shape)
    signal = np.multiply.outer(exposed(decay, t_s, exposure), weights)
    sigma = np.sqrt(signal + 1e-4) / snr
    shake = rng.standard_t(3, len(t_s)) / np.sqrt(3) if heavy_tails else rng.normal(size=len(t_s))
    noise = sigma * rng.normal(size=signal.shape)
    dark = dark_sigma * rng.normal(size=len(weights))
    values = signal * (1 + flicker * shake[:, None]) + noise + dark
    return Observed(t_s, exposure, values, sigma)


def fisher_rate_sigma(
    states: tuple[tuple[float, float], ...], observed: Observed, flicker: float
) -> FloatArray:
    """Cramér–Rao bound of σ(k) of `states`, weights unknown, from numerical derivatives."""

    def model(parameters: FloatArray) -> FloatArray:
        pairs = parameters[: 2 * len(states)].reshape(-1, 2)
        weights = np.insert(parameters[2 * len(states) :], 1, 1.0)
        decay = exponentials(*[(float(k), float(a)) for k, a in pairs])
        return np.multiply.outer(exposed(decay, observed.t_s, observed.exposure_s), weights)

    truth = np.concatenate([np.ravel(states), np.delete(RGB_WEIGHTS, 1)])
    signal = model(truth)
    slopes = []
    for j in range(len(truth)):
        step = np.zeros_like(truth)
        step[j] = 1e-5 * truth[j]
        slopes.append((model(truth + step) - model(truth - step)) / (2 * step[j]))
    jacobian = np.stack(slopes, axis=-1)
    covariance = np.stack(
        [
            np.diag(s**2) + flicker**2 * np.outer(y, y)
            for s, y in zip(observed.sigma, signal, strict=True)
        ]
    )
    information = np.einsum("fci,fcj->ij", jacobian, np.linalg.solve(covariance, jacobian))
    bound = np.sqrt(np.diag(np.linalg.inv(information)))
    return np.asarray(bound[0 : 2 * len(states) : 2])
