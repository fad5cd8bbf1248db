"""Covariance of a decay's rates and amplitudes: σ of every number of the fit, from its noise.

Where a model misses the curve, its own curvature acts on the parameters: the Hessian of χ²/2 is
H = JᵀJ − Σ r ∇²m with r the misfit over σ² and m the model, and the covariance is H⁻¹ JᵀJ H⁻¹, not
(JᵀJ)⁻¹ (H. White, Econometrica 50, 1982). For the rates of two or three exponentials that are
fitted to a decay of distributed rates, σ is up to twice as large that way.
"""

import numpy as np

from labrig.fit.decay.envelope import Envelope
from labrig.fit.decay.fit_warnings import FitDiagnostics
from labrig.fit.decay.series import WhitenedSeries
from labrig.fit.decay.states import StatesFit, exponentials
from labrig.fit.decay.variable_projection import covariance_under_flicker
from labrig.fit.nonlinear_least_squares import propagated_covariance
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


def fitted_covariance(
    fit: StatesFit, data: WhitenedSeries, diagnostics: FitDiagnostics
) -> FloatArray:
    """Return the covariance of the fitted parameters (p, p), with the noise's uncertainty in it.

    An estimated flicker is marginalised: the covariance is the mean over its likely values. Where
    flicker dominates and is known with ν degrees of freedom, the normal distribution becomes
    Student's t, as it does where σ is the scatter's: then the variance is ν/(ν − 2) times larger.
    There a misfit of the model is allowed for, too.
    """
    covariance, noise = fit.joint.least_squares.covariance, diagnostics.noise
    if diagnostics.scatter is not None and diagnostics.scatter.is_of_residuals:
        return covariance
    if diagnostics.scatter is not None:
        return with_misfit(covariance, fit, data, noise) * diagnostics.student
    if diagnostics.sigma_scale is not None:
        return covariance * diagnostics.student
    if noise.is_given:
        return covariance
    added_square = noise.added_square(noise.flicker)
    return covariance_under_flicker(fit.joint, data, fit.signal(data.series), added_square)


def covariances(
    fit: StatesFit, data: WhitenedSeries, of_parameters: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the covariance of k₁, a₁, … and all offsets in the user's units, and of log k.

    The former is by falling rate, the latter has free rates first.
    """
    by_units, by_log_rates = to_units(fit, data)
    return (
        propagated_covariance(of_parameters, by_units),
        propagated_covariance(of_parameters, by_log_rates),
    )


def to_units(fit: StatesFit, data: WhitenedSeries) -> tuple[FloatArray, FloatArray]:
    """Return derivatives of k₁, a₁, … and all offsets in the user's units, and of log k.

    They are by the fitted parameters; the former by falling rate, the latter free rates first.
    """
    series, n_free = data.series, fit.n_free
    n_states, n_parameters = fit.n_states, fit.joint.n_parameters
    order = np.argsort(-fit.log_rates, kind="stable")
    rates = np.exp(fit.log_rates)
    b = fit.amplitudes
    # Amplitudes are fitted at the first frame, given at the reference: a = b e^(k t₀).
    growth = np.exp(rates * series.start) * series.peak
    transform = np.zeros((2 * n_states + len(series.channels), n_parameters))
    to_log_rates = np.zeros((n_states, n_parameters))
    for rank, i in enumerate(order):
        if i < n_free:
            transform[2 * rank, 2 * i] = rates[i] / series.span_s
            transform[2 * rank + 1, 2 * i] = b[i] * growth[i] * rates[i] * series.start
            transform[2 * rank + 1, 2 * i + 1] = growth[i]
            to_log_rates[i, 2 * i] = 1.0
        else:
            transform[2 * rank + 1, n_free + i] = growth[i]
    fitted = series.fitted_offsets
    transform[2 * n_states + fitted, n_parameters - len(fitted) + np.arange(len(fitted))] = (
        series.peak
    )
    return transform, to_log_rates
