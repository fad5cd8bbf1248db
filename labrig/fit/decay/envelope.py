"""A smooth curve that no choice of model has shaped, to measure the noise against.

Sums of positive exponentials with *any* number of rates are all the completely monotone functions
(Bernstein's theorem): every sum of exponentials, and every power law and stretched exponential, too.
Non-negative least squares over a grid of rates, refined where it puts weight, finds the best of them.
What scatters about it is noise, whatever the number of states: so flicker measured here cannot hide a
missing state or a power law.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq, nnls

from labrig.fit.decay.series import DecaySeries
from labrig.fit.decay.shapes import exponential_means
from labrig.fit.decay.whitening import WhitenedSeries, whitened
from labrig.fit.least_squares import FloatArray

COARSE_RATES = 48
#: Each round puts this many rates between two former neighbours.
REFINEMENT = 4
#: Rounds: grid ratio 1.2 → 1.003, curve off by < 1e−5.
ROUNDS = 3
#: Turns of curve, channel weights and flicker; of curve and weights if the flicker is given.
ALTERNATIONS = 5
ALTERNATIONS_IF_GIVEN = 2


@dataclass(frozen=True)
class Envelope:
    """The best completely monotone curve, and the noise about it.

    Attributes
    ----------
    signal
        (n, C) without offset.
    weights
        (C,) maximum 1.
    offset
        Common to all channels.
    dof
        Frames minus the curve's degrees of freedom.
    flicker, flicker_sigma
        Relative, common to the channels of a frame.
    noise_scale
        Scatter in units of σ; 1 unless σ was not given.
    """

    signal: FloatArray
    weights: FloatArray
    offset: float
    dof: int
    flicker: float
    flicker_sigma: float
    noise_scale: float


def envelope(series: DecaySeries, flicker: float | None) -> Envelope:
    """Curve, channel weights and, if `flicker` is None, the flicker; by turns.

    One channel with noise given needs none of these: the envelope is then flat.
    """
    weights = _first_weights(series)
    signal = np.zeros_like(series.values)
    offset, rho, rho_sigma, dof = 0.0, 0.0, 0.0, series.n_frames
    if len(weights) == 1 and flicker == 0 and series.sigma_given:
        return Envelope(signal, np.ones(1), offset, dof, rho, rho_sigma, 1.0)
    for _ in range(ALTERNATIONS if flicker is None else ALTERNATIONS_IF_GIVEN):
        data = whitened(series, signal, rho)
        curve, offset, support = _monotone_curve(data, weights)
        dof = max(series.n_frames - support, 1)
        if len(weights) > 1:
            weights, curve = _channel_weights(data, curve, offset)
        signal = np.multiply.outer(curve, weights)
        if flicker is None:
            rho, rho_sigma = _flicker(series, signal, offset, dof)
        else:
            rho = flicker
    noise_scale = 1.0
    if not series.sigma_given:
        left = series.inverse_sigma * (series.values - signal - offset)
        noise_scale = float(np.sqrt((left**2).sum() / dof))
    return Envelope(signal, weights, offset, dof, rho, rho_sigma, noise_scale)


def _first_weights(series: DecaySeries) -> FloatArray:
    """Channels by the values where the signal is, relative to the brightest."""
    information = (series.values * series.inverse_sigma**2).sum(axis=1)
    common = np.maximum(information, 0) / np.maximum((series.inverse_sigma**2).sum(axis=1), 1e-300)
    weights = np.maximum(common @ series.values, 0)
    return weights / weights.max() if weights.max() > 0 else np.ones_like(weights)


def _monotone_curve(data: WhitenedSeries, weights: FloatArray) -> tuple[FloatArray, float, int]:
    """The curve (n,), the offset, and how many degrees of freedom they took."""
    series = data.series
    low, high = series.log_rate_bounds
    log_rates = np.linspace(low, high, COARSE_RATES)
    step = (high - low) / (COARSE_RATES - 1)
    for refinement in range(ROUNDS + 1):
        means = exponential_means(np.exp(log_rates), series.t, series.exposure)
        amplitudes, offset = _nonnegative(data, weights, means)
        used = amplitudes > 0
        if refinement < ROUNDS:
            step /= REFINEMENT
            around = step * np.arange(-REFINEMENT, REFINEMENT + 1)
            log_rates = np.unique(np.add.outer(log_rates[used], around).round(12))
            log_rates = np.clip(log_rates, low, high)
    return means @ amplitudes, offset, int(used.sum()) + int(series.has_offset)


def _nonnegative(
    data: WhitenedSeries, weights: FloatArray, means: FloatArray
) -> tuple[FloatArray, float]:
    """Amplitudes ≥ 0 (m,) of the columns of `means` (n, m), and an offset of either sign."""
    unit = data.unit_signal(weights)
    design = (unit[:, :, None] * means[:, None, :]).reshape(unit.size, -1)
    target = data.values.ravel()
    if data.series.has_offset:
        ones = data.ones.reshape(-1, 1)
        design = np.hstack([design, ones, -ones])
        prior = np.zeros((1, design.shape[1]))
        prior[0, -2:] = np.array([1.0, -1.0]) / data.series.offset_sigma
        design = np.vstack([design, prior])
        target = np.append(target, 0.0)
    amplitudes, _ = nnls(design, target, maxiter=30 * design.shape[1])
    if data.series.has_offset:
        return amplitudes[:-2], float(amplitudes[-2] - amplitudes[-1])
    return amplitudes, 0.0


def _channel_weights(
    data: WhitenedSeries, curve: FloatArray, offset: float
) -> tuple[FloatArray, FloatArray]:
    """Weights (maximum 1) that explain the values by `curve`, and the curve in their units."""
    design = (data.matrices * curve[:, None, None]).reshape(-1, data.matrices.shape[2])
    target = (data.values - offset * data.ones).ravel()
    weights = np.maximum(np.linalg.lstsq(design, target)[0], 0)
    brightest = float(weights.max())
    if brightest == 0:
        return np.ones_like(weights), curve
    return weights / brightest, curve * brightest


def _flicker(
    series: DecaySeries, signal: FloatArray, offset: float, dof: int
) -> tuple[float, float]:
    """ρ and its σ from the frames' common scatter about the curve, less the values' own noise.

    Along the signal's direction û = (s/σ)/|s/σ| a frame scatters with variance 1 + ρ²|s/σ|²; ρ² is
    what makes the weighted sum of squares equal to the degrees of freedom (Mandel and Paule 1970).
    """
    u = signal * series.inverse_sigma
    brightness2 = np.einsum("fc,fc->f", u, u)
    left = series.inverse_sigma * (series.values - signal - offset)
    along2 = np.einsum("fc,fc->f", u, left) ** 2 / np.maximum(brightness2, 1e-300)

    def surplus(variance: float) -> float:
        return float((along2 / (1 + variance * brightness2)).sum()) - dof

    variance = 0.0
    if surplus(0.0) > 0:
        highest = float((along2 / np.maximum(brightness2, 1e-300)).sum()) / dof + 1e-30
        while surplus(highest) > 0:
            highest *= 4
        variance = float(brentq(surplus, 0.0, highest, xtol=1e-16, rtol=1e-10))
    information = float(((brightness2 / (1 + variance * brightness2)) ** 2).sum())
    variance_sigma = float(np.sqrt(2 * series.n_frames / dof / information))
    flicker = float(np.sqrt(variance))
    # Near zero the square root is not linear: then √σ(ρ²) is the scale of what ρ could be.
    return flicker, min(variance_sigma / (2 * max(flicker, 1e-30)), float(np.sqrt(variance_sigma)))
