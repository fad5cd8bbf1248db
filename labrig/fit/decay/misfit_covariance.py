"""Covariance of the parameters of a model that does not describe the decay exactly.

Where a model misses the curve, its own curvature acts on the parameters: the Hessian of χ²/2 is
H = JᵀJ − Σ r ∇²m with r the misfit over σ² and m the model, and the covariance is H⁻¹ JᵀJ H⁻¹, not
(JᵀJ)⁻¹ (H. White, Econometrica 50, 1982). For the rates of two or three exponentials that are
fitted to a decay of distributed rates, σ is up to twice as large that way.
"""

import numpy as np

from labrig.fit.decay.envelope import Envelope
from labrig.fit.decay.states import StatesFit, exponentials
from labrig.fit.decay.whitening import WhitenedSeries
from labrig.foundation.arrays import FloatArray

#: Step of the parameters, log k and amplitudes of order 1, by which derivatives are differenced.
STEP = 1e-4


def with_misfit(
    covariance: FloatArray, fit: StatesFit, data: WhitenedSeries, smooth: Envelope
) -> FloatArray:
    """Return the covariance with the curvature that acts through the misfit.

    Parameters
    ----------
    covariance
        (JᵀJ)⁻¹ of the fitted parameters, shape (p, p).
    fit, data
        The fit, and the series of one channel in units of its noise.
    smooth
        The best monotone curve, from which the model's misfit is told without the noise.

    Returns
    -------
    ndarray
        Covariance, shape (p, p); the given one where the misfit leaves no minimum, as it does if a
        state is at a bound.
    """
    if not np.isfinite(covariance).all():
        return covariance
    series, theta = data.series, fit.joint.shape
    model = fit.signal(series) + fit.joint.offsets
    misfit = ((smooth.signal + smooth.offsets - model) * series.inverse_sigma**2)[:, 0]
    shape = exponentials(series, fit.n_free, fit.fixed)
    curvature = np.zeros_like(covariance)
    for row in range(len(theta)):
        step = np.zeros_like(theta)
        step[row] = STEP
        slopes = (shape(theta + step)[1] - shape(theta - step)[1]) / (2 * STEP)
        curvature[row, : len(theta)] = misfit @ slopes
    curvature = (curvature + curvature.T) / 2
    relative_hessian = np.eye(len(covariance)) - covariance @ curvature
    if np.linalg.eigvals(relative_hessian).real.min() <= 0:
        return covariance
    inverse = np.linalg.inv(relative_hessian)
    return np.asarray(inverse @ covariance @ inverse.T)
