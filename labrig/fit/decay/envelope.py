"""A smooth curve of no particular law, and the noise as the scatter about it.

Sums of positive exponentials with *any* number of rates are all the completely monotone functions
(Bernstein's theorem), which include power laws and stretched exponentials. Non-negative least
squares over a grid of rates, refined where the weights are, finds the best of them. The scatter
about it is noise, whatever the number of states: flicker measured like this cannot hide a missing
state or a power law.

As projection on a convex cone the curve takes as many degrees of freedom as it has active rates (M.
Meyer, M. Woodroofe, Annals of Statistics 28, 2000).

How the noise depends on the signal s is not known either. Instruments have three kinds,
σ² = c² + g s + ρ² s²: of reading, of counting, and in proportion to the signal. The likelihood of
the scatter weighs all mixtures of the three, and σ² is their mean: no kind is chosen by a threshold
that a small change of the data could cross.

A given σ is multiplied by R. Birge's ratio (Phys. Rev. 40, 1932)
where it is above 1, never below, as the Particle Data Group does: a σ that is larger than the
scatter may hold what all values have in common. Excess scatter in proportion to the signal is
flicker instead; the likelihood tells the two apart.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc

from labrig.fit.decay.diagnostics import MISFIT_LEVEL, order_p_value
from labrig.fit.decay.series import NO_DECAY, DecaySeries, WhitenedSeries, whitened
from labrig.fit.decay.variable_projection import projection
from labrig.fit.nonlinear_least_squares import EPSILON
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError, FlickerUnknownError
from labrig.foundation.nonnegative import nonnegative_least_squares
from labrig.material import exponential_means
from labrig.results import ScatterSigma

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
MIN_NOISE_DOF = 4.0


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
        `MIN_NOISE_DOF` degrees of freedom one σ(ρ²) above the estimate.
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
        raise FlickerUnknownError(
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
    if dof < MIN_NOISE_DOF:
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


#: Iterations in which the weights of the curve follow σ; the third changes σ by less than 1 %.
ITERATIONS = 3
#: Number of fractions of each kind of noise that are weighed, dense near none and all of it.
FRACTIONS = 9
#: Prior probability that the noise is the same for all values. Some dozens of values hardly tell,
#: and a σ that rises with the signal by accident would weigh the first values, which determine the
#: fastest rate, too little.
PRIOR_OF_CONSTANT = 0.7
#: Scatter below which data are exact up to rounding, in units of the largest value.
EXACT = 1e-13


def with_scatter_sigma(series: DecaySeries) -> tuple[DecaySeries, ScatterSigma]:
    """Return a series without σ with the σ of its scatter, and how σ depends on the signal.

    Parameters
    ----------
    series
        Series of one channel whose σ is not given.

    Raises
    ------
    FitError
        The signal does not decay.
    """
    if len(series.repeats) > 1:
        series = envelope(series, 0.0).series
    law = _Law(np.array([1.0, 0.0, 0.0]), np.inf)
    result = series
    for _ in range(ITERATIONS):
        data = whitened(result, np.zeros_like(series.values), 0.0)
        curve, offsets, leverage, _ = monotone_curve(data, np.ones(1))
        residual = series.values[:, 0] - curve - offsets[0]
        law = _likely_law(residual, np.maximum(curve, 0.0), np.minimum(leverage, 1.0))
        sigma = np.maximum(law.sigma(curve), EXACT)
        result = replace(series, inverse_sigma=1 / sigma[:, None])
    constant, counting, proportional = law.coefficients
    return result, ScatterSigma(
        constant=float(np.sqrt(constant)) * series.peak,
        counting=float(counting) * series.peak,
        proportional=float(np.sqrt(proportional)),
        at_brightest=float(sigma[np.argmax(curve)]) * series.peak,
        at_faintest=float(sigma[np.argmin(curve)]) * series.peak,
        dof=law.dof,
    )


def with_equal_sigma(series: DecaySeries) -> DecaySeries:
    """Return a series without σ with one for all values, that of their scatter.

    Raises
    ------
    FitError
        The signal does not decay.
    """
    if len(series.repeats) > 1:
        series = envelope(series, 0.0).series
    data = whitened(series, np.zeros_like(series.values), 0.0)
    curve, offsets, leverage, _ = monotone_curve(data, np.ones(1))
    residual = series.values[:, 0] - curve - offsets[0]
    dof = max(len(residual) - float(leverage.sum()), 1.0)
    return scaled_sigma(series, float(np.sqrt(residual @ residual / dof)))


def scaled_sigma(series: DecaySeries, factor: float) -> DecaySeries:
    """Return the series with its σ times a factor, as far as numbers have digits."""
    smallest = float(np.min(1 / series.inverse_sigma[series.inverse_sigma > 0]))
    factor = max(factor, EPSILON / smallest)
    return replace(series, inverse_sigma=series.inverse_sigma / factor)


def residual_sigma(series: DecaySeries, dof: int) -> ScatterSigma:
    """Return the σ of a series that is the same for all values, that of residuals."""
    sigma = series.peak / float(series.inverse_sigma.max())
    return ScatterSigma(sigma, 0.0, 0.0, sigma, sigma, float(dof), is_of_residuals=True)


@dataclass(frozen=True)
class _Law:
    """Variance of a value of signal s: coefficients of 1, s and s², and degrees of freedom."""

    coefficients: FloatArray
    dof: float

    def sigma(self, signal: FloatArray) -> FloatArray:
        return np.asarray(np.sqrt(self.coefficients @ _kinds(signal)))


def _kinds(signal: FloatArray) -> FloatArray:
    """Return the variances of reading, counting and proportional noise, shape (3, n)."""
    positive = np.maximum(signal, 0.0)
    return np.stack([np.ones_like(positive), positive, positive**2])


def _likely_law(residual: FloatArray, signal: FloatArray, leverage: FloatArray) -> _Law:
    """Return the mean of all laws of the variance, weighed by their restricted likelihood.

    Parameters
    ----------
    residual, signal
        Deviation of each value from the curve, and the curve, shape (n,).
    leverage
        Degrees of freedom that the curve took from each value, shape (n,).
    """
    free = 1 - leverage
    dof = float(free.sum())
    kinds = _kinds(signal)
    means = kinds.mean(axis=1)
    mixtures = _MIXTURES / np.where(means > 0, means, 1.0)
    variance = mixtures @ kinds
    # Counting noise alone has none where the signal vanishes, which no residual can equal.
    variance = np.maximum(variance, EXACT)
    scale = (residual**2 / variance).sum(axis=1) / max(dof, 1.0)
    scale = np.maximum(scale, EXACT**2)
    log_likelihood = -0.5 * (np.log(variance) @ free + dof * np.log(scale))
    probability = np.exp(log_likelihood - log_likelihood.max()) * _PRIOR
    return _Law((probability / probability.sum() * scale) @ mixtures, dof)


def _mixtures() -> FloatArray:
    """Return the fractions of reading, counting and proportional noise, shape (m, 3)."""
    steps = np.sin(np.linspace(0, np.pi / 2, FRACTIONS)) ** 2
    signal, proportional = (grid.ravel() for grid in np.meshgrid(steps, steps))
    mixtures = np.stack([1 - signal, signal * (1 - proportional), signal * proportional], axis=1)
    return np.unique(mixtures.round(12), axis=0)


_MIXTURES = _mixtures()
_IS_CONSTANT = _MIXTURES[:, 0] == 1
_PRIOR = np.where(
    _IS_CONSTANT, PRIOR_OF_CONSTANT, (1 - PRIOR_OF_CONSTANT) / np.count_nonzero(~_IS_CONSTANT)
)


#: Chance of right σ to scatter so much that they are scaled.
SCALED_LEVEL = 5e-4
#: Log likelihood by which the factor has to be better than flicker: odds of e² = 7 : 1.
CLEAR_LOG_LIKELIHOOD = 2.0
#: Least ratio of robust scatter to scatter: below, few values lie far off and the others do not.
MIN_ROBUST = 0.6
#: Fewest degrees of freedom that tell it.
MIN_DOF = 5.0
#: Values of a flicker that are tried.
FLICKERS = np.linspace(0.0, MAX_FLICKER, 100)


@dataclass(frozen=True)
class SigmaScale:
    """Factor by which the given σ are multiplied, and the degrees of freedom that tell it."""

    factor: float
    dof: float


def sigma_scale(series: DecaySeries, flicker: float | None) -> SigmaScale | None:
    """Return the factor of all σ that the scatter of one channel tells; None if they are right.

    Parameters
    ----------
    series
        Series with given σ.
    flicker
        Relative flicker; None if it is to be estimated, so that a scatter in proportion to the
        signal is its own.

    Raises
    ------
    FitError
        The signal does not decay.
    """
    if not series.sigma_given or len(series.channels) > 1 or len(series.repeats) > 1:
        return None
    data = whitened(series, series.values, flicker or 0.0)
    curve, offsets, leverage, _ = monotone_curve(data, np.ones(1))
    # Beside flicker, the variance of the curve and not of the values: these would weigh the low.
    data = whitened(series, curve[:, None], flicker or 0.0)
    weights = data.matrices[:, 0, 0]
    used = weights > 0
    residual = ((series.values[:, 0] - curve - offsets[0]) * weights)[used]
    free = np.clip(1 - leverage[used], 0.0, 1.0)
    dof = float(free.sum())
    chi2 = float(residual @ residual)
    if dof < MIN_DOF or chdtrc(dof, chi2) > SCALED_LEVEL:
        return None
    # Where neighbours agree it is no noise: the curve does not describe the signal, or a drift.
    if order_p_value(residual) < MISFIT_LEVEL:
        return None
    factor = float(np.sqrt(chi2 / dof))
    robust = 1.4826 * float(np.median(np.abs(residual)) / np.sqrt(free.mean()))
    if robust < MIN_ROBUST * factor:
        return None
    if flicker is None:
        brightness2 = ((curve * weights)[used]) ** 2
        scaled = -(dof * np.log(factor**2) + dof) / 2
        if scaled < _log_likelihood(residual, free, brightness2) + CLEAR_LOG_LIKELIHOOD:
            return None
    return SigmaScale(factor, dof)


def _log_likelihood(residual: FloatArray, free: FloatArray, brightness2: FloatArray) -> float:
    """Return the largest log likelihood of residuals (n,) that are larger by flicker."""
    variance = 1 + np.multiply.outer(FLICKERS**2, brightness2)
    log_likelihood = -(np.log(variance) @ free + (residual**2 / variance).sum(axis=1)) / 2
    return float(log_likelihood.max())
