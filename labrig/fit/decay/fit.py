"""From frames to rates: `fit_decay`."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from labrig.errors import FitError
from labrig.fit.decay.alternative_models import ALTERNATIVES, fit_alternative, fitted_alternative
from labrig.fit.decay.envelope import Envelope, envelope
from labrig.fit.decay.fit_warnings import Evidence, refuse_if_constant, refuse_if_rising
from labrig.fit.decay.result import DecayFit, assemble
from labrig.fit.decay.selection import CLEAR_BIC, bic, choose_states
from labrig.fit.decay.series import NO_DECAY, DecaySeries, decay_series
from labrig.fit.decay.states import StatesFit, refit
from labrig.fit.decay.whitening import WhitenedSeries, whitened
from labrig.fit.least_squares import FloatArray
from labrig.results import AlternativeModel, Candidate

#: Rounds in which the flicker's weights follow the model; each gains two digits or more.
REWEIGHTINGS = 8
REWEIGHTED_ENOUGH = 1e-9
#: Scatter below which data are taken for exact: rounding.
EXACT = 1e-13
FEWEST_FOR_FLICKER = 6
MOST_STATES = 8


def fit_decay(
    t_s: ArrayLike,
    values: ArrayLike,
    sigma: ArrayLike | None,
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
) -> DecayFit:
    """Fit Σ_i a_i e^(−k_i t), a_i ≥ 0, to a decay in some channels (Nalbach et al. sec. 4.4).

    Frame f, channel c: y_fc = w_c Σ_i a_i g(k_i; t_f, T_f) + b_c, g the mean of e^(−k t) over the
    exposure. Cov = (σ_fc r_cd σ_fd) + ρ² s_f s_fᵀ within a frame, s the signal without b_c.

    Parameters
    ----------
    t_s
        (n,) start of the exposures after lamp off, ≥ 0, in any order.
    values
        (n,) or (n, C), linear in light, dark subtracted.
    sigma
        Their standard uncertainties without flicker, > 0, broadcast to `values`; inf leaves a value
        out. None, for one channel only: equal for all, estimated from the scatter.
    exposure_s
        Length of the exposures ≥ 0, one for all or (n,).
    channels
        C names.
    n_states
        Number of states, or None to choose up to `max_states`, by BIC and F-test.
    max_states
        Most states tried.
    offset_sigma
        Prior σ of the channels' independent constants b_c, such as the σ of the dark level
        subtracted from each; in the values' units, one for all or (C,): 0 holds it at zero, inf
        leaves it free.
    flicker
        Relative noise ρ that all channels of a frame share; None estimates it from the scatter of
        the frames about the best monotone curve, whatever the number of states.
    fixed_rates
        Rates in 1/s that take part and are held; they count as states.
    repeats
        (n,) name of the charge that each frame follows: all decay alike, each from a level of its
        own. None: there was one.
    correlation
        (C, C) r of the channels' noise in one frame without flicker; None: they are independent.
    offset_correlation
        (C, C) of the offsets' priors, likewise: a sensor that warms does so in all channels.

    Raises
    ------
    FitError
        Data from which no decay can be had.
    """
    series = decay_series(
        t_s,
        values,
        sigma,
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
    smooth = envelope(series, flicker)
    series = smooth.series
    if not series.sigma_given:
        scale = max(smooth.noise_scale, EXACT)
        series = replace(series, inverse_sigma=series.inverse_sigma / scale)
    data = whitened(series, smooth.signal, smooth.flicker)
    refuse_if_rising(data, smooth.weights)
    noise_estimated = flicker is None or not series.sigma_given
    noise_dof = smooth.dof if noise_estimated else np.inf
    chosen, tried = _supported_states(data, numbers, fixed, smooth, noise_dof)
    alternative_models = _alternatives(data, chosen)
    best = min(alternative_models, key=lambda alternative: alternative.bic)
    best_wins = best.bic < min(candidate.bic for candidate in tried) - CLEAR_BIC
    data, chosen = _reweighted(data, chosen, smooth.flicker)
    refuse_if_constant(chosen, data)
    return assemble(
        data,
        chosen,
        Evidence(
            noise=smooth,
            noise_dof=noise_dof,
            candidates=tuple(tried),
            alternative_models=alternative_models,
            better_model=best if best_wins else None,
            asked=n_states,
            max_states=max_states,
            n_fixed=len(fixed),
        ),
    )


def _log_rates(rates_per_s: Sequence[float], span_s: float) -> FloatArray:
    rates = np.array(rates_per_s, dtype=np.float64)
    if not np.all((rates > 0) & np.isfinite(rates)):
        raise FitError(f"expected fixed rates > 0 per second, got {list(rates_per_s)}")
    return np.log(rates * span_s)


def _numbers_of_states(
    series: DecaySeries, n_states: int | None, max_states: int, n_fixed: int
) -> range:
    """Numbers of states to try: what was asked for, or as many as the frames can tell."""
    fewest = max(1, n_fixed) if n_states is None else n_states
    most = max(max_states, fewest) if n_states is None else n_states
    if fewest < max(1, n_fixed):
        raise FitError(
            f"expected n_states ≥ {max(1, n_fixed)}, got {fewest}; fixed rates count as states"
        )
    if most > MOST_STATES:
        raise FitError(
            f"expected at most {MOST_STATES} states, got {most}; "
            "no decay tells more apart: a power law may be what you see"
        )
    frames = int(np.count_nonzero(series.inverse_sigma.any(axis=1)))

    def parameters(n: int) -> int:
        return (
            2 * n - n_fixed + int(np.isinf(series.offset_sigma).any()) + int(not series.sigma_given)
        )

    if frames < parameters(fewest):
        raise FitError(
            f"expected at least {parameters(fewest)} frames for {fewest} state(s), got {frames}; "
            "record more frames or ask for fewer states"
        )
    # Choosing takes frames to spare.
    enough = [n for n in range(fewest, most + 1) if n == fewest or frames > parameters(n) + 1]
    return range(fewest, enough[-1] + 1)


def _check_flicker(series: DecaySeries, flicker: float | None) -> None:
    if flicker is None and not series.sigma_given:
        raise FitError(
            "expected σ of the values to tell flicker from other noise, got none; "
            "give σ, or set the flicker to 0"
        )
    if flicker is None and series.n_frames < FEWEST_FOR_FLICKER:
        raise FitError(
            f"expected at least {FEWEST_FOR_FLICKER} frames to estimate flicker, got "
            f"{series.n_frames}; give the flicker (0.007 is common) or record more frames"
        )
    if flicker is not None and not 0 <= flicker < 1:
        raise FitError(f"expected flicker in [0, 1), got {flicker:g}; 0.007 means 0.7 %")


def _supported_states(
    data: WhitenedSeries, numbers: range, fixed: FloatArray, smooth: Envelope, noise_dof: float
) -> tuple[StatesFit, list[Candidate]]:
    """The states chosen; fewer than the fewest wanted if amplitudes vanish."""
    for fewest in range(numbers.start, max(len(fixed), 1) - 1, -1):
        those = range(fewest, max(numbers.stop, fewest + 1))
        chosen, tried = choose_states(data, those, fixed, smooth.weights, smooth.offsets, noise_dof)
        if chosen is not None:
            return chosen, tried
    raise FitError(NO_DECAY)


def _alternatives(data: WhitenedSeries, chosen: StatesFit) -> tuple[AlternativeModel, ...]:
    """What is no sum of exponentials, fitted under the candidates' weights."""
    joint = chosen.joint
    fits = [
        (shape, fit_alternative(data, shape, joint.weights, joint.offsets))
        for shape in ALTERNATIVES
    ]
    return tuple(fitted_alternative(shape, fit, data.series, bic(data, fit)) for shape, fit in fits)


def _reweighted(
    data: WhitenedSeries, fit: StatesFit, flicker: float
) -> tuple[WhitenedSeries, StatesFit]:
    """The fit whose flicker is a fraction of its own signal, and the data so whitened."""
    if flicker == 0:
        return data, refit(data, fit)
    for _ in range(REWEIGHTINGS):
        data = whitened(data.series, fit.signal(data.series), flicker)
        before = fit.joint.shape
        fit = refit(data, fit)
        after = fit.joint.shape
        if len(after) == len(before) and np.allclose(after, before, REWEIGHTED_ENOUGH, 0.0):
            break
    return data, fit
