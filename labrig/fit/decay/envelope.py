"""A smooth model-independent curve to measure the noise against.

Sums of positive exponentials with *any* number of rates are all the completely monotone functions
(Bernstein's theorem), which include power laws and stretched exponentials. Non-negative least
squares over a grid of rates, refined where the weights are, finds the best of them. The scatter
about it is noise, whatever the number of states: flicker measured like this cannot hide a missing
state or a power law.
"""

from dataclasses import dataclass

import numpy as np

from labrig.fit.decay.search import projection
from labrig.fit.decay.series import NO_DECAY, DecaySeries
from labrig.fit.decay.whitening import WhitenedSeries, whitened
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from labrig.foundation.nonnegative import nonnegative_least_squares
from labrig.material import exponential_means

COARSE_RATES = 48
#: Logarithm of the slowest rate, in 1/spans, beside a free offset. Slower ones and a negative
#: offset cancel, but their light would flicker: ρ came out four times too small.
SLOWEST_BESIDE_OFFSET = 0.0
#: Number of steps into which each iteration divides the distance of two rates.
REFINEMENT = 4
#: Iterations: the grid ratio falls from 1.2 to 1.003, the error of the curve below 1e−5; and how
#: many suffice as long as weights and flicker still change.
ROUNDS, FIRST_ROUNDS = 3, 1
#: Upper limit of the flicker of shutters, apertures and lamps: a larger scatter is due to a wrong
#: dark level or model.
MAX_FLICKER = 0.1
#: Alternations of curve, channel weights and flicker; of curve and weights if flicker is given.
ALTERNATIONS = 5
ALTERNATIONS_IF_GIVEN = 2
FLICKER_ITERATIONS = 12
#: Signal of all frames in σ below which it is noise.
MIN_BRIGHTNESS = 4.0
#: Fraction of the bright frames' information that the curve must leave to the flicker.
MIN_SPARE = 1e-6
#: Scale of the half-Cauchy prior of the flicker (A. Gelman, Bayesian Analysis 1, 2006): shutters,
#: apertures and lamps scatter by 0.5-1 %, some by a multiple of it.
USUAL_FLICKER = 0.01
#: Number of values of ρ that propagate its uncertainty, and size of their grid.
LIKELY_FLICKERS = 16
FLICKER_GRID = 200
#: Degrees of freedom below which the estimated flicker is unreliable.
FEWEST_NOISE_DOF = 4.0


@dataclass(frozen=True)
class Envelope:
    """The best completely monotone curve, and the noise about it.

    Attributes
    ----------
    series
        The series, with the repeats of a decay scaled to the same level.
    signal
        Curve without offset, shape (n, C).
    weights
        Weights of the channels with maximum 1, shape (C,).
    offsets
        Offsets of the channels, shape (C,).
    dof
        Degrees of freedom of the noise estimate: effective frames less those that the curve took.
    flicker, flicker_sigma
        Relative flicker common to the channels of a frame, and σ; with fewer than
        `FEWEST_NOISE_DOF` degrees of freedom one σ(ρ²) above the estimate.
    likely_flickers
        Equally probable values of ρ after the measurement, or the given one, shape (m,).
    shapes
        Exponentials that the curve is made of, 1 at the first frame, shape (n, q).
    """

    series: DecaySeries
    signal: FloatArray
    weights: FloatArray
    offsets: FloatArray
    dof: float
    flicker: float
    flicker_sigma: float
    likely_flickers: FloatArray
    shapes: FloatArray

    @property
    def is_given(self) -> bool:
        """Whether the flicker was given, and not told by the scatter."""
        return len(self.likely_flickers) == 1

    @property
    def typical_flicker(self) -> float:
        """Median of the likely values of ρ; unlike the likeliest one it is not zero by chance."""
        return float(np.median(self.likely_flickers))

    def added_square(self, assumed: float) -> float:
        """Return by how much the mean of ρ² exceeds the square of a flicker that was assumed."""
        return float((self.likely_flickers**2).mean()) - assumed**2


def envelope(series: DecaySeries, flicker: float | None) -> Envelope:
    """Alternate fits of the curve, the channel weights, the repeats' levels and the flicker.

    The flicker is fitted only if `flicker` is None. One channel of a single decay with given noise
    needs no envelope, which then is zero.

    Raises
    ------
    FitError
        The signal does not decay, or there are too few bright frames to estimate flicker.
    """
    weights = _first_weights(series)
    offsets = np.zeros_like(weights)
    signal = np.zeros_like(series.values)
    is_single = len(weights) == len(series.repeats) == 1
    if is_single and flicker == 0 and series.sigma_given:
        n_frames = series.n_frames
        none = np.zeros((n_frames, 0))
        return Envelope(series, signal, weights, offsets, n_frames, 0.0, 0.0, np.zeros(1), none)
    rho, rho_sigma = 0.0, 0.0
    likely = np.array([flicker or 0.0])
    alternations = ALTERNATIONS if flicker is None else ALTERNATIONS_IF_GIVEN
    for left in reversed(range(alternations)):
        data = whitened(series, signal, rho)
        rounds = FIRST_ROUNDS if left else ROUNDS
        curve, offsets, leverage, shapes = monotone_curve(data, weights, rounds)
        dof = max(series.n_frames - float(leverage.sum()), 1.0)
        if len(weights) > 1:
            weights, curve = _channel_weights(data, curve, offsets)
        if len(series.repeats) > 1:
            series = series.relevelled(_gains(data, curve, weights, offsets))
        signal = np.multiply.outer(curve, weights)
        brightness = float(np.linalg.norm(np.einsum("fcd,fd->fc", series.whiteners, signal)))
        if brightness == 0 or (series.sigma_given and brightness < MIN_BRIGHTNESS):
            raise FitError(NO_DECAY)
        if flicker is None:
            rho, rho_sigma, dof, likely = _flicker(series, signal, offsets, leverage)
        else:
            rho = flicker
    return Envelope(series, signal, weights, offsets, dof, rho, rho_sigma, likely, shapes)


def _first_weights(series: DecaySeries) -> FloatArray:
    """Estimate channel weights from the values where the signal is, relative to the brightest."""
    information = (series.values * series.inverse_sigma**2).sum(axis=1)
    common = np.maximum(information, 0) / np.maximum((series.inverse_sigma**2).sum(axis=1), 1e-300)
    weights = np.maximum(common @ series.values, 0)
    return weights / weights.max() if weights.max() > 0 else np.ones_like(weights)


def monotone_curve(
    data: WhitenedSeries, weights: FloatArray, rounds: int = ROUNDS
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return the best completely monotone curve, offsets, leverage, and what it is made of.

    Their shapes are (n,), (C,), (n,) and (n, q).

    Parameters
    ----------
    data
        Series in units of its noise.
    weights
        Weights of the channels, shape (C,).
    rounds
        Number of times that the grid of rates is refined.
    """
    series = data.series
    problem = projection(data, weights)
    low, high = series.log_rate_bounds
    if np.isinf(series.offset_sigma).any():
        low = max(low, SLOWEST_BESIDE_OFFSET)
    log_rates = np.linspace(low, high, COARSE_RATES)
    step = (high - low) / (COARSE_RATES - 1)
    for refinement in range(rounds + 1):
        means = exponential_means(np.exp(log_rates), series.t, series.exposure)
        amplitudes = nonnegative_least_squares(problem.columns(means), problem.target)
        used = amplitudes > 0
        if refinement < rounds:
            step /= REFINEMENT
            refinements = step * np.arange(-REFINEMENT, REFINEMENT + 1)
            log_rates = np.unique(np.add.outer(log_rates[used], refinements).round(12))
            log_rates = np.clip(log_rates, low, high)
    design = data.signal_design(problem.unit, means[:, used])
    offsets = data.offsets_of(data.target - design @ amplitudes[used])
    along, _ = data.leverage(weights, np.hstack([design, data.offset_design]))
    return means @ amplitudes, offsets, along, means[:, used]


def _channel_weights(
    data: WhitenedSeries, curve: FloatArray, offsets: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return weights (maximum 1) that scale `curve` to the values, and the curve in their units."""
    design = (data.matrices * curve[:, None, None]).reshape(-1, data.matrices.shape[2])
    target = (data.values - data.constant(offsets)).ravel()
    weights = np.maximum(np.linalg.lstsq(design, target)[0], 0)
    brightest = float(weights.max())
    if brightest == 0:
        return np.ones_like(weights), curve
    return weights / brightest, curve * brightest


def _gains(
    data: WhitenedSeries, curve: FloatArray, weights: FloatArray, offsets: FloatArray
) -> FloatArray:
    """Return the divisors that bring the values after each charge to one curve with mean level 1.

    An ageing lamp or a warmer sample changes the level of a charge, not its decay. The difference
    would otherwise count as flicker.
    """
    series = data.series
    model = data.constant(weights) * curve[:, None]
    overlap = (model * (data.values - data.constant(offsets))).sum(axis=1)
    gains = np.bincount(series.repeat, overlap) / np.maximum(
        np.bincount(series.repeat, (model**2).sum(axis=1)), np.finfo(float).tiny
    )
    levels = series.levels * np.where(gains > 0, gains, 1.0)
    return np.asarray(levels / levels.mean() / series.levels)


def _flicker(
    series: DecaySeries, signal: FloatArray, offsets: FloatArray, leverage: FloatArray
) -> tuple[float, float, float, FloatArray]:
    """Return ρ, its σ, its degrees of freedom and likely values, from the frames' common scatter.

    Along the signal's direction a frame scatters with variance V = 1 + ρ² B, B = |s/σ|², of which
    the curve followed the fraction `leverage` (n,). ρ² is the restricted maximum of the likelihood
    (REML; Patterson and Thompson 1971), by its fixed-point form.
    """
    u = np.einsum("fcd,fd->fc", series.whiteners, signal)
    brightness2 = np.einsum("fc,fc->f", u, u)
    residual = np.einsum("fcd,fd->fc", series.whiteners, series.values - signal - offsets)
    along2 = np.einsum("fc,fc->f", u, residual) ** 2 / np.where(brightness2 > 0, brightness2, 1.0)
    free = np.maximum(1 - leverage, 0.0)
    if float(brightness2**2 @ free) <= MIN_SPARE * float(brightness2 @ brightness2):
        raise FitError(
            "expected frames to spare to estimate flicker, got a curve through all bright ones; "
            "give the flicker, or record more frames"
        )
    variance = 0.0
    for _ in range(FLICKER_ITERATIONS):
        weight = brightness2 / (1 + variance * brightness2)
        scatter = float((weight**2 / np.where(brightness2 > 0, brightness2, 1.0)) @ (along2 - free))
        variance = min(max(scatter / float(weight**2 @ free), 0.0), MAX_FLICKER**2)

    def error(variance: float) -> tuple[float, float]:
        """Return σ(ρ²), and ν: 2/ν is V's squared relative error, weighted by information."""
        weight = brightness2 / (1 + variance * brightness2)
        sigma = float(np.sqrt(2 / (weight**2 @ free)))
        return sigma, 2 / (sigma**2 * float((weight**3).sum() / weight.sum()))

    variance_sigma, dof = error(variance)
    if dof < FEWEST_NOISE_DOF:
        # So few frames tell that a low estimate is an accident: err on the noisy side.
        variance = min(variance + variance_sigma, MAX_FLICKER**2)
        variance_sigma, dof = error(variance)
    flicker = float(np.sqrt(variance))
    # Near zero the square root is not linear: then √σ(ρ²) is the scale of what ρ could be.
    sigma = min(variance_sigma / (2 * max(flicker, 1e-30)), float(np.sqrt(variance_sigma)))
    return flicker, sigma, dof, _likely_flickers(brightness2, along2, free)


def _likely_flickers(brightness2: FloatArray, along2: FloatArray, free: FloatArray) -> FloatArray:
    """Return root mean squares of ρ in ranges of equal posterior probability.

    The arguments are named as in `_flicker`.
    """
    # Dense near zero, where a small ρ already tells.
    rho = MAX_FLICKER * np.linspace(0, 1, FLICKER_GRID) ** 2
    variance = 1 + np.multiply.outer(rho**2, brightness2)
    log_likelihood = -0.5 * (np.log(variance) @ free + (along2 / variance).sum(axis=1))
    density = np.exp(log_likelihood - log_likelihood.max()) / (1 + (rho / USUAL_FLICKER) ** 2)
    fraction = density * np.gradient(rho)
    # Their mean square is that of ρ, with the tail that middles of the ranges would leave out.
    below = np.cumsum(fraction) / fraction.sum()
    square_below = np.cumsum(fraction * rho**2) / fraction.sum()
    squares = np.interp(np.linspace(0, 1, LIKELY_FLICKERS + 1), below, square_below)
    return np.asarray(np.sqrt(LIKELY_FLICKERS * np.maximum(np.diff(squares), 0.0)))
