"""Joint fit of excitation rates, re-radiation rates and the sample's level of charge.

Nalbach et al. (sec. 4.6) fit k_e band by band under the assumption r_i(0) = 1. Here decay and
excitation are fitted together without that assumption: the curvature of the charging curve measures
the distance to saturation, and so separates Λ from r(0).
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from labrig.fit.excitation.intervals import IntervalChoice, excitation_intervals
from labrig.fit.excitation.levels import levels, levels_at_off
from labrig.fit.excitation.model_tests import (
    band_tests,
    found_errors,
    law_test,
    missing_signal,
    order_gain,
)
from labrig.fit.excitation.parameters import Rates, RelativeSigmas, bands_of, is_fitted
from labrig.fit.excitation.problem import ExcitationProblem
from labrig.fit.nonlinear_least_squares import (
    Ending,
    LeastSquaresFit,
    least_squares,
    propagated_covariance,
)
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from labrig.foundation.nonnegative import nonnegative_least_squares
from labrig.foundation.result_warning import Disturbance, Misfit, ResultWarning, Undetermined
from labrig.results import (
    BandTests,
    ChargingSeries,
    ConcentrationAtOff,
    ExcitedState,
    FittedExcitation,
    Measured,
    OneSided,
)

#: Guesses of the concentration of the brightest site, the least certain start value.
GUESSED_LEVELS = (0.05, 0.2, 0.5, 0.9)
#: Kinetic order at the start where orders are fitted.
START_ORDER = 1.5
#: Grid of κ over k_r.
KAPPA_OVER_K_R = np.geomspace(1e-5, 1e3, 65)


def starts(
    problem: ExcitationProblem, k_r_per_s: FloatArray, fractions: FloatArray, reference: int
) -> Iterator[FloatArray]:
    """Yield a start θ for each guessed level.

    Parameters
    ----------
    problem
        The least-squares problem.
    k_r_per_s, fractions
        Rates in 1/s and each state's fraction of the glow, from a decay, shape (N,).
    reference
        Index of the brightest channel.
    """
    fractions = fractions / fractions.sum()
    peak = max(float(np.nanmax(charging.values[..., reference])) for charging in problem.series)
    mean_rate = float(fractions @ k_r_per_s)
    for guess in GUESSED_LEVELS:
        total = peak / guess
        site_kappas = [
            _kappa(part, mean_rate, total, reference)
            for charging in problem.series
            for part in charging.by_light()
        ]
        kappa, design = np.concatenate(site_kappas), _irradiances(problem)
        k_e = nonnegative_least_squares(design, kappa)
        # A state that decays faster charges no further by the same light.
        order = START_ORDER if problem.parameters.order is None else problem.parameters.order
        # The glow at that level, and its rate, are those of the decay for any order.
        ease = guess ** (1 - order)
        yield problem.parameters.as_stated(
            k_r_per_s * ease / order,
            total * fractions * ease,
            np.outer(k_r_per_s / mean_rate, np.maximum(k_e, 1e-3 * k_e.max())),
            channel_weights(problem, reference),
            np.full(len(k_r_per_s), order),
        )


def _irradiances(problem: ExcitationProblem) -> FloatArray:
    return np.concatenate(
        [part.irradiance for charging in problem.series for part in charging.by_light()]
    )


def _kappa(series: ChargingSeries, k_r_per_s: float, total: float, reference: int) -> FloatArray:
    """Return the κ (P,) of each site that fits its glow best for one state of amplitude `total`."""
    bands = series.irradiance.shape[1]
    grid = ChargingSeries(
        series.name,
        series.charges,
        series.rise,
        series.fade,
        np.outer(KAPPA_OVER_K_R * k_r_per_s, np.ones(bands)) / bands,
        series.values,
        series.sigma,
    )
    glow = total * levels(grid, np.array([k_r_per_s]), np.ones((1, bands))).value[..., 0]
    values, sigma = series.values[..., reference], series.sigma[..., reference]
    measured = np.isfinite(values) & np.isfinite(sigma)
    weight = np.where(measured, 1 / np.where(measured, sigma, 1.0) ** 2, 0.0)
    misfit = np.nan_to_num(values)[:, :, None] - glow[:, None, :]
    chi2 = np.einsum("fp,fpg->pg", weight, misfit**2)
    best: FloatArray = KAPPA_OVER_K_R[np.argmin(chi2, axis=1)] * k_r_per_s
    return best


def channel_weights(problem: ExcitationProblem, reference: int) -> FloatArray:
    """Estimate channel weights (C,) over the reference from all values."""
    totals = sum(np.nansum(charging.values, axis=(0, 1)) for charging in problem.series)
    weights: FloatArray = np.maximum(totals / totals[reference], 0)
    return weights


#: Tolerance of the relative step, for the starting points and for the result.
ROUGH, FINE = 1e-3, 1e-6
#: Tolerances of the fits with the flicker's covariance by the one before; the third one has hardly
#: any effect.
WHITENINGS = (ROUGH, ROUGH, FINE)
MAX_ITERATIONS = 60
#: Number of iterations of a starting point of general order.
ROUGH_ITERATIONS = 15
#: Relative error of the light on a place, which the starting points take for noise.
LIGHT_SIGMA = 0.05
#: Factor from its start value within which the starting points leave a k_r.
ROUGH_K_R_FACTOR = 2.0
#: Gain in χ² of a step at which a starting point of general order is near enough.
ROUGH_GAIN = 0.1
#: Relative σ of an amplitude above which a warning is given.
LEVEL_KNOWN = 0.3
#: Missing signal in σ from which a warning is given.
CLEARLY_MISSING = 3.5
#: Reduced χ² above which a warning is given.
LARGE_CHI2 = 1.5


def fit_excitation(
    series: Sequence[ChargingSeries],
    k_r_per_s: ArrayLike,
    fractions: ArrayLike,
    uncertain: RelativeSigmas | None = None,
    near: FittedExcitation | None = None,
    order: float | None = 1.0,
    intervals: IntervalChoice = "none",
) -> FittedExcitation:
    """Fit all series together.

    Parameters
    ----------
    series
        Charging series; k_e belongs to the irradiance E of the one that `uncertain` says, by
        default the first.
    k_r_per_s, fractions
        Start values of the rates in 1/s and each state's fraction of the glow, such as from a decay
        fit, shape (N,).
    uncertain
        Further sources of scatter; none by default.
    near
        A fit of nearly the same series as start; by default several levels of charge are tried.
    order
        Kinetic order of all states; None fits one of each.
    intervals
        Which rates and orders have an interval by profile likelihood: "none", "all", or "auto",
        those that ±σ misses by more than 20 %.

    Raises
    ------
    FitError
        The series are inconsistent, or nothing glows.
    """
    series = [charging.checked() for charging in series]
    bands_of(series)
    uncertain = uncertain or RelativeSigmas()
    rates = np.asarray(k_r_per_s, dtype=np.float64)
    reference = _brightest(series)
    problem = ExcitationProblem(series, len(rates), reference, uncertain, order)
    if near is None:
        theta = _roughly(problem, rates, np.asarray(fractions, dtype=np.float64), reference)
    else:
        theta = _as_fitted(problem, near, reference)
    for tolerance in WHITENINGS:
        problem.rewhiten(theta)
        solution = _minimised(problem, theta, tolerance)
        theta = solution.parameters
    # With errors of the sizes given: what is found may have grown to make good for another law.
    law_warnings = _law_warnings(problem, theta)
    if not uncertain.largest_factor:
        return _result(problem, solution, reference, uncertain, law_warnings, intervals)
    errors = found_errors(problem.parameters, solution, series, uncertain.largest_factor)
    series, uncertain = errors.applied(series, uncertain)
    problem = ExcitationProblem(series, len(rates), reference, uncertain, order)
    problem.rewhiten(theta)
    solution = _minimised(problem, theta, FINE)
    return _result(problem, solution, reference, uncertain, law_warnings, intervals, errors.sites)


def _brightest(series: Sequence[ChargingSeries]) -> int:
    """Return the brightest channel, where all channels are measured."""
    total = np.zeros(series[0].values.shape[2])
    for charging in series:
        is_measured = np.isfinite(charging.values) & (charging.sigma > 0)
        everywhere = np.all(is_measured, axis=2, keepdims=True)
        total += np.where(everywhere, charging.values, 0.0).sum(axis=(0, 1))
    if not total.max() > 0:
        raise FitError("expected sites that glow after a charge, got none; did the lamp light?")
    return int(np.argmax(total))


def _roughly(
    problem: ExcitationProblem, k_r_per_s: FloatArray, fractions: FloatArray, reference: int
) -> FloatArray:
    """Return θ of the best of several starts, in the brightest channel with the light as stated.

    The errors of the light count as noise here: with a fifth of the parameters and a third of the
    values a start takes a tenth of the time. A k_r stays near the decay's: with so much noise it
    may leave for a rate that all values together rule out, with no way back from there.
    """
    rough = ExcitationProblem(
        [
            replace(
                charging,
                values=charging.values[..., [reference]],
                sigma=np.hypot(charging.sigma, LIGHT_SIGMA * charging.values)[..., [reference]],
                site_modes=None,
                across=None,
                frame_light=None,
            )
            for charging in problem.series
        ],
        len(k_r_per_s),
        0,
        RelativeSigmas(),
        problem.parameters.order,
    )
    fits = [
        _minimised(rough, start, ROUGH, ROUGH_K_R_FACTOR)
        for start in starts(rough, k_r_per_s, fractions, 0)
    ]
    best = rough.parameters.unpack(min(fits, key=_chi2).parameters)
    weights = channel_weights(problem, reference)
    return problem.parameters.as_stated(
        best.k_r_per_s, best.amplitude, best.k_e_per_s, weights, best.order
    )


def _as_fitted(problem: ExcitationProblem, fit: FittedExcitation, reference: int) -> FloatArray:
    k_r, amplitude, order = np.array(
        [(s.k_r_per_s, s.amplitude, s.kinetic_order) for s in fit.states]
    ).T
    weights = fit.channel_weights
    at_reference = weights[reference]
    return problem.parameters.as_stated(
        k_r, amplitude * at_reference, fit.k_e(), weights / at_reference, order
    )


def _minimised(
    problem: ExcitationProblem, start: FloatArray, tolerance: float, k_r_factor: float = np.inf
) -> LeastSquaresFit:
    """Return the minimum from a start, each k_r within a factor of its start value."""
    lower, upper = problem.parameters.bounds()
    k_r = problem.parameters.columns.k_r
    lower[k_r] = np.maximum(lower[k_r], start[k_r] - np.log(k_r_factor))
    upper[k_r] = start[k_r] + np.log(k_r_factor)
    # Steps of general order take their time; a starting point need not be at its minimum.
    is_slow_start = np.isfinite(k_r_factor) and not problem.parameters.is_first_order
    return least_squares(
        problem.residuals,
        start,
        lower=lower,
        upper=upper,
        max_iterations=ROUGH_ITERATIONS if is_slow_start else MAX_ITERATIONS,
        tolerance=tolerance,
        least_gain=ROUGH_GAIN if is_slow_start else 0.0,
    )


def _chi2(fit: LeastSquaresFit) -> float:
    return fit.chi2


def _result(
    problem: ExcitationProblem,
    solution: LeastSquaresFit,
    reference: int,
    uncertain: RelativeSigmas,
    law_warnings: Sequence[ResultWarning],
    intervals: IntervalChoice,
    site_sizes: tuple[float, ...] = (),
) -> FittedExcitation:
    n, bands, columns = (
        problem.parameters.states,
        problem.parameters.bands,
        problem.parameters.columns,
    )
    rates, theta = problem.parameters.unpack(solution.parameters), solution.parameters
    n_rates = 2 * n + n * bands
    own = np.concatenate([np.arange(n_rates), np.arange(columns.order.start, columns.order.stop)])
    stated = problem.parameters.stated_slopes(rates)
    covariance = propagated_covariance(solution.covariance, stated)
    total_covariance = covariance[np.ix_(own, own)]
    # E enters k_e one to one, band by band, whatever is measured.
    light_sigma = np.broadcast_to(uncertain.irradiance, bands)
    for band in range(bands):
        by_light = np.zeros(len(own))
        by_light[2 * n + band : n_rates : bands] = rates.k_e_per_s[:, band]
        total_covariance += light_sigma[band] ** 2 * np.outer(by_light, by_light)
    sigma = np.sqrt(np.diag(total_covariance))
    falling = np.argsort(-rates.k_r_per_s, kind="stable")
    k_e_sigma = sigma[2 * n : n_rates].reshape(n, bands)
    order_sigma = sigma[n_rates:] if is_fitted(columns.order) else np.zeros(n)
    inverse = columns.inverse_gain
    gain_sigma = rates.gain * np.sqrt(np.diag(solution.covariance)[inverse])
    states = tuple(
        ExcitedState(
            float(rates.k_r_per_s[i]),
            float(sigma[i]),
            float(rates.amplitude[i]),
            float(sigma[n + i]),
            rates.k_e_per_s[i],
            k_e_sigma[i],
            float(rates.order[i]),
            float(order_sigma[i]),
            bool(gain_sigma[i] < LEVEL_KNOWN),
        )
        for i in falling
    )
    weights_sigma = np.zeros(len(rates.weights))
    others = [c for c in range(len(rates.weights)) if c != reference]
    weights_sigma[others] = np.sqrt(np.diag(covariance)[columns.weights])
    kept = np.concatenate(
        [
            falling,
            n + falling,
            *(2 * n + i * bands + np.arange(bands) for i in falling),
            *([n_rates + falling] if is_fitted(columns.order) else []),
        ]
    )
    # By way of θ: A and k_e may trade off so far that their covariance has no digits left of this.
    at_off = _at_off(problem, rates, stated[own], solution.covariance, falling)
    by_band = band_tests(problem, solution)
    missing = missing_signal(problem, solution)
    fit = FittedExcitation(
        states=states,
        channel_weights=rates.weights,
        channel_weights_sigma=weights_sigma,
        at_off=at_off,
        chi2=solution.chi2,
        dof=problem.n_values + len(problem.parameters.prior_sigma) - solution.rank,
        covariance=total_covariance[np.ix_(kept, kept)],
        warnings=(
            *_warnings(problem, solution, states),
            *law_warnings,
            *(() if by_band is None else _band_warnings(by_band)),
            *_linearity_warnings(missing),
        ),
        residuals=problem.plain_residuals(theta),
        order_gain=order_gain(problem, theta, reference, uncertain),
        by_band=by_band,
        veil=_veil(problem, solution),
        evenness=rates.evenness,
        lamp_sigma=uncertain.lamp,
        site_sizes=site_sizes,
    )
    if intervals == "none":
        return fit
    stated_sigma = np.sqrt(np.diag(fit.covariance)).tolist()
    by_name = dict(zip(fit.covariance_parameters, stated_sigma, strict=True))
    profiles = excitation_intervals(
        problem, solution, uncertain, falling, None if intervals == "all" else by_name
    )
    return replace(fit, intervals=profiles)


def _veil(problem: ExcitationProblem, solution: LeastSquaresFit) -> Measured | None:
    """Return the fraction of the frame's light over every site; None if it was not fitted."""
    place = problem.parameters.columns.veil
    if not is_fitted(place):
        return None
    sigma = float(np.sqrt(solution.covariance[place.start, place.start]))
    veil = float(solution.parameters[place.start])
    if not solution.at_bound[place.start]:
        return Measured(veil, sigma)
    # Rates that are at 0, too, share its light: how far it would go beyond is not known alone.
    return OneSided.held(veil, sigma, 0.0)


def _at_off(
    problem: ExcitationProblem,
    rates: Rates,
    stated: FloatArray,
    covariance: FloatArray,
    falling: NDArray[np.intp],
) -> tuple[ConcentrationAtOff, ...]:
    """Return the brightest lamp off level of every series, σ by linear propagation.

    `stated` has the derivatives of k_r, A, k_e and fitted orders by θ, `covariance` is that of θ.
    """
    n, bands = problem.parameters.states, problem.parameters.bands
    first_order = 2 * n + n * bands
    b, a, k_r = rates.order, rates.amplitude, rates.k_r_per_s
    levels_at_charge = []
    for number, charging in enumerate(problem.illuminated_series(rates)):
        orders = None if problem.parameters.is_first_order else b
        at_off = levels_at_off(charging, k_r, rates.k_e_per_s, orders)
        glow = at_off.value**b @ a
        charge, site = np.unravel_index(int(np.argmax(glow)), glow.shape)
        r0 = at_off.value[charge, site]
        by = np.zeros((3, n, len(stated)))
        for i in range(n):
            by[0, i, i] = at_off.by_k_r[charge, site, i]
            by[0, i, 2 * n + i * bands : 2 * n + (i + 1) * bands] = at_off.by_k_e[charge, site, i]
            if len(stated) > first_order:
                by[0, i, first_order + i] = at_off.by_order[charge, site, i]
        log_r0 = np.log(np.maximum(r0, np.finfo(float).tiny))
        # τ = 1/((b − 1) k r(0)^(b − 1)), or 1/k where b is 1; a = A r(0)ᵇ.
        beyond = np.where(b > 1, b - 1, 1.0)
        # The time of a state that was not charged is that of the full one.
        level = np.where(r0 > 0, r0, 1.0)
        time_s = 1 / (beyond * k_r * level ** (b - 1))
        per_level = np.stack([np.ones(n), a * b * level ** (b - 1), -time_s * (b - 1) / level])
        by[1:] = per_level[1:, :, None] * by[0]
        each = np.arange(n)
        by[1, each, n + each] += r0**b
        by[2, each, each] -= time_s / k_r
        if len(stated) > first_order:
            by[1, each, first_order + each] += a * r0**b * log_r0
            by[2, each, first_order + each] -= time_s * (1 / beyond + log_r0)
        # The lamp of that charge has errors of its own, beside those of the rates.
        light = problem.by_light_at_off(number, charging, rates)[charge, site]
        by_light = per_level[..., None] * (light / (b * level ** (b - 1))[:, None])
        r0_sigma, a_sigma, time_s_sigma = (
            np.sqrt(np.diag(propagated_covariance(covariance, rows)))[falling]
            for rows in by @ stated + by_light
        )
        levels_at_charge.append(
            ConcentrationAtOff(
                charging.name,
                int(charge),
                int(site),
                r0[falling],
                r0_sigma,
                (a * r0**b)[falling],
                a_sigma,
                time_s[falling],
                time_s_sigma,
            )
        )
    return tuple(levels_at_charge)


def _warnings(
    problem: ExcitationProblem, solution: LeastSquaresFit, states: Sequence[ExcitedState]
) -> list[ResultWarning]:
    warnings: list[ResultWarning] = []
    if solution.creeps:
        warnings.append(
            Undetermined(
                "fit-unconverged",
                "the fit has not converged: rates and levels may trade off; charge for longer",
            )
        )
    elif solution.ending is Ending.RANK_DEFICIENT:
        warnings.append(
            Undetermined(
                "parameters-undetermined",
                "the charges do not determine every rate and level: those have no finite σ; charge "
                "for several durations, shorter and longer ones",
            )
        )
    worst = max(state.amplitude_sigma / max(state.amplitude, 1e-300) for state in states)
    if LEVEL_KNOWN < worst < 1:
        warnings.append(
            Undetermined(
                "charge-unsaturated",
                "the fraction to which the sample was charged is determined to {sigma_percent:.0f} "
                "% only, as are Λ and r(0): charge for longer or with more light, so that the glow "
                "stops growing",
                sigma_percent=100 * worst,
            )
        )
    elif worst >= 1:
        warnings.append(
            Undetermined(
                "charge-unsaturated",
                "the fraction to which the sample was charged is not determined, nor are Λ and "
                "r(0): charge for longer or with more light, so that the glow stops growing",
                sigma_percent=100 * worst,
            )
        )
    reduced_chi2 = solution.chi2 / max(problem.n_values - solution.rank, 1)
    if reduced_chi2 > LARGE_CHI2:
        warnings.append(
            Misfit(
                "model-misfit",
                "reduced χ² is {reduced_chi2:.2g}: the rate equation or the noise is not as "
                "assumed; look at the residuals of each charge",
                reduced_chi2=reduced_chi2,
            )
        )
    return warnings


def _band_warnings(tests: BandTests) -> list[ResultWarning]:
    """Return a warning for each quantity of the glow that depends on the exciting band."""
    warnings: list[ResultWarning] = []
    variance = tests.light_variance
    if tests.is_thick:
        warnings.append(
            Misfit(
                "layer-thick",
                "light that is absorbed most saturates the glow sooner than other light "
                "({sigmas:.1f} σ), as in a layer of optical density {optical_density:2r} or more: "
                "Λ is too small, and k_e is a mean over the depth; measure a thinner layer",
                sigmas=variance.value / variance.sigma,
                optical_density=tests.optical_density,
            )
        )
    elif tests.amplitude.differs:
        warnings.append(
            Misfit(
                "amplitude-by-band",
                "the glow of the fully charged sample depends on the exciting band (p = "
                "{p_value:.1g}): the layer is thick, or some light empties traps; Λ and r(0) are "
                "not to be trusted",
                p_value=tests.amplitude.p_value,
            )
        )
    if tests.rate.differs:
        warnings.append(
            Misfit(
                "decay-by-band",
                "the decay depends on the exciting band (p = {p_value:.1g}): states are missing, "
                "another law holds, or stray light empties traps; look at the rates by band",
                p_value=tests.rate.p_value,
            )
        )
    if tests.hue is not None and tests.hue.differs:
        warnings.append(
            Misfit(
                "hue-by-band",
                "the hue of the glow depends on the exciting band (p = {p_value:.1g}): states of "
                "different spectra are excited differently, or light of something else is in the "
                "photographs; look at the channels by band",
                p_value=tests.hue.p_value,
            )
        )
    return warnings


def _linearity_warnings(missing: Measured) -> list[ResultWarning]:
    """Return a warning if large signals fall short of proportion."""
    if missing.value < CLEARLY_MISSING * missing.sigma:
        return []
    return [
        Disturbance(
            "sensor-nonlinear",
            "large signals fall short of proportion, the largest by {missing_percent:.1f} % "
            "({sigmas:.1f} σ): the camera is not linear, and k_r and k_e may be off by as much; "
            "leave out the brightest photographs (labrig process --exclude)",
            missing_percent=100 * missing.value,
            sigmas=missing.value / missing.sigma,
        )
    ]


def _law_warnings(problem: ExcitationProblem, theta: FloatArray) -> list[ResultWarning]:
    """Return a warning if charges of different lengths do not follow the rate equation."""
    rates = problem.parameters.unpack(theta)
    test = law_test(problem.parameters, rates, theta, problem.series)
    if test is None or not test.fails:
        return []
    if test.trend > 0:
        return [
            Misfit(
                "rate-equation-misfit",
                "long charges glow more and short ones less than by the rate equation "
                "({sigmas:.1f} σ of the lamp's scatter): charging is convex, the layer is thick, "
                "or another law holds; k_e, Λ and r(0) are not to be trusted",
                sigmas=abs(test.trend),
                trend=test.trend,
            )
        ]
    return [
        Misfit(
            "rate-equation-misfit",
            "long charges glow less and short ones more than by the rate equation ({sigmas:.1f} σ "
            "of the lamp's scatter): states are missing, the lamp's light empties traps, or "
            "another law holds; k_e, Λ and r(0) are not to be trusted",
            sigmas=abs(test.trend),
            trend=test.trend,
        )
    ]
