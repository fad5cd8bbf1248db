"""What a decay fit will know: the Fisher information of its parameters, and an error budget.

The model is the fit's own (`labrig.fit`): Σ_i a_i g(k_i) times one weight per channel, plus an
offset per channel of which the dark frames leave σ open; Cov = diag(σ²) + ρ² s sᵀ within a frame.
Rates and amplitudes are marginalised over weights and offsets. The inverse information is the
covariance of the best estimator (Cramér and Rao), which the weighted fit attains.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from labrig.fit import EPSILON, FloatArray
from labrig.fit.decay import exponential_means_and_slopes
from labrig.predict.series import DARK, FLICKER, ExpectedSeries


@dataclass(frozen=True, eq=False)
class Information:
    """What the fit will know of k1, a1, k2, a2, …

    Attributes
    ----------
    covariance
        (2m, 2m); infinite variances where the frames say nothing.
    budget
        By source, (2m,) its fraction of each variance; they add up to 1.
    """

    covariance: FloatArray
    budget: Mapping[str, FloatArray]

    @property
    def sigma(self) -> FloatArray:
        """(2m,) of k1, a1, …"""
        return np.sqrt(np.diag(self.covariance))


def information(series: ExpectedSeries) -> Information:
    """Covariance and error budget of a fit to `series`."""
    slopes, signal = _slopes(series)
    whitening = _whitening(series, signal)
    values = (whitening @ slopes).reshape(-1, slopes.shape[2])
    priors = series.offset_sigma[series.offset_sigma > 0]
    design = np.zeros((len(values) + len(priors), slopes.shape[2]))
    design[: len(values)] = values
    design[len(values) :, slopes.shape[2] - len(priors) :] = np.diag(1 / priors)
    estimator, unseen = _pseudo_inverse(design)
    # What a deviation of each value, and of each offset by its σ, does to the parameters.
    by_value = np.einsum(
        "pfc,fcd->pfd", estimator[:, : len(values)].reshape(-1, *signal.shape), whitening
    )
    by_offset = estimator[:, len(values) :]
    parts = {
        source: np.einsum("pfc,fc->p", by_value**2, variance)
        for source, variance in series.variances.items()
    }
    parts[FLICKER] = np.square(series.flicker * np.einsum("pfc,fc->pf", by_value, signal)).sum(1)
    parts[DARK] = parts[DARK] + np.square(by_offset).sum(axis=1)
    covariance = estimator @ estimator.T
    covariance[unseen, :], covariance[:, unseen] = 0.0, 0.0
    covariance[unseen, unseen] = np.inf
    asked = slice(0, 2 * len(series.k_r_per_s))
    total = np.sum(list(parts.values()), axis=0)
    return Information(
        covariance=covariance[asked, asked],
        budget={
            source: (part / np.where(total > 0, total, 1.0))[asked]
            for source, part in parts.items()
        },
    )


def _whitening(series: ExpectedSeries, signal: FloatArray) -> FloatArray:
    """(n, C, C) W of each frame, Wᵀ W = Cov⁻¹."""
    covariance = np.einsum("fc,cd->fcd", series.variance, np.eye(signal.shape[1]))
    covariance += series.flicker**2 * np.einsum("fc,fd->fcd", signal, signal)
    return np.linalg.inv(np.linalg.cholesky(covariance))


def _slopes(series: ExpectedSeries) -> tuple[FloatArray, FloatArray]:
    """Derivatives (n, C, p) by k1, a1, …, the other channels' weights, the offsets; the signal."""
    rates, weights = series.k_r_per_s, series.weights
    means, by_log_rate = exponential_means_and_slopes(rates, series.t_s, series.exposure_s)
    curve = means @ series.amplitude
    others = [c for c in range(len(weights)) if c != int(np.argmax(weights))]
    fitted = [c for c in range(len(weights)) if series.offset_sigma[c] > 0]
    n_shape = 2 * len(rates)
    slopes = np.zeros((len(curve), len(weights), n_shape + len(others) + len(fitted)))
    slopes[:, :, 0:n_shape:2] = np.einsum(
        "fi,c->fci", by_log_rate * series.amplitude / rates, weights
    )
    slopes[:, :, 1:n_shape:2] = np.einsum("fi,c->fci", means, weights)
    for place, channel in enumerate(others, start=n_shape):
        slopes[:, channel, place] = curve
    for place, channel in enumerate(fitted, start=n_shape + len(others)):
        slopes[:, channel, place] = 1.0
    return slopes, np.multiply.outer(curve, weights)


def _pseudo_inverse(design: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
    """(p, n) of `design` (n, p), and (p,) which parameters it does not determine."""
    scale = np.linalg.norm(design, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    u, s, vt = np.linalg.svd(design / scale, full_matrices=False)
    kept = s > max(design.shape) * EPSILON * s[0]
    inverse = (vt[kept].T / s[kept]) @ u[:, kept].T / scale[:, np.newaxis]
    seen = np.einsum("ij,ij->j", vt[kept], vt[kept])
    return inverse, seen < 1 - np.sqrt(EPSILON)
