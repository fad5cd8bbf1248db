"""Propagation of uncertainties from fitted parameters to others."""

import numpy as np

from labrig.foundation.arrays import FloatArray


def propagated_covariance(covariance: FloatArray, transform: FloatArray) -> FloatArray:
    """Return T Cov Tᵀ; an infinite variance stays infinite and correlates with nothing."""
    is_finite = np.isfinite(np.diag(covariance))
    finite = np.where(np.multiply.outer(is_finite, is_finite), covariance, 0.0)
    # What the data say nothing about may overflow: that is as good as infinite.
    with np.errstate(over="ignore", invalid="ignore"):
        result: FloatArray = transform @ finite @ transform.T
    variance = np.diag(result)
    # Below 0 is what rounding leaves of variances that are as good as infinite, too.
    is_bounded = np.isfinite(variance) & (variance >= 0)
    unbounded = (transform[:, ~is_finite] != 0).any(axis=1) | ~is_bounded
    result[unbounded, :] = 0.0
    result[:, unbounded] = 0.0
    result[unbounded, unbounded] = np.inf
    return np.where(np.isfinite(result) | np.eye(len(result), dtype=bool), result, 0.0)
