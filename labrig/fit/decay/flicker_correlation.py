"""Flicker that correlates from frame to frame, as that of a lamp or a room that drifts does.

Neighbouring frames then err together, and what a sum of exponentials averages over is less than it
seems. The relative deviations of the frames from the best monotone curve have the covariance
1/B + ρ² φ^|f − g|, B the squared signal-to-noise ratio of a frame; the restricted likelihood
(D. Harville, J. Am. Stat. Assoc. 72, 1977) allows for what the curve took of them. It weighs
pairs of ρ and φ, and the fit, whose weights are those of independent frames, has the covariance
A V Aᵀ with A = (JᵀJ)⁻¹Jᵀ and V the mean of all pairs' covariances.
"""

from dataclasses import dataclass

import numpy as np

from labrig.fit.decay.envelope import MAX_FLICKER, USUAL_FLICKER, Envelope
from labrig.fit.decay.states import StatesFit
from labrig.fit.decay.whitening import WhitenedSeries
from labrig.fit.least_squares import FloatArray

#: Correlations of neighbouring frames that are weighed, and the chance of none before the data
#: tell: shutter and aperture, which dominate, have none.
CORRELATIONS = np.array([0.0, 0.4, 0.65, 0.8, 0.92])
PRIOR_OF_NONE = 0.85
#: Chance from which it counts and is told: below, the data do not support it. It is above in less
#: than one of a hundred series of independent frames, of most of which it is below 0.1.
LIKELY = 0.7
#: Values of an estimated ρ that are weighed, relative to the estimate: a correlated flicker is
#: larger than its scatter about a curve that follows it.
FLICKERS = np.geomspace(0.5, 4.0, 5)
#: Frames below which no correlation is told, and number of first frames that tell it.
FEWEST_FRAMES, MOST_FRAMES = 12, 100
#: Diagonal of a triangular factor that stands for 0.
TINY = 1e-300
#: Least estimate: a flicker that drifts with the decay leaves hardly any scatter about a curve.
LEAST_FLICKER = 0.002
#: Mean ρ² B below which flicker hardly matters.
LEAST_EFFECT = 0.1


@dataclass(frozen=True)
class FlickerCorrelation:
    """Correlation of neighbouring frames' flicker, and what it does to the fit.

    Attributes
    ----------
    correlation
        Mean of the correlation.
    covariance
        Its part in the covariance of the fitted parameters, shape (p, p).
    factor
        Factor by which the largest σ of a rate grows with it.
    """

    correlation: float
    covariance: FloatArray
    factor: float


def flicker_correlation(
    data: WhitenedSeries, fit: StatesFit, noise: Envelope, *, is_estimated: bool
) -> FlickerCorrelation | None:
    """Return how the flicker correlates; None without it, or if too few frames tell.

    Parameters
    ----------
    data
        The series in units of its noise.
    fit
        The fit at its minimum.
    noise
        The curve that the flicker is measured against.
    is_estimated
        Whether ρ was estimated.
    """
    series = data.series
    whitened_signal = np.einsum("fcd,fd->fc", series.whiteners, noise.signal)
    brightness2 = np.einsum("fc,fc->f", whitened_signal, whitened_signal)
    bright = brightness2 > 0
    flicker = max(noise.flicker, LEAST_FLICKER) if is_estimated else noise.flicker
    is_low = flicker**2 * brightness2.mean() < LEAST_EFFECT
    is_determined = np.isfinite(fit.joint.least_squares.covariance).all()
    is_told = bright.sum() >= FEWEST_FRAMES and len(series.repeats) == 1
    if not (is_determined and is_told) or is_low:
        return None
    whitened_values = np.einsum("fcd,fd->fc", series.whiteners, series.values - noise.offsets)
    deviation = np.einsum("fc,fc->f", whitened_signal, whitened_values)[bright]
    deviation = deviation / brightness2[bright] - 1
    signal = noise.signal.max(axis=1)[bright]
    design = noise.shapes[bright] / signal[:, None]
    if series.fitted_offsets.size:
        design = np.column_stack([design, 1 / signal])
    flickers = (
        np.minimum(noise.flicker * FLICKERS, MAX_FLICKER) if is_estimated else [noise.flicker]
    )
    rho, phi = (grid.ravel() for grid in np.meshgrid(flickers, CORRELATIONS))
    told = slice(0, MOST_FRAMES)
    n_told = len(deviation[told])
    powers = _powers(n_told)
    covariances = np.repeat(powers, len(flickers), axis=0) * rho[:, None, None] ** 2
    covariances += np.diag(1 / brightness2[bright][told])
    log_posterior = _log_restricted_likelihoods(deviation[told], design[told], covariances)
    log_posterior -= np.log1p((rho / USUAL_FLICKER) ** 2)
    log_posterior += np.log(
        np.where(phi == 0, PRIOR_OF_NONE, (1 - PRIOR_OF_NONE) / (len(CORRELATIONS) - 1))
    )
    probability = np.exp(log_posterior - log_posterior.max())
    probability /= probability.sum()
    correlates = float(probability @ (phi > 0))
    if correlates <= LIKELY:
        return None
    variances = (probability * rho**2).reshape(len(CORRELATIONS), -1).sum(axis=1)
    all_powers = _powers(len(deviation))
    excess = np.tensordot(variances, all_powers, 1) - variances.sum() * np.eye(len(deviation))
    covariance = _effect(data, fit, bright, excess)
    rates = slice(0, 2 * fit.n_free, 2)
    independent = np.diag(fit.joint.least_squares.covariance)[rates]
    ratio = np.diag(covariance)[rates] / np.where(independent > 0, independent, np.inf)
    return FlickerCorrelation(
        correlation=float(probability @ phi) / correlates,
        covariance=covariance,
        factor=float(np.sqrt(1 + ratio.max(initial=0.0))),
    )


def _powers(n_frames: int) -> FloatArray:
    """Return φ^|f − g| for every correlation φ, shape (k, n, n)."""
    frames = np.arange(n_frames)
    distance = np.abs(np.subtract.outer(frames, frames))
    return np.asarray(np.power(CORRELATIONS[:, None], frames)[:, distance])


def _log_restricted_likelihoods(
    deviation: FloatArray, design: FloatArray, covariances: FloatArray
) -> FloatArray:
    """Return the log likelihood of what a linear model (n, q) leaves of the deviations (n,).

    The result is (k,) for k covariances (k, n, n).
    """
    choleskys = np.linalg.cholesky(covariances)
    both = np.column_stack([design, deviation])
    triangles = np.linalg.qr(np.linalg.solve(choleskys, both[None]), mode="r")
    # The diagonal is log|V⁻¹ᐟ² X| and, last, the norm of the residual.
    diagonal = np.abs(np.diagonal(triangles, axis1=1, axis2=2))
    volumes = np.log(np.diagonal(choleskys, axis1=1, axis2=2)).sum(axis=1)
    volumes += np.log(np.maximum(diagonal[:, :-1], TINY)).sum(axis=1)
    return np.asarray(-volumes - diagonal[:, -1] ** 2 / 2)


def _effect(
    data: WhitenedSeries, fit: StatesFit, bright: FloatArray, excess: FloatArray
) -> FloatArray:
    """Return A (excess of V) Aᵀ, its negative part left out.

    `excess` is the mean of ρ² φ^|f − g| of different frames, of those that are `bright`.
    """
    solution = fit.joint.least_squares
    n_frames, n_channels = data.values.shape
    signal = fit.signal(data.series)
    along = np.einsum("fcd,fd->fc", data.matrices, signal)
    frames = solution.jacobian[: n_frames * n_channels].reshape(n_frames, n_channels, -1)
    effect = (solution.covariance @ np.einsum("fcp,fc->pf", frames, along))[:, bright]
    added = effect @ excess @ effect.T
    scale = np.sqrt(np.maximum(np.diag(solution.covariance), 1e-300))
    values, vectors = np.linalg.eigh(added / np.outer(scale, scale))
    vectors = vectors * scale[:, None]
    return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T)
