"""A fit as a line with its uncertainty."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from labrig.fit.decay import exponential_means_and_slopes
from labrig.results import FittedDecay, Series

FloatArray = NDArray[np.float64]

POINTS = 160


@dataclass(frozen=True, eq=False)
class Curve:
    """The fit as a line.

    Parameters
    ----------
    t_s
        Shape (m,): middles of exposures.
    total
        Shape (m, C), what frames there would measure.
    sigma
        Shape (m,), the standard uncertainty of `total` in the brightest channel; the covariance of
        a fit says nothing of the others. Infinite where a parameter is not known.
    states
        Shape (m, n): each state in the brightest channel, offset left out.
    brightest
        That channel's number.
    """

    t_s: FloatArray
    total: FloatArray
    sigma: FloatArray
    states: FloatArray
    brightest: int


def middles_s(series: Series) -> FloatArray:
    """Middle of each exposure after lamp off, where its value is drawn."""
    return series.t_s + series.exposure_s / 2


def fitted_curve(series: Series, fit: FittedDecay) -> Curve:
    """`fit` along the times of `series`, for the exposures that frames had around them."""
    order = np.argsort(series.t_s, kind="stable")
    known_t, known_exposure = series.t_s[order], series.exposure_s[order]
    t_s = np.linspace(known_t[0], known_t[-1], POINTS)
    exposure_s = np.interp(t_s, known_t, known_exposure)
    middle_s = t_s + exposure_s / 2
    states = [state.amplitude * np.exp(-state.k_r_per_s * middle_s) for state in fit.states]
    return Curve(
        t_s=middle_s,
        total=fit.predict(t_s, exposure_s),
        sigma=_sigma(fit, t_s, exposure_s),
        states=np.stack(states, axis=1),
        brightest=fit.brightest,
    )


def _sigma(fit: FittedDecay, t_s: FloatArray, exposure_s: FloatArray) -> FloatArray:
    """σ = √(J Cov Jᵀ), J the derivatives by k₁, a₁, k₂, a₂, …, offset."""
    if not np.isfinite(fit.covariance).all():
        return np.full_like(t_s, np.inf)
    rates = np.array([state.k_r_per_s for state in fit.states])
    amplitudes = np.array([state.amplitude for state in fit.states])
    means, slopes = exponential_means_and_slopes(rates, t_s, exposure_s)
    jacobian = np.ones((len(t_s), len(fit.covariance)))
    jacobian[:, 0:-1:2] = amplitudes * slopes / rates
    jacobian[:, 1:-1:2] = means
    variance = np.einsum("mp,pq,mq->m", jacobian, fit.covariance, jacobian)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))
