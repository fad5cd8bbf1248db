"""From the fit's own units to the user's: rates, amplitudes, covariance, warnings."""

from dataclasses import dataclass

import numpy as np

from labrig.fit.decay.diagnostics import (
    Misfit,
    misfit_warnings,
    offset_warnings,
    rising_warning,
    state_warnings,
)
from labrig.fit.decay.envelope import FEWEST_NOISE_DOF, Envelope
from labrig.fit.decay.joint import weight_sigma
from labrig.fit.decay.result import DecayFit, DecayState
from labrig.fit.decay.rivals import Rival
from labrig.fit.decay.selection import Candidate, bic
from labrig.fit.decay.states import StatesFit
from labrig.fit.decay.whitening import WhitenedSeries
from labrig.fit.least_squares import FloatArray


@dataclass(frozen=True)
class Evidence:
    """What led to the fit chosen.

    Attributes
    ----------
    noise, noise_dof
        The envelope; its degrees of freedom if σ or flicker come from it, else inf.
    candidates, rivals
        What was tried.
    better_rival
        The rival that does clearly better than exponentials, if one does.
    asked, max_states, n_fixed
        As the user had it.
    """

    noise: Envelope
    noise_dof: float
    candidates: tuple[Candidate, ...]
    rivals: tuple[Rival, ...]
    better_rival: Rival | None
    asked: int | None
    max_states: int
    n_fixed: int


def assemble(data: WhitenedSeries, fit: StatesFit, evidence: Evidence) -> DecayFit:
    """The result in the user's units and order of frames."""
    series, joint = data.series, fit.joint
    inflation = _inflation(fit, data, evidence)
    covariance, log_rate_covariance = _covariances(fit, data)
    covariance, log_rate_covariance = covariance * inflation, log_rate_covariance * inflation
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
    weights_sigma = weight_sigma(joint) * np.sqrt(inflation)
    residuals = np.empty_like(series.values)
    residuals[series.order] = series.values - fit.signal(series) - joint.offsets
    brightest = [*range(2 * fit.n_states), 2 * fit.n_states + int(np.argmax(joint.weights))]
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
        flicker=evidence.noise.flicker,
        flicker_sigma=evidence.noise.flicker_sigma,
        chi2=joint.chi2,
        dof=_dof(fit, data),
        bic=bic(data, joint),
        covariance=covariance[np.ix_(brightest, brightest)],
        warnings=tuple(
            _warnings(data, fit, states, log_rate_covariance[np.ix_(order, order)], evidence)
        ),
        candidates=evidence.candidates,
        rivals=evidence.rivals,
        better_rival=evidence.better_rival,
        residuals=residuals * series.peak,
        normalised_residuals=normalised,
    )


def _dof(fit: StatesFit, data: WhitenedSeries) -> int:
    """Values measured, and the offsets' priors, minus parameters."""
    n_priors = len(data.target) - data.values.size
    return data.series.n_values + n_priors - fit.joint.n_parameters


def _inflation(fit: StatesFit, data: WhitenedSeries, evidence: Evidence) -> float:
    """By how much the variances grow because the noise itself was estimated.

    A parameter over an estimated σ with ν degrees of freedom follows Student's t, whose variance is
    ν/(ν − 2).
    """
    if not data.series.sigma_given:
        dof = _dof(fit, data)
        return fit.joint.chi2 / dof if dof > 0 else float("inf")
    if np.isinf(evidence.noise_dof):
        return 1.0
    return evidence.noise_dof / max(evidence.noise_dof - 2, 1.0)


def _covariances(fit: StatesFit, data: WhitenedSeries) -> tuple[FloatArray, FloatArray]:
    """Of k1, a1, … by falling rate and all offsets in the user's units; of log k, free first."""
    series, n_free = data.series, fit.n_free
    own = fit.joint.least_squares.covariance
    n_states = fit.n_states
    order = np.argsort(-fit.log_rates, kind="stable")
    rates = np.exp(fit.log_rates)
    b = fit.amplitudes
    # Amplitudes are fitted at the first frame, given at lamp off: a = b e^(k t₀).
    grown = np.exp(rates * series.start) * series.peak
    transform = np.zeros((2 * n_states + len(series.channels), len(own)))
    to_log_rates = np.zeros((n_states, len(own)))
    for place, i in enumerate(order):
        if i < n_free:
            transform[2 * place, 2 * i] = rates[i] / series.span_s
            transform[2 * place + 1, 2 * i] = b[i] * grown[i] * rates[i] * series.start
            transform[2 * place + 1, 2 * i + 1] = grown[i]
            to_log_rates[i, 2 * i] = 1.0
        else:
            transform[2 * place + 1, n_free + i] = grown[i]
    fitted = series.fitted_offsets
    transform[2 * n_states + fitted, len(own) - len(fitted) + np.arange(len(fitted))] = series.peak
    return _propagated(own, transform), _propagated(own, to_log_rates)


def _propagated(covariance: FloatArray, transform: FloatArray) -> FloatArray:
    """T Cov Tᵀ, where an infinite variance stays one and correlates with nothing."""
    known = np.isfinite(np.diag(covariance))
    finite = np.where(np.multiply.outer(known, known), covariance, 0.0)
    # What the data say nothing about may overflow: that is as good as infinite.
    with np.errstate(over="ignore", invalid="ignore"):
        result: FloatArray = transform @ finite @ transform.T
    unknown = (transform[:, ~known] != 0).any(axis=1) | ~np.isfinite(np.diag(result))
    result[unknown, :] = 0.0
    result[:, unknown] = 0.0
    result[unknown, unknown] = np.inf
    return np.where(np.isfinite(result) | np.eye(len(result), dtype=bool), result, 0.0)


def _misfit(data: WhitenedSeries, fit: StatesFit, evidence: Evidence) -> Misfit:
    series, joint = data.series, fit.joint
    frames, _ = joint.frame_residuals(data)
    n_frames = int(np.count_nonzero(series.inverse_sigma.any(axis=1)))
    along, across = joint.followed(data)
    residuals = joint.least_squares.residuals[: series.values.size]
    return Misfit(
        frames=frames,
        frame_dof=n_frames - along,
        colour_chi2=max(float(residuals @ residuals - frames @ frames), 0.0),
        colour_dof=series.n_values - n_frames - across,
        noise_dof=evidence.noise_dof,
    )


def _warnings(
    data: WhitenedSeries,
    fit: StatesFit,
    states: tuple[DecayState, ...],
    log_rate_covariance: FloatArray,
    evidence: Evidence,
) -> list[str]:
    series, joint = data.series, fit.joint
    warnings = []
    if not series.sigma_given:
        scatter = np.sqrt(joint.chi2 / max(_dof(fit, data), 1)) * series.peak
        scatter /= series.inverse_sigma.max()
        warnings.append(
            f"σ was not given: taken as {scatter:.3g} for all values, from their scatter; "
            "give each value's σ for the right weights"
        )
    if evidence.noise_dof < FEWEST_NOISE_DOF:
        warnings.append(
            f"flicker was estimated from {max(evidence.noise_dof, 1):.0f} frames' worth of bright "
            "signal: give a flicker measured elsewhere, or record more frames while it is bright"
        )
    wanted = evidence.asked or evidence.n_fixed
    if fit.n_states < wanted:
        warnings.append(
            f"{wanted} states were asked for, the data support {fit.n_states}: "
            "the others' amplitude is zero; ask for fewer or take more light"
        )
    rival = evidence.better_rival
    if rival is not None:
        n = evidence.candidates[-1].n_states
        warnings.append(
            f"a {rival.name} {rival.formula} fits better than {n} exponential"
            f"{'s' if n > 1 else ''}: the rates are descriptive only, "
            "do not extrapolate them beyond the times recorded"
        )
    more = (
        "allow more states"
        if fit.n_states < evidence.max_states
        else "look for another law of decay"
    )
    warnings += misfit_warnings(
        _misfit(data, fit, evidence), fit.n_states, f"{more}, and check background and times"
    )
    warnings += offset_warnings(series.channels, joint.offsets, series.offset_sigma)
    low, high = series.log_rate_bounds
    warnings += state_warnings(
        states,
        log_rate_covariance,
        series.span_s,
        (float(np.exp(low)) / series.span_s, float(np.exp(high)) / series.span_s),
    )
    unit = data.constant(joint.weights)
    information = np.einsum("fc,fc->f", unit, unit)
    common = np.einsum("fc,fc->f", unit, data.values) / np.where(information > 0, information, 1.0)
    return warnings + rising_warning(common, information)
