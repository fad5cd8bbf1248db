"""Refusals of a decay fit, and the warnings in its result.

In a frame all channels have flicker and decay in common: only their ratios are compared. A sensor
that shows s (1 + β s) of a level s changes them in proportion to the level. With c the column of
that bend, across the signal in every frame, and J that of the channels' weights and offsets,
q = c − J J⁺c is what only the bend explains, and β = −q·r/q² ± 1/|q|. What it does to the fitted
parameters is −β J⁺c, with J and c in full, along the signal, too.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import chdtrc

from labrig.fit.decay.diagnostics import (
    MISFIT_LEVEL,
    FitResiduals,
    below_zero_warnings,
    misfit_warnings,
    offset_warnings,
    rise_in_sigmas,
    small_chi2_warnings,
    state_warnings,
)
from labrig.fit.decay.envelope import MIN_NOISE_DOF, Envelope, SigmaScale
from labrig.fit.decay.further_state import HiddenState
from labrig.fit.decay.law_fit import LawFit
from labrig.fit.decay.noise_correlation import NoiseCorrelation
from labrig.fit.decay.series import WhitenedSeries
from labrig.fit.decay.states import StatesFit
from labrig.fit.decay.variable_projection import JointFit
from labrig.foundation.arrays import FloatArray
from labrig.foundation.detection import STRONG_EVIDENCE_DELTA_BIC
from labrig.foundation.errors import FitError
from labrig.foundation.result_warning import (
    Contradiction,
    Disturbance,
    Misfit,
    ResultWarning,
    Undetermined,
)
from labrig.results import (
    EXPONENTIALS,
    LAW_LABELS,
    RATE_SPECTRUM,
    Candidate,
    DecayState,
    FittedLaw,
    FittedRateSpectrum,
    Measured,
    ScatterSigma,
    recommended_sampling,
)

#: Significance of a bend in σ, a chance of 6 in 100,000 without one.
BEND_SIGMAS = 4.0
#: Change of a fitted parameter in its σ from which a bend matters.
MATTERS_SIGMAS = 0.5
#: Part of the bend that weights and offsets must leave over; less is rounding.
MIN_OWN = 1e-4
#: Smallest slope of the parameters that counts as dependent.
RCOND = 1e-10


@dataclass(frozen=True)
class Bend:
    """Deviation from proportion, and what it does.

    Attributes
    ----------
    at_brightest, sigma
        Relative deviation at the highest level, negative if it falls short, and σ.
    effect_sigmas
        Largest change of a fitted rate or amplitude, in its σ.
    rest_chi2, dof
        χ² between the channels beside the bend, and its degrees of freedom.
    """

    at_brightest: float
    sigma: float
    effect_sigmas: float
    rest_chi2: float
    dof: float

    @property
    def is_evident(self) -> bool:
        """True if there is one that matters, and nothing else changes the channels' ratios."""
        is_significant = abs(self.at_brightest) > BEND_SIGMAS * self.sigma
        explains = chdtrc(max(self.dof, 1), self.rest_chi2) > MISFIT_LEVEL
        return bool(is_significant and explains and self.effect_sigmas > MATTERS_SIGMAS)


def bend(data: WhitenedSeries, fit: StatesFit, covariance: FloatArray) -> Bend | None:
    """Return the bend of the sensor by the channels' ratios; None if they do not determine it.

    Parameters
    ----------
    data
        The series in units of its noise.
    fit
        The fit at its minimum.
    covariance
        Covariance of the fitted parameters, shape (p, p).
    """
    series, joint = data.series, fit.joint
    unit = data.constant(joint.weights)
    if len(series.channels) < 2 or not np.isfinite(covariance).all():
        return None
    level = np.maximum(fit.signal(series), 0.0) * _exposures(series.exposure)[:, None]
    column = np.zeros(len(data.target))
    bent = np.einsum("fcd,fd->fc", data.matrices, fit.signal(series) * level / level.max())
    column[: unit.size] = bent.ravel()
    jacobian, residuals = joint.least_squares.jacobian, joint.least_squares.residuals
    shape = len(joint.shape)
    of_ratios = _across(np.column_stack([jacobian[:, shape:], column, residuals]), unit)
    nuisance, own, rest = of_ratios[:, :-2], of_ratios[:, -2], of_ratios[:, -1]
    own = own - nuisance @ _solved(nuisance, own)
    own2 = float(own @ own)
    if own2 <= MIN_OWN**2 * float(column @ column):
        return None
    rest = rest - nuisance @ _solved(nuisance, rest)
    found = -float(own @ rest) / own2
    left = rest + found * own
    dof = series.n_values - series.n_frames - np.linalg.matrix_rank(nuisance) - 1
    rest_chi2 = float(left @ left)
    effect = found * _solved(jacobian, column)
    sigma = np.sqrt(np.diag(covariance)[:shape])
    return Bend(
        at_brightest=found,
        sigma=own2**-0.5,
        effect_sigmas=float(np.max(np.abs(effect[:shape]) / np.where(sigma > 0, sigma, np.inf))),
        rest_chi2=rest_chi2,
        dof=dof,
    )


def bend_warnings(found: Bend | None) -> list[ResultWarning]:
    """Return a warning where a bend of the sensor matters."""
    if found is None or not found.is_evident:
        return []
    return [
        Disturbance(
            "sensor-nonlinear",
            "bright values {direction} proportion, by {deviation} at the brightest: the channels' "
            "ratios change with their level, as of a sensor that is not linear, which moves rates "
            "and amplitudes by up to {effect_sigmas:.2g} σ; expose for less, or it is the states "
            "that differ in colour: fit the channels one by one",
            direction="fall short of" if found.at_brightest < 0 else "exceed",
            deviation=Measured(100 * abs(found.at_brightest), 100 * found.sigma, "%"),
            effect_sigmas=found.effect_sigmas,
        )
    ]


def _exposures(exposure: FloatArray) -> FloatArray:
    """Return the exposure times, or ones where the values are no means over exposures."""
    return exposure if exposure.min() > 0 else np.ones_like(exposure)


def _across(rows: FloatArray, unit: FloatArray) -> FloatArray:
    """Return rows (n C + p, q), those of frames without their part along the signal (n, C)."""
    length = np.linalg.norm(unit, axis=1)
    direction = unit / np.where(length > 0, length, 1.0)[:, None]
    across = rows.copy()
    frames = across[: unit.size].reshape(*unit.shape, -1)
    frames -= direction[:, :, None] * np.einsum("fc,fcq->fq", direction, frames)[:, None, :]
    return across


def _solved(design: FloatArray, target: FloatArray) -> FloatArray:
    """Return the least-squares solution; columns of rounding have none of it."""
    norms = np.linalg.norm(design, axis=0)
    scale = np.where(norms > 0, norms, 1.0)
    solution: FloatArray = np.linalg.lstsq(design / scale, target, rcond=RCOND)[0] / scale
    return solution


RISING_SIGMAS = 5.0
#: Residuals over the largest value below which they are those of numbers' last digits, which are
#: finer for small numbers than for large ones.
ROUNDING = 1e-6
#: Degrees of freedom of an estimated flicker below which its prior makes σ: Student's t then has no
#: variance. Above, the flicker's own uncertainty is in σ.
MIN_FLICKER_DOF = 2.0
#: Distance in log k from the slowest rate searched below which a rate is at that bound.
AT_BOUND = 1e-3


@dataclass(frozen=True)
class FitDiagnostics:
    """Steps that led to the selected fit.

    Attributes
    ----------
    data
        Series whitened by the envelope's signal, which all candidates and laws were fitted to.
    noise, noise_dof
        Envelope, and its degrees of freedom if σ or flicker were estimated from it, else inf.
    scatter
        Uncertainties of the values from their scatter; None if they were given.
    sigma_scale
        Factor of the given σ; None if they agree with the scatter of the values.
    candidates
        Numbers of states that were tried.
    law
        Name of the law that describes the decay.
    laws, rate_spectrum
        Other laws, and the spectrum of rates.
    unfinished_laws
        Names of the laws whose fit did not end at a minimum and is not compared.
    all_needed
        Whether the data refute one state fewer.
    asked, most_states, n_fixed
        Requested number of states, largest number that was to be tried and number of fixed rates.
    all_intervals
        Whether every rate and parameter of the law is to have an interval.
    """

    data: WhitenedSeries
    noise: Envelope
    noise_dof: float
    scatter: ScatterSigma | None
    sigma_scale: SigmaScale | None
    candidates: tuple[Candidate, ...]
    law: str
    laws: tuple[LawFit, ...]
    rate_spectrum: FittedRateSpectrum | None
    unfinished_laws: tuple[str, ...]
    all_needed: bool
    asked: int | None
    most_states: int
    n_fixed: int
    all_intervals: bool

    @property
    def sigma_dof(self) -> float:
        """Degrees of freedom of the values' estimated σ; infinite where it was given."""
        estimated = self.scatter or self.sigma_scale
        return np.inf if estimated is None else estimated.dof

    @property
    def student(self) -> float:
        """Factor ν/(ν − 2) of every variance where σ was estimated with ν degrees of freedom.

        Unweighted least squares has none, as every program's.
        """
        is_plain = self.scatter is not None and self.scatter.is_of_residuals
        return 1.0 if is_plain else student_factor(self.sigma_dof)

    @property
    def other_laws(self) -> list[FittedLaw | FittedRateSpectrum]:
        """Laws other than exponentials, the one of lowest BIC first."""
        laws: list[FittedLaw | FittedRateSpectrum] = [each.fitted for each in self.laws]
        if self.rate_spectrum is not None:
            laws.append(self.rate_spectrum)
        return sorted(laws, key=lambda law: law.bic)

    @property
    def chosen_law(self) -> LawFit | None:
        """Law that describes the decay; None if exponentials or a spectrum of rates do."""
        return next((each for each in self.laws if each.fitted.name == self.law), None)

    @property
    def exponentials_bic(self) -> float:
        """Lowest BIC of the numbers of states that were tried."""
        return min(candidate.bic for candidate in self.candidates)

    @property
    def is_another_better(self) -> bool:
        """Whether a law other than exponentials is clearly better."""
        laws = self.other_laws
        return bool(laws) and laws[0].bic < self.exponentials_bic - STRONG_EVIDENCE_DELTA_BIC


def student_factor(dof: float) -> float:
    """Return ν/(ν − 2), the factor of a variance whose σ has ν degrees of freedom."""
    if np.isinf(dof):
        return 1.0
    return dof / (dof - 2) if dof > 2 else float("inf")


def refuse_if_rising(data: WhitenedSeries, weights: FloatArray) -> None:
    """Refuse to fit a decay to a rising signal.

    Raises
    ------
    FitError
        The last quarter of the frames is clearly brighter than the first.
    """
    rise = rise_in_sigmas(*_common_signal(data, weights, np.zeros_like(weights)))
    if rise > RISING_SIGMAS:
        raise FitError(
            "expected a signal that decays, got one that rises: its last quarter is brighter than "
            f"its first by {rise:.0f} σ; was the lamp off, do times and values belong together?"
        )


def refuse_if_constant(fit: StatesFit, data: WhitenedSeries) -> None:
    """Refuse to fit a rate to a constant signal.

    Raises
    ------
    FitError
        There is one state, and its rate is the slowest one searched.
    """
    slowest, _ = data.series.log_rate_bounds
    if fit.n_states == fit.n_free == 1 and fit.log_rates[0] < slowest + AT_BOUND:
        raise FitError(
            "expected a signal that decays, got one that is constant within its noise for "
            f"{data.series.span_s:.4g} s; was the sample charged, is it a background that was "
            "measured? Else record longer"
        )


def warnings_about(
    data: WhitenedSeries,
    fit: StatesFit,
    states: tuple[DecayState, ...],
    log_rate_covariance: FloatArray,
    diagnostics: FitDiagnostics,
    hidden: HiddenState | None,
    correlation: NoiseCorrelation | None,
    bent: Bend | None,
) -> list[ResultWarning]:
    """Return the warnings about a fit.

    Parameters
    ----------
    data
        Series whitened for `fit`.
    fit, states
        The fit, and its states in the user's units by falling rate.
    log_rate_covariance
        Covariance of log k of `states`, shape (n, n).
    diagnostics
        Steps that led to the fit.
    hidden
        A fast state that the data may hide; None if there is no room for one.
    correlation
        Correlation of neighbouring values' noise; None if it is not likely.
    bent
        Bend of the sensor; None if the channels do not determine it.
    """
    series, joint = data.series, fit.joint
    warnings: list[ResultWarning] = []
    if fit.dof(data) <= 0:
        warnings.append(
            Undetermined(
                "no-degrees-of-freedom",
                "there are no more values than parameters: nothing is left to test the fit with; "
                "record more",
                degrees_of_freedom=fit.dof(data),
            )
        )
    if diagnostics.noise_dof < MIN_NOISE_DOF and diagnostics.scatter:
        warnings.append(
            Undetermined(
                "sigma-from-few-values",
                "σ was taken from the scatter of {spare_values:.0f} values to spare: give each "
                "value's σ in a column sigma, or record more",
                spare_values=max(diagnostics.noise_dof, 0),
            )
        )
    elif diagnostics.sigma_scale is not None:
        warnings.append(
            Contradiction(
                "sigma-rescaled",
                "the values scatter {factor:2r} times as much as their σ implies, and it was "
                "multiplied by that: check its column and its unit",
                factor=diagnostics.sigma_scale.factor,
            )
        )
    elif diagnostics.noise_dof < MIN_FLICKER_DOF:
        warnings.append(
            Undetermined(
                "flicker-from-few-frames",
                "flicker was estimated from {bright_frames:.0f} frames' worth of bright signal: "
                "give a flicker measured elsewhere, or record more frames while it is bright",
                bright_frames=max(diagnostics.noise_dof, 1),
            )
        )
    if joint.least_squares.creeps:
        warnings.append(
            Undetermined(
                "fit-unconverged",
                "the fit has not converged: rates and amplitudes may trade off; ask for fewer "
                "states (--states) or record longer",
            )
        )
    warnings += [
        Undetermined(
            "law-unconverged",
            "the fit of {law} did not end at a minimum: it is not compared with the others; record "
            "longer, or with less noise",
            law=LAW_LABELS[name],
        )
        for name in diagnostics.unfinished_laws
    ]
    requested = diagnostics.asked or diagnostics.n_fixed
    if fit.n_states < requested:
        warnings.append(
            Undetermined(
                "states-unsupported",
                "{requested} states were asked for, the data support {supported}: the others' "
                "amplitude is zero; ask for fewer (--states {supported}) or take more light",
                requested=requested,
                supported=fit.n_states,
            )
        )
    is_exponential = diagnostics.law == EXPONENTIALS
    if not is_exponential or diagnostics.is_another_better:
        warnings.append(_law_warning(fit, diagnostics))
    chosen = joint if diagnostics.chosen_law is None else diagnostics.chosen_law.joint
    dof = fit.dof(data) + joint.n_parameters - chosen.n_parameters
    closer = small_chi2_warnings(chosen.chi2, dof, diagnostics.scatter is not None)
    warnings += closer
    # The order of residuals that are far smaller than any scatter is that of rounding errors.
    of_residuals = diagnostics.scatter is not None and diagnostics.scatter.is_of_residuals
    is_exact = of_residuals and float(series.inverse_sigma.max()) * ROUNDING > 1
    is_rounding = (bool(closer) and diagnostics.scatter is not None) or is_exact
    if not is_rounding and diagnostics.law != RATE_SPECTRUM:
        law = diagnostics.chosen_law
        judged = (data, joint) if law is None else (diagnostics.data, law.joint)
        warnings += misfit_warnings(
            _residuals(*judged, diagnostics, bent),
            _exponentials(fit.n_states) if is_exponential else LAW_LABELS[diagnostics.law],
            f"{_advice(fit, diagnostics)}; check background and times (labrig fit decay --offset, "
            "--origin, --from)",
        )
    warnings += bend_warnings(bent)
    free_offset = bool(np.isinf(series.offset_sigma).any())
    if not free_offset:
        warnings += below_zero_warnings(*_common_signal(data, joint.weights, joint.offsets))
    warnings += offset_warnings(series.channels, joint.offsets, series.offset_sigma)
    if correlation is not None and correlation.is_reported and not is_rounding:
        warnings.append(
            Disturbance(
                "noise-correlated",
                "the noise of neighbouring values correlates (by {correlation:.1f}): σ allows for "
                "it, and is up to {factor:.2g} times as large as for independent values; find the "
                "drift, or measure a steady light beside the sample",
                correlation=correlation.correlation,
                factor=correlation.factor,
            )
        )
    if not is_exponential:
        return warnings
    if hidden is not None and hidden.is_likely:
        warnings.append(_hidden_warning(hidden, fit.n_states, series.span_s))
    low, high = series.log_rate_bounds
    return warnings + state_warnings(
        states,
        log_rate_covariance,
        series.span_s,
        (float(np.exp(low)) / series.span_s, float(np.exp(high)) / series.span_s),
        diagnostics.all_needed,
        free_offset,
    )


def _advice(fit: StatesFit, diagnostics: FitDiagnostics) -> str:
    """Return what there is to try if the residuals say that the shape is wrong."""
    if fit.n_states == diagnostics.asked:
        return f"allow more states (--states {fit.n_states + 1})"
    if diagnostics.is_another_better:
        return "see the other laws that were fitted (--law)"
    if fit.n_states < diagnostics.most_states:
        return (
            f"{fit.n_states + 1} states were tried, the data do not support them, and no other law "
            "describes it clearly better"
        )
    return "no other law describes it clearly better"


def _exponentials(n_states: int) -> str:
    return f"{n_states} exponential{'s' if n_states > 1 else ''}"


def _hidden_warning(hidden: HiddenState, n_states: int, span_s: float) -> ResultWarning:
    lifetime_s = hidden.lifetime * span_s
    return Undetermined(
        "state-hidden",
        "a state {state} of about {share_percent:.0f} % with a lifetime around {lifetime_s:.2g} s "
        "may hide in the first frames, which do not resolve it; σ allows for it: take {sampling}",
        state=n_states + 1,
        share_percent=100 * hidden.share,
        lifetime_s=lifetime_s,
        sampling=recommended_sampling(lifetime_s),
    )


def _common_signal(
    data: WhitenedSeries, weights: FloatArray, offsets: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the weighted signal of all channels without `offsets`, and its 1/variance, (n,)."""
    unit = data.constant(weights)
    information = np.einsum("fc,fc->f", unit, unit)
    values = data.values - data.constant(offsets)
    common = np.einsum("fc,fc->f", unit, values) / np.where(information > 0, information, 1.0)
    return common, information


def _law_warning(fit: StatesFit, diagnostics: FitDiagnostics) -> ResultWarning:
    """Return the warning about rates of a decay that another law describes."""
    laws = diagnostics.other_laws
    law = next((law for law in laws if law.name == diagnostics.law), laws[0])
    gain = diagnostics.exponentials_bic - law.bic
    values: dict[str, Any] = {
        "law": LAW_LABELS[law.name],
        "formula": law.formula,
        "exponentials": _exponentials(fit.n_states),
        "delta_bic": gain,
    }
    if gain <= 0:
        return Misfit(
            "rates-descriptive",
            "{law} ({formula}) describes this decay beside {exponentials}: the rates are "
            "descriptive only, do not extrapolate them beyond the times recorded",
            **values,
        )
    return Misfit(
        "rates-descriptive",
        "{law} ({formula}) describes this decay better than {exponentials} (ΔBIC {delta_bic:2r}): "
        "the rates are descriptive only, do not extrapolate them beyond the times recorded",
        **values,
    )


def _residuals(
    data: WhitenedSeries, joint: JointFit, diagnostics: FitDiagnostics, bent: Bend | None
) -> FitResiduals:
    """Return the residuals to test; those of an evident bend of the sensor are left out."""
    series = data.series
    frames, squared_snr = joint.frame_residuals(data)
    n_frames = int(np.count_nonzero(series.inverse_sigma.any(axis=1)))
    along, across = joint.leverage(data)
    residuals = joint.least_squares.residuals[: series.values.size]
    colour_chi2 = max(float(residuals @ residuals - frames @ frames), 0.0)
    if bent is not None and bent.is_evident:
        colour_chi2 = bent.rest_chi2
    return FitResiduals(
        t_s=series.t_s,
        frames=frames,
        frame_dof=n_frames - along,
        colour_chi2=colour_chi2,
        colour_dof=series.n_values - n_frames - across,
        noise_dof=diagnostics.noise_dof,
        middle_s=series.t_s + series.exposure * series.span_s / 2,
        signal_to_noise=np.sqrt(squared_snr),
        repeat=series.repeat,
    )
