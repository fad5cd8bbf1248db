"""Conversion of a fit from its own units to the user's: rates, amplitudes, covariance, warnings.

Where a model misses the curve, its own curvature acts on the parameters: the Hessian of χ²/2 is
H = JᵀJ − Σ r ∇²m with r the misfit over σ² and m the model, and the covariance is H⁻¹ JᵀJ H⁻¹, not
(JᵀJ)⁻¹ (H. White, Econometrica 50, 1982). For the rates of two or three exponentials that are
fitted to a decay of distributed rates, σ is up to twice as large that way.
"""

from dataclasses import dataclass

import numpy as np

from labrig.fit.decay.diagnostics import unseen_flicker
from labrig.fit.decay.envelope import Envelope
from labrig.fit.decay.fit_warnings import FitDiagnostics, bend, warnings_about
from labrig.fit.decay.further_state import FastStates, drift_effect, fast_states, hidden_state
from labrig.fit.decay.intervals import decay_intervals
from labrig.fit.decay.laws import LAW_RATE, LawFit
from labrig.fit.decay.noise_correlation import NoiseCorrelation, noise_correlation
from labrig.fit.decay.series import DecaySeries, WhitenedSeries
from labrig.fit.decay.states import StatesFit, exponentials
from labrig.fit.decay.variable_projection import covariance_under_flicker, weight_sigma
from labrig.fit.nonlinear_least_squares import propagated_covariance
from labrig.foundation.arrays import FloatArray
from labrig.results import (
    DecayReference,
    DecayState,
    FittedDecay,
    UnseenFlicker,
    UnseenState,
    first_row_at,
)

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


@dataclass(frozen=True)
class DecayFit(FittedDecay):
    """Result of a decay fit with its residuals.

    Attributes
    ----------
    sigma
        Standard uncertainties of the values without flicker, in their unit: those given, or those
        from their scatter, in the order given, shape (n, C); inf where left out.
    residuals, normalised_residuals
        Value − model, one row per frame in the order given, one column per channel: in the values'
        unit, and whitened (independent, of unit variance if the noise is as assumed).
    drift_effect_s
        Relative changes of rate and amplitude of every state if all rates of the sample grow as
        1 + γ t while it glows, over γ, in seconds, shape (n_states, 2): NaN where held.
    """

    sigma: FloatArray
    residuals: FloatArray
    normalised_residuals: FloatArray
    drift_effect_s: FloatArray


def assemble(data: WhitenedSeries, fit: StatesFit, diagnostics: FitDiagnostics) -> DecayFit:
    """Convert the fit to the user's units and order of frames."""
    series, joint = data.series, fit.joint
    fitted_covariance = _fitted_covariance(fit, data, diagnostics)
    # Unweighted least squares: σ is that of the curvature, as every program's.
    is_plain = diagnostics.scatter is not None and diagnostics.scatter.is_of_residuals
    fast = None if is_plain else fast_states(data, fit)
    hidden = None if fast is None else hidden_state(data, fit, fast)
    if hidden is not None:
        fitted_covariance = fitted_covariance + hidden.covariance
    correlation = None if is_plain else _noise_correlation(data, fit, diagnostics)
    laws = diagnostics.laws
    if correlation is not None:
        fitted_covariance = fitted_covariance + correlation.added_covariance(
            data, joint, fit.signal(series)
        )
        laws = tuple(_with_correlation(each, diagnostics.data, correlation) for each in laws)
    covariance, log_rate_covariance = _covariances(fit, data, fitted_covariance)
    intervals, interval_warnings = decay_intervals(data, fit, fitted_covariance, laws, diagnostics)
    order = np.argsort(-fit.log_rates, kind="stable")
    rates = np.exp(fit.log_rates[order]) / series.span_s
    amplitudes = (fit.amplitudes * np.exp(np.exp(fit.log_rates) * series.start))[
        order
    ] * series.peak
    sigma = np.sqrt(np.diag(covariance))
    states = tuple(
        DecayState(
            float(rates[i]), float(sigma[2 * i]), float(amplitudes[i]), float(sigma[2 * i + 1])
        )
        for i in range(fit.n_states)
    )
    weights_sigma = weight_sigma(joint, fitted_covariance)
    residuals = np.empty_like(series.values)
    residual = series.values - fit.signal(series) - joint.offsets
    residuals[series.order] = residual * series.frame_levels
    sigma_used = np.empty_like(series.values)
    with np.errstate(divide="ignore"):
        sigma_used[series.order] = series.frame_levels * series.peak / series.inverse_sigma
    kept = [*range(2 * fit.n_states), 2 * fit.n_states + int(np.argmax(joint.weights))]
    normalised = np.empty_like(series.values)
    n_values = series.values.size
    normalised[series.order] = -joint.least_squares.residuals[:n_values].reshape(
        series.values.shape
    )
    return DecayFit(
        states=states,
        channels=series.channels,
        channel_weights=tuple(joint.weights.tolist()),
        channel_weights_sigma=tuple(weights_sigma.tolist()),
        offsets=tuple((joint.offsets * series.peak).tolist()),
        offsets_sigma=tuple(sigma[2 * fit.n_states :].tolist()),
        repeats=series.repeats,
        levels=tuple(series.levels.tolist()),
        flicker=diagnostics.noise.flicker,
        flicker_sigma=diagnostics.noise.flicker_sigma,
        chi2=joint.chi2,
        dof=fit.dof(data),
        bic=joint.chi2 + joint.n_parameters * float(np.log(data.independent_data(joint.weights))),
        covariance=covariance[np.ix_(kept, kept)],
        warnings=(
            *warnings_about(
                data,
                fit,
                states,
                log_rate_covariance[np.ix_(order, order)],
                diagnostics,
                hidden,
                correlation,
                bend(data, fit, fitted_covariance),
            ),
            *interval_warnings,
        ),
        candidates=diagnostics.candidates,
        law=diagnostics.law,
        laws=tuple(each.fitted for each in laws),
        rate_spectrum=diagnostics.rate_spectrum,
        measured_until_s=series.first_s + float((series.t + series.exposure).max()) * series.span_s,
        reference=(
            DecayReference() if series.reference_s == 0 else first_row_at(series.reference_s)
        ),
        scatter=diagnostics.scatter,
        sigma_factor=diagnostics.sigma_scale.factor if diagnostics.sigma_scale else 1.0,
        # A likely one is told, and is in σ.
        unseen_state=(
            None
            if fast is None or (hidden is not None and hidden.is_likely)
            else _unseen_state(fit, data, fast, states)
        ),
        unseen_flicker=_unseen_flicker(series),
        sigma=sigma_used,
        residuals=residuals * series.peak,
        normalised_residuals=normalised,
        intervals=intervals,
        drift_effect_s=_drift_effect_s(fit, data, states),
    )


def _drift_effect_s(
    fit: StatesFit, data: WhitenedSeries, states: tuple[DecayState, ...]
) -> FloatArray:
    changes = _relative_changes(fit, data, states, drift_effect(data, fit)[:, None])[..., 0]
    return data.series.span_s * changes


def _relative_changes(
    fit: StatesFit, data: WhitenedSeries, states: tuple[DecayState, ...], effects: FloatArray
) -> FloatArray:
    """Return relative changes of rates and amplitudes by those of the parameters, (n, 2, m)."""
    to_units, _ = _to_units(fit, data)
    changes = (to_units @ effects)[: 2 * fit.n_states].reshape(fit.n_states, 2, -1)
    values = np.array([[state.k_r_per_s, state.amplitude] for state in states])
    return np.asarray(changes / values[..., None])


def _unseen_state(
    fit: StatesFit, data: WhitenedSeries, fast: FastStates, states: tuple[DecayState, ...]
) -> UnseenState:
    """Return the fast state that at its limit would change a rate by the most σ."""
    limit = fast.limit
    changes = _relative_changes(fit, data, states, fast.further.effect * limit)
    relative_sigma = np.array([state.k_r_sigma_per_s / state.k_r_per_s for state in states])
    held = relative_sigma == 0
    in_sigma = np.abs(changes[:, 0]) / np.where(held, np.inf, relative_sigma)[:, None]
    worst = int(np.argmax(in_sigma.max(axis=0)))
    return UnseenState(
        lifetime_s=float(np.exp(-fast.further.log_rates[worst])) * data.series.span_s,
        share=float(fast.share(limit, data, fit)[worst]),
        rate_changes=tuple(changes[:, 0, worst].tolist()),
        amplitude_changes=tuple(changes[:, 1, worst].tolist()),
    )


def _unseen_flicker(series: DecaySeries) -> UnseenFlicker | None:
    """Return what the frames after the charge with most of them hide."""
    measured = series.inverse_sigma.any(axis=1)
    most = np.argmax(np.bincount(series.repeat[measured]))
    rows = measured & (series.repeat == most)
    return unseen_flicker(series.t_s[rows], series.exposure[rows] * series.span_s)


def _noise_correlation(
    data: WhitenedSeries, fit: StatesFit, diagnostics: FitDiagnostics
) -> NoiseCorrelation | None:
    """Return how the noise correlates about the law that describes the decay."""
    law, noise = diagnostics.chosen_law, diagnostics.noise
    if law is None:
        rates = slice(0, 2 * fit.n_free, 2)
        return noise_correlation(data, fit.joint, fit.signal(data.series), rates, noise)
    signal = law.signal(diagnostics.data.series)
    return noise_correlation(diagnostics.data, law.joint, signal, LAW_RATE, noise)


def _with_correlation(law: LawFit, data: WhitenedSeries, correlation: NoiseCorrelation) -> LawFit:
    added = correlation.added_covariance(data, law.joint, law.signal(data.series))
    return law.with_inflated_covariance(added, data.series)


def _fitted_covariance(
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


def _covariances(
    fit: StatesFit, data: WhitenedSeries, fitted_covariance: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the covariance of k₁, a₁, … and all offsets in the user's units, and of log k.

    The former is by falling rate, the latter has free rates first.
    """
    to_units, to_log_rates = _to_units(fit, data)
    return (
        propagated_covariance(fitted_covariance, to_units),
        propagated_covariance(fitted_covariance, to_log_rates),
    )


def _to_units(fit: StatesFit, data: WhitenedSeries) -> tuple[FloatArray, FloatArray]:
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
