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
CORRELATIONS = np.array([0.0, 0.3, 0.5, 0.65, 0.8, 0.9, 0.95])
PRIOR_OF_NONE = 0.8
#: Values of an estimated ρ that are weighed, relative to the estimate: a correlated flicker is
#: larger than its scatter about a curve that follows it.
FLICKERS = np.geomspace(0.5, 4.0, 7)
#: Frames below which no correlation is told.
FEWEST_FRAMES = 12
#: Least estimate: a flicker that drifts with the decay leaves hardly any scatter about a curve.
LEAST_FLICKER = 0.002
#: Mean ρ² B below which flicker hardly matters.
LEAST_EFFECT = 0.1


@dataclass(frozen=True)
class FlickerCorrelation:
    """Correlation of neighbouring frames' flicker, and what it does to the fit.

    Attributes
    ----------
    probability
        Chance that there is a correlation.
    correlation
        Its mean, if there is one.
    covariance
        Its part in the covariance of the fitted parameters, shape (p, p).
    factor
        Factor by which the largest σ of a rate grows with it.
    """

    probability: float
    correlation: float
    covariance: FloatArray
    factor: float


def flicker_correlation(
    data: WhitenedSeries, fit: StatesFit, noise: Envelope, *, is_estimated: bool
) -> FlickerCorrelation | None:
    """Return how the flicker correlates; None if too few frames tell, or without flicker.

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
    if bright.sum() < FEWEST_FRAMES or is_low or len(series.repeats) > 1:
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
    pairs = [(float(rho), float(phi)) for phi in CORRELATIONS for rho in flickers]
    distance = np.abs(np.subtract.outer(np.arange(bright.sum()), np.arange(bright.sum())))
    log_posterior = np.array(
        [
            _log_restricted_likelihood(
                deviation, design, np.diag(1 / brightness2[bright]) + rho**2 * phi**distance
            )
            + _log_prior(rho, phi)
            for rho, phi in pairs
        ]
    )
    probability = np.exp(log_posterior - log_posterior.max())
    probability /= probability.sum()
    rho2, phi = np.array(pairs).T
    rho2 = rho2**2
    correlates = float(probability @ (phi > 0))
    excess = sum(
        p * r2 * (one**distance - np.eye(len(distance)))
        for p, r2, one in zip(probability, rho2, phi, strict=True)
    )
    covariance = _effect(data, fit, bright, np.asarray(excess))
    rates = slice(0, 2 * fit.n_free, 2)
    independent = np.diag(fit.joint.least_squares.covariance)[rates]
    ratio = np.diag(covariance)[rates] / np.where(independent > 0, independent, np.inf)
    return FlickerCorrelation(
        probability=correlates,
        correlation=float(probability @ phi) / max(correlates, 1e-12),
        covariance=covariance,
        factor=float(np.sqrt(1 + ratio.max(initial=0.0))),
    )


def _log_prior(rho: float, phi: float) -> float:
    of_phi = PRIOR_OF_NONE if phi == 0 else (1 - PRIOR_OF_NONE) / (len(CORRELATIONS) - 1)
    return float(np.log(of_phi / (1 + (rho / USUAL_FLICKER) ** 2)))


def _log_restricted_likelihood(
    deviation: FloatArray, design: FloatArray, covariance: FloatArray
) -> float:
    """Return the log likelihood of what a linear model (n, q) leaves of the deviations (n,)."""
    cholesky = np.linalg.cholesky(covariance)
    both = np.linalg.solve(cholesky, np.column_stack([design, deviation]))
    triangle = np.abs(np.diag(np.linalg.qr(both, mode="r")))
    # The diagonal is log|V⁻¹ᐟ² X| and, last, the norm of the residual.
    log_volume = np.log(np.diag(cholesky)).sum() + np.log(np.maximum(triangle[:-1], 1e-300)).sum()
    return float(-log_volume - triangle[-1] ** 2 / 2)


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
