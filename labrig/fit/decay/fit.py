"""Fit of rates and amplitudes to the frames of a decay: `fit_decay`."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from labrig.fit.decay.envelope import (
    Envelope,
    envelope,
    residual_sigma,
    scaled_sigma,
    sigma_scale,
    with_equal_sigma,
    with_scatter_sigma,
)
from labrig.fit.decay.fit_warnings import (
    FitDiagnostics,
    refuse_if_constant,
    refuse_if_rising,
    student_factor,
)
from labrig.fit.decay.law_fit import LawFit, fit_laws, tie_warnings
from labrig.fit.decay.noise_correlation import NoiseLikelihood
from labrig.fit.decay.rate_spectrum import fit_rate_spectrum
from labrig.fit.decay.result import DecayFit, assemble
from labrig.fit.decay.selection import choose_states, is_needed, law_margin
from labrig.fit.decay.series import NO_DECAY, DecaySeries, WhitenedSeries, decay_series, whitened
from labrig.fit.decay.states import StatesFit, refit
from labrig.foundation.arrays import FloatArray
from labrig.foundation.detection import STRONG_EVIDENCE_DELTA_BIC
from labrig.foundation.errors import FitError
from labrig.results import (
    AUTO,
    EXPONENTIALS,
    LAW_CHOICES,
    LAW_LABELS,
    RATE_SPECTRUM,
    Candidate,
    FittedRateSpectrum,
    ScatterSigma,
)

#: Iterations in which the flicker's weights follow the model; each gains two digits or more.
REWEIGHTINGS = 8
REWEIGHTED_ENOUGH = 1e-6
#: First fits that tell the σ of residuals, and its factor below which another one follows.
RESCALINGS = 4
RESCALED_ENOUGH = 0.3
MIN_FOR_FLICKER = 6
#: Lifetimes of the fastest state before the first frame from which its light at lamp off, more than
#: e^5 times as bright, is not told: amplitudes are those at the first frame.
MAX_LIFETIMES = 5.0
MAX_STATES = 8


def fit_decay(
    t_s: ArrayLike,
    values: ArrayLike,
    sigma: ArrayLike | Literal["equal"] | None,
    *,
    exposure_s: ArrayLike = 0.0,
    channels: Sequence[str] = ("value",),
    n_states: int | None = None,
    max_states: int = 3,
    offset_sigma: ArrayLike = 0.0,
    flicker: float | None = 0.0,
    fixed_rates: Sequence[float] = (),
    repeats: Sequence[str] | None = None,
    correlation: ArrayLike | None = None,
    offset_correlation: ArrayLike | None = None,
    law: str = AUTO,
    intervals: bool = False,
) -> DecayFit:
    """Fit Σ_i a_i e^(−k_i t), a_i ≥ 0, to a decay in some channels (Nalbach et al., section 4.4).

    Other laws are fitted beside it: those of `labrig.material.DECAY_LAWS`, and a smooth spectrum of
    rates.

    For frame f and channel c, y_fc = w_c Σ_i a_i g(k_i; t_f, T_f) + b_c with g the mean of e^(−k t)
    over the exposure. The covariance within a frame is Cov = (σ_fc r_cd σ_fd) + ρ² s_f s_fᵀ, s the
    signal without b_c.

    Parameters
    ----------
    t_s
        Start of each exposure in seconds, shape (n,), in any order. 0 is lamp off, where the
        amplitudes are told, unless the fastest state lives less than a fifth of the time from
        there to the first frame: then the clock tells nothing of lamp off, amplitudes are those at
        the first frame, and laws with a shape begin there. So they do where all times are negative.
    values
        Signals linear in light with the dark level subtracted, shape (n,) or (n, C), in any unit.
    sigma
        Standard uncertainties of the values without flicker, > 0, broadcast to `values`; inf
        excludes a value. Of a single channel they are multiplied by the factor by which its scatter
        exceeds them, if it is not by chance and no flicker. None, for a single channel only,
        estimates them from the scatter about the best monotone curve, whatever the number of
        states; flicker is part of it and must be 0. "equal" is unweighted least squares of a single
        channel: all values have one σ, that of the residuals, √(Σ residual²/dof), and variances are
        those of the curvature alone.
    exposure_s
        Length of the exposures in seconds, ≥ 0, a scalar or of shape (n,).
    channels
        Names of the C channels.
    n_states
        Number of states; None selects it, up to `max_states`, by BIC and F-test.
    max_states
        Largest number of states tried.
    offset_sigma
        Prior σ of the channels' constants b_c, such as the σ of the subtracted dark level, in the
        unit of the values, a scalar or of shape (C,). 0 fixes b_c at zero, inf leaves it free.
    flicker
        Relative noise ρ that all channels of a frame share. None estimates it from the scatter of
        the frames about the best monotone curve, whatever the number of states.
    fixed_rates
        Rates in 1/s that are held fixed; they count as states.
    repeats
        Name of the charge that each frame follows, shape (n,): all decays have the same rates, each
        its own level. None is a single charge.
    correlation
        Correlation matrix r of the channels' noise within a frame without flicker, shape (C, C).
        None is no correlation.
    offset_correlation
        Correlation matrix of the offsets' priors, shape (C, C): the dark level of a warming sensor
        drifts in all channels. None is no correlation.
    law
        Law that describes the decay: `exponentials`, `becquerel`, `otor`, `stretched` or
        `rate-spectrum`. `auto` takes exponentials, unless no number of states was asked for and the
        BIC of another law is lower by 1, by 6 than that of a single one or if it is a spectrum of
        rates. All of them are fitted in any case.
    intervals
        Whether every rate, and every parameter of the law, has an interval by profile likelihood.
        Those that ±σ misses by more than 20 % have one in any case.

    Returns
    -------
    DecayFit
        States by falling rate with covariance, channel weights, offsets, warnings and residuals.

    Raises
    ------
    FitError
        The data do not constrain a decay.

    Examples
    --------
    >>> import labrig
    >>> [decay] = labrig.read_series("series.csv")
    >>> G = decay.channels.index("G")
    >>> y, sigma = decay.values[:, G], decay.sigma[:, G]
    >>> fit = labrig.fit_decay(decay.t_s, y, sigma, exposure_s=decay.exposure_s, flicker=0.007)
    >>> for state in fit.states:
    ...     print(f"k = {state.k_r_per_s:.4f} ± {state.k_r_per_s_sigma:.4f} 1/s")
    k = 0.2046 ± 0.0030 1/s
    k = 0.0101 ± 0.0001 1/s
    """
    if law not in LAW_CHOICES:
        raise FitError(f"expected one of the laws {', '.join(LAW_CHOICES)}, got '{law}'")
    is_equal = isinstance(sigma, str)
    if isinstance(sigma, str) and sigma != "equal":
        raise FitError(f"expected σ, None or 'equal', got '{sigma}'")
    series = decay_series(
        t_s,
        values,
        None if isinstance(sigma, str) else sigma,
        exposure_s,
        channels,
        offset_sigma,
        repeats,
        correlation,
        offset_correlation,
    )
    fixed = _log_rates(fixed_rates, series.span_s)
    numbers = _numbers_of_states(series, n_states, max_states, len(fixed))
    _check_flicker(series, flicker)
    scatter: ScatterSigma | None = None
    if is_equal:
        series = _with_residual_sigma(with_equal_sigma(series), numbers, fixed)
    elif not series.sigma_given:
        series, scatter = with_scatter_sigma(series)
    scale = sigma_scale(series, flicker)
    if scale is not None:
        series = replace(series, inverse_sigma=series.inverse_sigma / scale.factor)
        flicker = flicker or 0.0
    smooth = envelope(series, flicker)
    series = smooth.series
    data = whitened(series, smooth.signal, smooth.typical_flicker)
    refuse_if_rising(data, smooth.weights)
    estimated = scatter or scale
    noise_dof = estimated.dof if estimated else smooth.dof if flicker is None else np.inf
    likelihood = NoiseLikelihood.of(data, smooth)
    chosen, tried = _supported_states(likelihood, numbers, fixed, smooth)
    data = referred(data, chosen)
    likelihood = replace(likelihood, data=data)
    weights, offsets = chosen.joint.weights, chosen.joint.offsets
    student = student_factor(estimated.dof if estimated else np.inf)
    added_square = smooth.added_square(smooth.typical_flicker)
    laws, unfinished = fit_laws(likelihood, weights, offsets, added_square, student)
    if law in unfinished:
        raise FitError(
            f"expected a fit of {LAW_LABELS[law]} that ends at a minimum, got one that creeps; "
            "leave out --law, or record longer"
        )
    spectrum = fit_rate_spectrum(likelihood, weights, student)
    if law == AUTO and n_states is not None:
        law = EXPONENTIALS
    is_choice = law == AUTO
    chosen_law = _chosen_law(law, chosen.n_states, tried, laws, spectrum)
    all_needed = is_needed(likelihood, chosen, tried)
    envelope_data = data
    data, chosen = _reweighted(data, chosen, smooth.flicker)
    if is_equal and chosen.dof(data) > 0:
        data, chosen = _rescaled(data, chosen)
        scatter = residual_sigma(data.series, chosen.dof(data))
        noise_dof = scatter.dof
    refuse_if_constant(chosen, data)
    result = assemble(
        data,
        chosen,
        FitDiagnostics(
            data=envelope_data,
            noise=smooth,
            scatter=scatter,
            sigma_scale=scale,
            noise_dof=noise_dof,
            candidates=tuple(tried),
            law=chosen_law,
            laws=laws,
            unfinished_laws=unfinished,
            rate_spectrum=spectrum,
            all_needed=all_needed,
            asked=n_states,
            most_states=numbers[-1],
            n_fixed=len(fixed),
            all_intervals=intervals,
        ),
    )
    if not is_choice:
        return result
    return replace(result, warnings=(*result.warnings, *tie_warnings(result)))


def referred(data: WhitenedSeries, fit: StatesFit) -> WhitenedSeries:
    """Return the data with the time at which amplitudes are told: lamp off, or the first frame."""
    series = data.series
    if float(np.exp(fit.log_rates.max())) * series.start <= MAX_LIFETIMES:
        return data
    return replace(data, series=series.from_first_frame())


def _log_rates(rates_per_s: Sequence[float], span_s: float) -> FloatArray:
    rates = np.array(rates_per_s, dtype=np.float64)
    if not np.all((rates > 0) & np.isfinite(rates)):
        raise FitError(f"expected fixed rates > 0 per second, got {list(rates_per_s)}")
    return np.log(rates * span_s)


def _numbers_of_states(
    series: DecaySeries, n_states: int | None, max_states: int, n_fixed: int
) -> range:
    """Return the numbers of states to try: the requested one, or all that the frames constrain."""
    fewest = max(1, n_fixed) if n_states is None else n_states
    most = max(max_states, fewest) if n_states is None else n_states
    if fewest < max(1, n_fixed):
        raise FitError(
            f"expected {max(1, n_fixed)} states or more, got {fewest}; fixed rates count as states"
        )
    if most > MAX_STATES:
        raise FitError(
            f"expected at most {MAX_STATES} states, got {most}; "
            "no decay resolves more; it may follow a power law"
        )
    frames = int(np.count_nonzero(series.inverse_sigma.any(axis=1)))

    def parameters(n: int) -> int:
        return (
            2 * n - n_fixed + int(np.isinf(series.offset_sigma).any()) + int(not series.sigma_given)
        )

    if frames < parameters(fewest):
        raise FitError(
            f"expected values at {parameters(fewest)} times or more for {fewest} state(s), got "
            f"{frames}; record more{' or ask for fewer states' if fewest > 1 else ''}"
        )
    # Choosing takes frames to spare.
    affordable = [n for n in range(fewest, most + 1) if n == fewest or frames > parameters(n) + 1]
    return range(fewest, affordable[-1] + 1)


def _check_flicker(series: DecaySeries, flicker: float | None) -> None:
    if flicker != 0 and not series.sigma_given:
        raise FitError(
            "expected σ of the values to separate flicker from other noise, got none; "
            "give σ, or set the flicker to 0"
        )
    if flicker is None and series.n_frames < MIN_FOR_FLICKER:
        raise FitError(
            f"expected at least {MIN_FOR_FLICKER} frames to estimate flicker, got "
            f"{series.n_frames}; give the flicker (0.007 is common) or record more frames"
        )
    if flicker is not None and not 0 <= flicker < 1:
        raise FitError(f"expected flicker in [0, 1), got {flicker:g}; 0.007 means 0.7 %")


def _supported_states(
    likelihood: NoiseLikelihood,
    numbers: range,
    fixed: FloatArray,
    smooth: Envelope,
) -> tuple[StatesFit, list[Candidate]]:
    """Return the selected states; fewer than requested if amplitudes vanish."""
    for fewest in range(numbers.start, max(len(fixed), 1) - 1, -1):
        n_states = range(fewest, max(numbers.stop, fewest + 1))
        chosen, tried = choose_states(likelihood, n_states, fixed, smooth.weights, smooth.offsets)
        if chosen is not None:
            return chosen, tried
    raise FitError(NO_DECAY)


def _chosen_law(
    law: str,
    n_states: int,
    tried: Sequence[Candidate],
    laws: Sequence[LawFit],
    spectrum: FittedRateSpectrum | None,
) -> str:
    """Return the law that was asked for, or the one that the data prefer to exponentials."""
    bics = {each.fitted.name: each.fitted.bic for each in laws}
    bics[EXPONENTIALS] = min(candidate.bic for candidate in tried)
    if spectrum is not None:
        bics[RATE_SPECTRUM] = spectrum.bic
    if law == AUTO:
        margins = dict.fromkeys(bics, law_margin(n_states))
        # A spectrum contains all exponentials.
        margins |= {EXPONENTIALS: 0.0, RATE_SPECTRUM: STRONG_EVIDENCE_DELTA_BIC}
        return min(bics, key=lambda name: bics[name] + margins[name])
    if law not in bics:
        raise FitError(f"expected a signal that decays by the law '{law}', got none")
    return law


def _with_residual_sigma(series: DecaySeries, numbers: range, fixed: FloatArray) -> DecaySeries:
    """Return the series with one σ for all values, that of the residuals of a first fit.

    The scatter about a monotone curve is no better than the curve's grid of rates: data that are
    exact to many digits would be fitted to a part of them, and their states not told apart.
    """
    for _ in range(RESCALINGS):
        smooth = envelope(series, 0.0)
        data = whitened(series, smooth.signal, 0.0)
        likelihood = NoiseLikelihood.of(data, smooth)
        chosen, _ = _supported_states(likelihood, numbers, fixed, smooth)
        chosen = refit(data, chosen)
        dof = chosen.dof(data)
        if dof <= 0 or chosen.joint.chi2 == 0:
            return series
        factor = float(np.sqrt(chosen.joint.chi2 / dof))
        series = scaled_sigma(series, factor)
        if factor > RESCALED_ENOUGH:
            return series
    return series


def _rescaled(data: WhitenedSeries, fit: StatesFit) -> tuple[WhitenedSeries, StatesFit]:
    """Return data with the σ of the residuals, and the same fit to them."""
    factor = float(np.sqrt(fit.joint.chi2 / fit.dof(data)))
    series = scaled_sigma(data.series, factor)
    data = whitened(series, fit.signal(series), 0.0)
    return data, refit(data, fit)


def _reweighted(
    data: WhitenedSeries, fit: StatesFit, flicker: float
) -> tuple[WhitenedSeries, StatesFit]:
    """Refit with flicker as a fraction of the fit's own signal; return the whitened data, too."""
    if flicker == 0:
        return data, refit(data, fit)
    for _ in range(REWEIGHTINGS):
        data = whitened(data.series, fit.signal(data.series), flicker)
        old_shape = fit.joint.shape
        fit = refit(data, fit, REWEIGHTED_ENOUGH)
        new_shape = fit.joint.shape
        if len(new_shape) == len(old_shape) and np.allclose(
            new_shape, old_shape, REWEIGHTED_ENOUGH, 0.0
        ):
            break
    return data, refit(data, fit)
