"""Diagnostics of a decay fit: warnings with their values and a remedy.

Randomly spaced frames show a flicker of any period as a line in the periodogram of the residuals
(N. R. Lomb, Astrophysics and Space Science 39, 447, 1976; J. D. Scargle, Astrophysical Journal 263,
835, 1982). Evenly spaced ones show only its beat with them, and take a slow beat for a part of the
decay.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtr, chdtrc, fdtrc, ndtr

from labrig.fit.decay.states import APART_SIGMAS, ILL_DETERMINED, sigmas_apart
from labrig.foundation.arrays import FloatArray
from labrig.foundation.result_warning import (
    Contradiction,
    Disturbance,
    Extrapolated,
    Misfit,
    ResultWarning,
    Undetermined,
)
from labrig.results import DecayState, UnseenFlicker

#: Values below which neither is looked for, and first values that are looked at.
MIN_VALUES, MAX_VALUES = 12, 1000
#: Frequencies that are looked at, in values a second of the mean spacing, and periods in the record
#: from which residuals that repeat are no misfit.
HIGHEST, MIN_PERIODS = 2.5, 6.0
#: Frequencies that are computed for each that is independent of the others.
OVERSAMPLING = 5
#: Part of Σ amplitudes² below which a sine is nothing but rounding.
_NO_SINE = 1e-9
#: Coherence |Σ exp(2πi f t)|/n of the times from which frames are evenly spaced, unless few frames
#: have it by chance.
EVEN = 0.6
#: First values that tell it, and most frequencies.
MAX_TIMES, MAX_FREQUENCIES = 300, 4000
#: Part of a flicker below which it does not matter.
MIN_SHARE = 0.1


@dataclass(frozen=True, eq=False)
class Periodogram:
    """Lomb–Scargle periodogram of the residuals of a decay.

    Attributes
    ----------
    frequency_hz
        Rising frequencies in 1/s, shape (f,).
    power
        Fraction of the squared residuals that a flicker of that frequency explains, shape (f,).
    independent
        Number of independent frequencies.
    n_values
        Number of residuals.
    spacing_s
        Time between two values in seconds where they are evenly spaced: there a frequency stands
        for all that differ from it by a multiple of 1/spacing. None where they are not.
    """

    frequency_hz: FloatArray
    power: FloatArray
    independent: float
    n_values: int
    spacing_s: float | None

    @property
    def period_s(self) -> float:
        """Period of the highest line in seconds."""
        return 1 / float(self.frequency_hz[np.argmax(self.power)])

    @property
    def aliases_s(self) -> tuple[float, ...]:
        """Longest other periods in seconds that the highest line of evenly spaced values may have.

        Empty where they are not evenly spaced.
        """
        if self.spacing_s is None:
            return ()
        rate, own = 1 / self.spacing_s, 1 / self.period_s
        return 1 / (rate - own), 1 / (rate + own)

    @property
    def p_value(self) -> float:
        """Chance that the highest line of independent normal residuals is as high."""
        alone = (1 - float(self.power.max())) ** ((self.n_values - 2) / 2)
        return float(-np.expm1(self.independent * np.log1p(-min(alone, 1 - 1e-16))))

    def power_at(self, p_value: float) -> float:
        """Return the power that no line of independent normal residuals exceeds but by chance."""
        alone = -np.expm1(np.log1p(-p_value) / self.independent)
        return float(1 - alone ** (2 / (self.n_values - 2)))


def _explained_by_sines(
    t_s: FloatArray, residuals: FloatArray, amplitudes: FloatArray, frequency_hz: FloatArray
) -> FloatArray:
    """Return the fraction of Σ residuals² that a sine of each frequency explains.

    This is the periodogram of N. R. Lomb, Astrophysics and Space Science 39 (1976), for sines of
    these amplitudes; `scipy.signal`, which has it, takes as long to load as such a fit takes.
    """
    turns = np.exp(2j * np.pi * np.outer(frequency_hz, t_s))
    projected, doubled = turns @ (residuals * amplitudes), turns**2 @ amplitudes**2
    # With the phase at which sine and cosine are orthogonal, as Lomb chooses it.
    projected *= np.exp(-0.5j * np.angle(doubled))
    total, odd = np.sum(amplitudes**2), np.abs(doubled)
    cosine, sine = (total + odd) / 2, (total - odd) / 2
    # Half the rate of evenly spaced values has a cosine alone.
    has_sine = sine > _NO_SINE * total
    explained = projected.real**2 / cosine
    explained[has_sine] += projected.imag[has_sine] ** 2 / sine[has_sine]
    power: FloatArray = explained / np.sum(residuals**2)
    return power


def periodogram(
    t_s: FloatArray, residuals: FloatArray, signal_to_noise: FloatArray
) -> Periodogram | None:
    """Return the periodogram of the residuals of one decay.

    Flicker is a fraction of the signal, so that sines are fitted to the signal's relative
    deviations, weighted by their σ.

    Parameters
    ----------
    t_s
        Rising middles of the exposures in seconds, shape (n,).
    residuals
        Residuals over their σ, flicker included, shape (n,).
    signal_to_noise
        Signal over the same σ, shape (n,).

    Returns
    -------
    Periodogram or None
        From periods of a sixth of the record on to that of two evenly spaced values, or to 0.4 of
        the mean spacing of others; None where residuals are too few or vanish.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.fit import periodogram
    >>> t_s = np.sort(np.random.default_rng(1).uniform(0, 180, 36))
    >>> lines = periodogram(t_s, np.sin(2 * np.pi * t_s / 5.1), np.ones(36))
    >>> print(f"{lines.period_s:.1f} s, p < 1e-9: {lines.p_value < 1e-9}")
    5.1 s, p < 1e-9: True
    """
    rows = np.flatnonzero(signal_to_noise > 0)[:MAX_VALUES]
    t_s, residuals, signal_to_noise = t_s[rows], residuals[rows], signal_to_noise[rows]
    n_values = len(t_s)
    if n_values < MIN_VALUES or not residuals.any() or not np.ptp(t_s):
        return None
    span_s = float(np.ptp(t_s))
    spacing_s = span_s / (n_values - 1)
    is_even = _coherence(t_s, np.array([1 / spacing_s]))[0] > _even_from(n_values)
    lowest, highest = MIN_PERIODS / span_s, (0.5 if is_even else HIGHEST) / spacing_s
    if highest <= lowest:
        return None
    independent = (highest - lowest) * span_s
    frequency_hz = np.linspace(lowest, highest, int(OVERSAMPLING * independent) + 2)
    power = _explained_by_sines(t_s - t_s[0], residuals, signal_to_noise, frequency_hz)
    return Periodogram(
        frequency_hz,
        np.clip(power, 0.0, 1.0),
        independent,
        n_values,
        spacing_s if is_even else None,
    )


def unseen_flicker(t_s: FloatArray, exposure_s: FloatArray) -> UnseenFlicker | None:
    """Return the periodic flicker that evenly spaced frames take for a slow change.

    Parameters
    ----------
    t_s
        Rising begins of the exposures of one decay in seconds, shape (n,).
    exposure_s
        Their lengths in seconds, shape (n,).

    Returns
    -------
    UnseenFlicker or None
        None if frames are not evenly spaced, if exposures average the flicker out, or if there are
        too few frames.
    """
    t_s, exposure_s = t_s[:MAX_TIMES], exposure_s[:MAX_TIMES]
    if len(t_s) < MIN_VALUES or not np.ptp(t_s):
        return None
    span_s, steps_s = float(np.ptp(t_s)), np.diff(t_s)
    lowest = 0.5 * len(steps_s) / span_s
    step_s = float(np.median(steps_s))
    # Frames that are close together at first and evenly spaced later have a median step of zero.
    highest = 1.25 / step_s if step_s > 0 else np.inf
    highest = min(highest, lowest + MAX_FREQUENCIES / (4 * span_s))
    frequencies = np.append(np.arange(lowest, highest, 1 / (4 * span_s)), 1 / max(step_s, 1e-300))
    middle_s = t_s + exposure_s / 2
    coherent = _coherence(middle_s, frequencies)
    best = int(np.argmax(coherent))
    if coherent[best] < _even_from(len(t_s)):
        return None
    frequency = float(frequencies[best])
    share = float(coherent[best] * np.mean(np.abs(np.sinc(frequency * exposure_s))))
    return UnseenFlicker(1 / frequency, share) if share > MIN_SHARE else None


def _coherence(t_s: FloatArray, frequency_hz: FloatArray) -> FloatArray:
    """Return |Σ exp(2πi f t)|/n of times (n,) at frequencies (f,): 1 where flicker stands still."""
    phase = np.multiply.outer(frequency_hz, t_s - t_s[0])
    return np.asarray(np.abs(np.exp(2j * np.pi * phase).mean(axis=1)))


def _even_from(n_values: int) -> float:
    """Return the coherence from which n times are evenly spaced: random ones hardly have it."""
    return max(EVEN, float(np.sqrt((np.log(2 * n_values) + 3) / n_values)))


#: Significance level of each misfit test.
MISFIT_LEVEL = 5e-4
#: Number of frames below which the order of residuals is not tested.
MIN_FOR_ORDER = 8
#: Reduced χ² below which σ is doubted: 0.6 of the scatter that it says, if not by chance.
TOO_SMALL_CHI2 = 0.36
#: σ of log k from which a rate is unresolved: its errors are far from symmetric, and beyond 3 σ
#: more often than σ says.
UNRESOLVED = 0.2
#: Ratio to the slowest rate searched below which a rate is at that bound.
NEAR_BOUND = 1.001
BELOW_ZERO_SIGMAS = 5.0
OFFSET_SIGMAS = 4.0
#: Distance of an outlier from the curve in robust standard deviations of the frames.
OUTLIER_SIGMAS = 7.0
#: Distance of an outlier in σ of its own noise, and the largest number of outliers reported.
OUTLIER_OWN_SIGMAS = 3.0
MAX_NAMED = 2


@dataclass(frozen=True)
class FitResiduals:
    """Residuals of the selected fit, split into common-mode and colour.

    Attributes
    ----------
    t_s
        Rising begins of the exposures in seconds, shape (n,).
    frames
        Residual of each frame along the signal by rising time, of unit variance, shape (n,).
    frame_dof
        Degrees of freedom that the fit left to `frames`.
    colour_chi2, colour_dof
        χ² and degrees of freedom of the residuals across the signal; 0 for one channel.
    noise_dof
        Degrees of freedom of the noise estimate; inf if σ and flicker were given.
    middle_s, signal_to_noise
        Middles of the exposures in seconds, and signal of each frame in σ, shape (n,).
    repeat
        Index of the charge that each frame follows, shape (n,).
    """

    t_s: FloatArray
    frames: FloatArray
    frame_dof: float
    colour_chi2: float
    colour_dof: float
    noise_dof: float
    middle_s: FloatArray
    signal_to_noise: FloatArray
    repeat: NDArray[np.intp]


def misfit_warnings(residuals: FitResiduals, law: str, remedy: str) -> list[ResultWarning]:
    """Test the order, the scatter and the colour of the residuals against the noise.

    Parameters
    ----------
    residuals
        The residuals.
    law
        Law that was fitted, such as `2 exponentials`.
    remedy
        Advice if the shape is wrong.
    """
    outliers = _outlier_warnings(residuals)
    warnings: list[ResultWarning] = [*outliers]
    p_order = order_p_value(residuals.frames)
    if p_order < MISFIT_LEVEL:
        warnings.append(
            Misfit(
                "residuals-correlated",
                "the fit of {law} does not describe this decay: neighbouring residuals agree (p = "
                "{p_value:.1g}); {remedy}",
                law=law,
                p_value=p_order,
                remedy=remedy,
            )
        )
    frame_chi2 = float(residuals.frames @ residuals.frames)
    frame_p = _excess_p_value(frame_chi2, residuals.frame_dof, residuals.noise_dof)
    if frame_p < MISFIT_LEVEL <= p_order and not outliers:
        warnings.append(
            Misfit(
                "scatter-exceeds-sigma",
                "frames scatter {factor:.2g} times as much as σ and flicker explain; every σ given "
                "here is too small by about that: estimate the flicker (--flicker auto) or check σ",
                factor=np.sqrt(frame_chi2 / residuals.frame_dof),
            )
        )
    if _excess_p_value(residuals.colour_chi2, residuals.colour_dof, np.inf) < MISFIT_LEVEL:
        warnings.append(
            Misfit(
                "colour-changes",
                "the colour changes during the decay more than σ allows (reduced χ² between the "
                "channels {reduced_chi2:.3g}): check dark level and σ of each channel, or fit the "
                "channels one by one",
                reduced_chi2=residuals.colour_chi2 / residuals.colour_dof,
            )
        )
    return warnings + _flicker_warnings(residuals)


def small_chi2_warnings(chi2: float, dof: float, sigma_from_scatter: bool) -> list[ResultWarning]:
    """Return a warning if the values lie much closer to the fit than σ says."""
    if dof < 1 or chi2 >= TOO_SMALL_CHI2 * dof or chdtr(dof, chi2) > MISFIT_LEVEL:
        return []
    factor = float(np.sqrt(dof / chi2)) if chi2 > 0 else np.inf
    if sigma_from_scatter:
        return [
            Undetermined(
                "sigma-upper-bound",
                "the values lie {factor:2r} times closer to the fit than σ implies: their scatter "
                "is too small for the curve that measures it, and every σ here is an upper bound; "
                "give the values' σ if you have it",
                factor=factor,
            )
        ]
    return [
        Contradiction(
            "sigma-too-large",
            "the values lie {factor:2r} times closer to the fit than σ implies: σ is too large, "
            "and with it every σ given here, or it is another quantity; check its column and its "
            "unit, or leave it out, and it is taken from the scatter",
            factor=factor,
        )
    ]


def _outlier_warnings(residuals: FitResiduals) -> list[Disturbance]:
    """Return a warning for each frame that is far from the curve compared with the others."""
    size = np.abs(residuals.frames)
    if len(size) < MIN_FOR_ORDER:
        return []
    # The median does not mind the outlier, whatever σ and flicker were made of it.
    typical = 1.4826 * float(np.median(size))
    outliers = np.flatnonzero((size > OUTLIER_SIGMAS * typical) & (size > OUTLIER_OWN_SIGMAS))
    return [
        Disturbance(
            "frame-outlier",
            "the frame at {t_s:.4g} s lies {factor:.0f} times as far off the curve as the others "
            "do: look at it, leave it out if something disturbed it (labrig process --exclude, "
            "labrig fit decay --from, or its row)",
            t_s=residuals.t_s[row],
            factor=size[row] / max(typical, 1e-3),
        )
        for row in outliers[np.argsort(-size[outliers])][:MAX_NAMED]
    ]


def _flicker_warnings(residuals: FitResiduals) -> list[ResultWarning]:
    """Return a warning if the residuals after one of the charges repeat periodically."""
    repeats = [residuals.repeat == one for one in np.unique(residuals.repeat)]
    lines = [
        (found, rows)
        for rows in repeats
        if (
            found := periodogram(
                residuals.middle_s[rows], residuals.frames[rows], residuals.signal_to_noise[rows]
            )
        )
        is not None
    ]
    if not lines:
        return []
    found, rows = min(lines, key=lambda line: line[0].p_value)
    p_value = min(found.p_value * len(lines), 1.0)
    if p_value > MISFIT_LEVEL:
        return []
    phase = 2 * np.pi * residuals.middle_s[rows] / found.period_s
    sine = residuals.signal_to_noise[rows] * np.stack([np.cos(phase), np.sin(phase)])
    amplitude = np.linalg.norm(np.linalg.lstsq(sine.T, residuals.frames[rows])[0])
    if found.spacing_s is None:
        return [
            Disturbance(
                "residuals-periodic",
                "the residuals repeat every {period_s:3r} s, by ±{amplitude_percent:2r} % (p = "
                "{p_value:.1g}): light or camera flickers; σ allows for it as for noise, find its "
                "source (a power supply, a regulated temperature)",
                period_s=found.period_s,
                amplitude_percent=100 * amplitude,
                p_value=p_value,
            )
        ]
    return [
        Disturbance(
            "residuals-periodic",
            "the residuals repeat every {period_s:3r} s, by ±{amplitude_percent:2r} % (p = "
            "{p_value:.1g}), or every {aliases_s:3r}, … s, periods that evenly spaced frames do "
            "not resolve from it: light or camera flickers; σ allows for it as for noise, find its "
            "source (a power supply, a regulated temperature)",
            period_s=found.period_s,
            amplitude_percent=100 * amplitude,
            p_value=p_value,
            aliases_s=found.aliases_s,
        )
    ]


def order_p_value(residuals: FloatArray) -> float:
    """Return the chance that independent residuals (n,) agree with their neighbours that much.

    It is the smaller one of lag-1 autocorrelation and Wald and Wolfowitz's runs of signs.
    """
    n = len(residuals)
    power = float(residuals @ residuals)
    if n < MIN_FOR_ORDER or power == 0:
        return 1.0
    autocorrelation = float(residuals[1:] @ residuals[:-1]) / power
    positive = residuals > 0
    n_positive = int(positive.sum())
    expected = 1 + 2 * n_positive * (n - n_positive) / n
    variance = (expected - 1) * (expected - 2) / (n - 1)
    runs = 1 + int(np.count_nonzero(positive[1:] != positive[:-1]))
    z_runs = (expected - runs) / np.sqrt(variance) if variance > 0 else 0.0
    return float(ndtr(-max(autocorrelation * np.sqrt(n), z_runs)))


def _excess_p_value(chi2: float, dof: float, noise_dof: float) -> float:
    if dof < 1:
        return 1.0
    if np.isinf(noise_dof):
        return float(chdtrc(dof, chi2))
    return float(fdtrc(dof, noise_dof, chi2 / dof))


def state_warnings(
    states: tuple[DecayState, ...],
    log_rate_covariance: FloatArray,
    span_s: float,
    rate_bounds_per_s: tuple[float, float],
    all_needed: bool,
    free_offset: bool,
) -> list[ResultWarning]:
    """Return warnings about rates that the data do not constrain.

    Parameters
    ----------
    states
        States by falling rate.
    log_rate_covariance
        Covariance of log k, shape (n, n).
    span_s
        Time from the first frame to the last in seconds.
    rate_bounds_per_s
        Slowest and fastest rate searched, in 1/s.
    all_needed
        Whether the data refute one state fewer.
    free_offset
        Whether a constant without prior was fitted.
    """
    warnings: list[ResultWarning] = []
    more_light = "take more light" if all_needed else "ask for fewer states or take more light"
    sigma = np.sqrt(np.diag(log_rate_covariance))
    slowest, fastest = rate_bounds_per_s
    lifetime_s = 1 / states[-1].k_r_per_s
    for number, state in enumerate(states, start=1):
        if state.k_r_per_s_sigma == 0:
            continue
        if state.k_r_per_s < NEAR_BOUND * slowest:
            warnings.append(
                Undetermined(
                    "rate-too-slow",
                    "k{state} = {rate_per_s:.3g} /s is the slowest rate that {span_s:.4g} s "
                    "resolve from a constant: {remedy}",
                    state=number,
                    rate_per_s=state.k_r_per_s,
                    span_s=span_s,
                    remedy=(
                        "record longer"
                        if free_offset
                        else "subtract the dark level, fit an offset (labrig fit decay --offset) "
                        "or record longer"
                    ),
                )
            )
        elif state.k_r_per_s > 0.999 * fastest:
            warnings.append(
                Undetermined(
                    "rate-too-fast",
                    "k{state} = {rate_per_s:.3g} /s is the fastest rate that the steps in time "
                    "resolve: take the first frames closer together, or start after the lamp's own "
                    "glow (labrig fit decay --from)",
                    state=number,
                    rate_per_s=state.k_r_per_s,
                )
            )
        elif sigma[number - 1] > UNRESOLVED:
            long_lived = number == len(states) and lifetime_s > span_s
            warnings.append(
                Undetermined(
                    "rate-unresolved",
                    "k{state} = {rate_per_s:.3g} /s is determined to {sigma_percent:.0f} % only: "
                    "{remedy}",
                    state=number,
                    rate_per_s=state.k_r_per_s,
                    sigma_percent=100 * sigma[number - 1],
                    remedy="record longer" if long_lived else more_light,
                )
            )
    log_rates = np.log([state.k_r_per_s for state in states])
    for number, apart in enumerate(sigmas_apart(log_rates, log_rate_covariance), start=1):
        is_constant = states[number].k_r_per_s < NEAR_BOUND * slowest
        if apart < APART_SIGMAS and not (all_needed and is_constant):
            warnings.append(
                Undetermined(
                    "rates-indistinct",
                    "k{faster} and k{slower} cannot be distinguished: {remedy}",
                    faster=number,
                    slower=number + 1,
                    sigmas_apart=apart,
                    remedy=(
                        "fewer states do not describe this decay: record longer, or take more light"
                        if all_needed
                        else f"ask for one state fewer (--states {len(states) - 1})"
                    ),
                )
            )
    is_fixed = states[-1].k_r_per_s_sigma == 0
    if free_offset and not is_fixed and sigma[-1] > ILL_DETERMINED:
        warnings.append(
            Undetermined(
                "offset-unresolved",
                "the data hardly resolve the free offset from the slowest state: give the offset "
                "(labrig fit decay --offset zero, or the σ of the subtracted level) or record "
                "longer",
                sigma_percent=100 * sigma[-1],
            )
        )
    if lifetime_s > span_s and not is_fixed and sigma[-1] <= UNRESOLVED:
        warnings.append(
            Extrapolated(
                "lifetime-beyond-record",
                "the slowest state lives {lifetime_s:.3g} s, longer than the {span_s:.4g} s "
                "recorded: record longer to be sure of it",
                lifetime_s=lifetime_s,
                span_s=span_s,
            )
        )
    return warnings


def offset_warnings(
    channels: tuple[str, ...], offsets: FloatArray, prior_sigma: FloatArray
) -> list[ResultWarning]:
    """Return warnings about fitted offsets (C,) far from their priors, both in the same unit."""
    return [
        Contradiction(
            "offset-beyond-prior",
            "the offset of {channel} is {sigmas:.0f} times its prior σ from zero: a light may have "
            "come on, or the dark level is wrong; else its σ is too small",
            channel=name,
            sigmas=abs(offset) / sigma,
        )
        for name, offset, sigma in zip(channels, offsets, prior_sigma, strict=True)
        if 0 < sigma < np.inf and abs(offset) >= OFFSET_SIGMAS * sigma
    ]


def rise_in_sigmas(signal: FloatArray, information: FloatArray) -> float:
    """Return the rise from the first to the last quarter of the frames in σ.

    Parameters
    ----------
    signal, information
        Common signal of the channels by rising time, and its inverse variance, shape (n,).
    """
    quarter = max(len(signal) // 4, 1)
    first, first_variance = _mean(signal[:quarter], information[:quarter])
    last, last_variance = _mean(signal[-quarter:], information[-quarter:])
    return float((last - first) / np.sqrt(first_variance + last_variance))


def below_zero_warnings(signal: FloatArray, information: FloatArray) -> list[ResultWarning]:
    """Return a warning if the last quarter of the frames is below zero.

    The arguments are those of `rise_in_sigmas`.
    """
    quarter = max(len(signal) // 4, 1)
    last, variance = _mean(signal[-quarter:], information[-quarter:])
    if last > -BELOW_ZERO_SIGMAS * np.sqrt(variance):
        return []
    return [
        Contradiction(
            "signal-below-zero",
            "the signal falls below zero, by {sigmas:.0f} σ in the last quarter of the frames: too "
            "much was subtracted, check the dark level or fit an offset (--offset)",
            sigmas=-last / np.sqrt(variance),
        )
    ]


def _mean(signal: FloatArray, information: FloatArray) -> tuple[float, float]:
    """Return the weighted mean and its variance."""
    total = float(information.sum())
    return (float(signal @ information) / total, 1 / total) if total else (0.0, np.inf)
