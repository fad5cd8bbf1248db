"""Conversion of a fit from its own units to the user's: rates, amplitudes, covariance, warnings."""

from dataclasses import dataclass

import numpy as np

from labrig.fit.decay.covariance import covariances, fitted_covariance, to_units
from labrig.fit.decay.diagnostics import unseen_flicker
from labrig.fit.decay.fit_warnings import FitDiagnostics, bend, warnings_about
from labrig.fit.decay.further_state import FastStates, drift_effect, fast_states, hidden_state
from labrig.fit.decay.law_fit import LAW_RATE, LawFit
from labrig.fit.decay.noise_correlation import NoiseCorrelation, noise_correlation
from labrig.fit.decay.profile_intervals import decay_intervals
from labrig.fit.decay.series import DecaySeries, WhitenedSeries
from labrig.fit.decay.states import StatesFit
from labrig.fit.decay.variable_projection import weight_sigma
from labrig.foundation.arrays import FloatArray
from labrig.results import (
    DecayReference,
    DecayState,
    FittedDecay,
    UnseenFlicker,
    UnseenState,
    first_row_at,
)


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
    of_parameters = fitted_covariance(fit, data, diagnostics)
    # Unweighted least squares: σ is that of the curvature, as every program's.
    is_plain = diagnostics.scatter is not None and diagnostics.scatter.is_of_residuals
    fast = None if is_plain else fast_states(data, fit)
    hidden = None if fast is None else hidden_state(data, fit, fast)
    if hidden is not None:
        of_parameters = of_parameters + hidden.covariance
    correlation = None if is_plain else _noise_correlation(data, fit, diagnostics)
    laws = diagnostics.laws
    if correlation is not None:
        of_parameters = of_parameters + correlation.added_covariance(
            data, joint, fit.signal(series)
        )
        laws = tuple(_with_correlation(each, diagnostics.data, correlation) for each in laws)
    covariance, log_rate_covariance = covariances(fit, data, of_parameters)
    intervals, interval_warnings = decay_intervals(data, fit, of_parameters, laws, diagnostics)
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
    weights_sigma = weight_sigma(joint, of_parameters)
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
                bend(data, fit, of_parameters),
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
    derivatives, _ = to_units(fit, data)
    changes = (derivatives @ effects)[: 2 * fit.n_states].reshape(fit.n_states, 2, -1)
    values = np.array([[state.k_r_per_s, state.amplitude] for state in states])
    return np.asarray(changes / values[..., None])


def _unseen_state(
    fit: StatesFit, data: WhitenedSeries, fast: FastStates, states: tuple[DecayState, ...]
) -> UnseenState:
    """Return the fast state that at its limit would change a rate by the most σ."""
    limit = fast.limit
    changes = _relative_changes(fit, data, states, fast.further.effect * limit)
    relative_sigma = np.array([state.k_r_per_s_sigma / state.k_r_per_s for state in states])
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
