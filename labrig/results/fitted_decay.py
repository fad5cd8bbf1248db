"""Fit of a decay: rates and amplitudes with their uncertainties."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError, FitError
from labrig.foundation.notebook_views import NotebookViews
from labrig.foundation.number_format import aligned, rounded
from labrig.foundation.result_warning import ResultWarning, warning_lines
from labrig.material import exponential_means_and_slopes
from labrig.results.decay_reference import DecayReference, UnseenFlicker
from labrig.results.fitted_law import (
    EXPONENTIALS,
    LAW_LABELS,
    DecayForecast,
    FittedLaw,
    FittedRateSpectrum,
    curve_variance,
    interval_name,
)
from labrig.results.interval import ProfileInterval, interval_lines
from labrig.results.measured import Measured, with_uncertainty
from labrig.results.text_files import finite, json_text

#: Times of the measurement beyond which a signal is not predicted with σ.
FORECAST_SPANS = 3.0
#: Reduced χ² of a law, in that of the best one, up to which it is in the bracket of a forecast.
BRACKET_CHI2 = 4.0
#: Relative difference below which the σ of all values is given as one.
_SAME_SIGMA = 0.05
#: Change of a rate in σ from which what it would be due to is worth a word.
REPORTED_ABOVE_SIGMA = 0.3
#: Version of `fit.json`: another number means renamed keys or other meanings.
SCHEMA_VERSION = 5


@dataclass(frozen=True)
class DecayState:
    """One exponential a e^(−k t); its σ are standard uncertainties.

    Attributes
    ----------
    k_r_per_s, k_r_per_s_sigma
        Rate k in 1/s; σ is 0 if it was held.
    amplitude, amplitude_sigma
        Amplitude a at lamp off, or another `reference`, in the brightest channel, in the unit of
        the values.
    """

    k_r_per_s: float
    k_r_per_s_sigma: float
    amplitude: float
    amplitude_sigma: float


@dataclass(frozen=True)
class Candidate:
    """Quality of the fit with n states, all candidates at the same weights.

    Attributes
    ----------
    n_states
        Number of states.
    reduced_chi2
        χ² per degree of freedom; NaN if there are none.
    bic
        Bayesian information criterion: χ² + parameters · log(independent data).
    f_p_value
        p-value of the F-test against one state fewer; None for the first candidate.
    """

    n_states: int
    reduced_chi2: float
    bic: float
    f_p_value: float | None


@dataclass(frozen=True)
class ComparedLaw:
    """A law of decay beside the others that were fitted to the same data.

    Attributes
    ----------
    name, formula
        Name and formula of the law; the number of states of exponentials.
    reduced_chi2
        χ² per degree of freedom; NaN if there are none.
    bic_above_best
        BIC above that of the best law.
    probability
        Probability of the law among those fitted, by their BIC.
    """

    name: str
    formula: str
    reduced_chi2: float
    bic_above_best: float
    probability: float


@dataclass(frozen=True)
class ScatterSigma:
    """Standard uncertainty σ of values that came without, from their scatter about a smooth curve.

    At the signal s it is σ² = constant² + counting · s + (proportional · s)².

    Attributes
    ----------
    constant
        Part that is the same for all values, in their unit.
    counting
        Increase of the variance with the signal, in the unit of the values; 1 for counts.
    proportional
        Part in proportion to the signal.
    at_brightest, at_faintest
        σ of the brightest and of the faintest value, in their unit.
    dof
        Degrees of freedom of the estimate: values less those that the curve took.
    is_of_residuals
        Whether it is the standard deviation of the residuals, the same for all values: that of
        unweighted least squares.
    """

    constant: float
    counting: float
    proportional: float
    at_brightest: float
    at_faintest: float
    dof: float
    is_of_residuals: bool = False

    def __str__(self) -> str:
        """Return where σ came from, and σ of the brightest and the faintest value."""
        if self.is_of_residuals:
            return f"the same for all values, {self.constant:.3g}, from the residuals"
        values = (
            f"{self.at_brightest:.3g} for all values"
            if abs(self.at_brightest - self.at_faintest) < _SAME_SIGMA * self.at_faintest
            else f"{self.at_brightest:.3g} at the brightest value, {self.at_faintest:.3g} at the "
            "faintest"
        )
        return f"from the scatter about the best monotone curve, {values}"


@dataclass(frozen=True)
class UnseenState:
    """A further state, gone between the first frames, that the data would not show.

    Of all lifetimes that are too short for the frames it has the one that would matter most to the
    fitted rates. Its effect is not in their σ.

    Attributes
    ----------
    lifetime_s
        Its lifetime in seconds.
    share
        Its share of all light at lamp off, or another `reference`, which is not larger with a
        probability of 95 %.
    rate_changes, amplitude_changes
        Relative changes of rate and amplitude of every fitted state, by falling rate, if it had
        that share.
    """

    lifetime_s: float
    share: float
    rate_changes: tuple[float, ...]
    amplitude_changes: tuple[float, ...]

    @property
    def remedy(self) -> str:
        """Timing of the frames that would show it."""
        return recommended_sampling(self.lifetime_s)


def recommended_sampling(lifetime_s: float) -> str:
    """Return the timing of frames that shows a state, in words.

    Parameters
    ----------
    lifetime_s
        Lifetime of the state in seconds, > 0.

    Returns
    -------
    str
        Distance of the frames, and for how long they have to be so close.

    Examples
    --------
    >>> from labrig.results import recommended_sampling
    >>> recommended_sampling(2.0)
    'frames closer together than 1 s in the first 6 s'
    """
    return f"frames closer together than {lifetime_s / 2:.2g} s in the first {3 * lifetime_s:.2g} s"


@dataclass(frozen=True)
class FittedDecay(NotebookViews):
    """Decay model Σ_i a_i e^(−k_i t), times a weight and plus an offset for each channel.

    Attributes
    ----------
    states
        Exponentials by falling rate.
    channels
        Names of the C channels.
    channel_weights, channel_weights_sigma
        Weights of the channels, whose maximum is held at 1, and their σ.
    offsets, offsets_sigma
        Offsets of the channels in the unit of the values; σ is 0 if held at 0.
    repeats, levels
        Names of the charges, and brightness of the decay after each relative to their mean.
    flicker, flicker_sigma
        Relative noise common to the channels of a frame; σ is 0 if it was given.
    chi2, dof
        Sum of squared normalised residuals and its degrees of freedom.
    bic
        Bayesian information criterion: χ² + parameters · log(independent data).
    covariance
        Covariance of the `covariance_parameters`; channel weights and the other channels' offsets
        marginalised.
    warnings
        Limits of the fit and remedies.
    candidates
        Fits with each number of states that was tried.
    law
        Name of the law that describes the decay: `exponentials`, or another that was asked for or
        is clearly better.
    laws
        Other laws, fitted to the same data.
    rate_spectrum
        Smooth spectrum of rates, fitted to the same data; None without a signal.
    measured_until_s
        End of the last exposure in seconds, as the fitted times count.
    reference
        Time at which amplitudes hold and from which laws count: lamp off, t = 0, or the first row
        where the clock tells nothing of lamp off.
    scatter
        Uncertainties of the values from their scatter; None if they were given.
    sigma_origin
        Where the σ of a table's values came from, and what was done with them, in words.
    sigma_factor
        Factor by which the given uncertainties were multiplied, since the values scatter so much
        more; 1 if they do not.
    unseen_state
        Fast state that the data would not show; None if frames leave no room for one, or a warning
        tells one.
    intervals
        Intervals by profile likelihood, where ±σ misses them by more than 20 % or where they were
        asked for: of `k_r_per_s 1`, `lifetime_s 1`, …, and of the law's own `parameters`.
    value_unit
        Unit of the values, and so of amplitudes and offsets, such as `DN/s`; empty if unknown.
    unseen_flicker
        Periodic flicker that evenly spaced frames do not distinguish from the decay; None if there
        is none.
    """

    states: tuple[DecayState, ...]
    channels: tuple[str, ...]
    channel_weights: tuple[float, ...]
    channel_weights_sigma: tuple[float, ...]
    offsets: tuple[float, ...]
    offsets_sigma: tuple[float, ...]
    repeats: tuple[str, ...]
    levels: tuple[float, ...]
    flicker: float
    flicker_sigma: float
    chi2: float
    dof: int
    bic: float
    covariance: FloatArray
    warnings: tuple[ResultWarning, ...]
    candidates: tuple[Candidate, ...]
    law: str
    laws: tuple[FittedLaw, ...]
    rate_spectrum: FittedRateSpectrum | None
    measured_until_s: float
    reference: DecayReference = field(default=DecayReference(), kw_only=True)
    scatter: ScatterSigma | None = field(default=None, kw_only=True)
    sigma_origin: str = field(default="", kw_only=True)
    sigma_factor: float = field(default=1.0, kw_only=True)
    unseen_state: UnseenState | None = field(default=None, kw_only=True)
    intervals: Mapping[str, ProfileInterval] = field(default_factory=dict, kw_only=True)
    unseen_flicker: UnseenFlicker | None = field(default=None, kw_only=True)
    value_unit: str = field(default="", kw_only=True)

    @property
    def other_laws(self) -> tuple[FittedLaw | FittedRateSpectrum, ...]:
        """Laws other than exponentials that were fitted, the spectrum of rates last."""
        return (*self.laws, *(() if self.rate_spectrum is None else (self.rate_spectrum,)))

    @property
    def covariance_parameters(self) -> tuple[str, ...]:
        """Names of the rows of `covariance`: rate and amplitude of each state, then the offset."""
        state_parameters = [
            name
            for number in range(1, self.n_states + 1)
            for name in (f"k_r_per_s {number}", f"amplitude {number}")
        ]
        return (*state_parameters, "offset")

    @property
    def rates(self) -> tuple[Measured, ...]:
        """Decay rate of every state in 1/s, falling."""
        return tuple(Measured(s.k_r_per_s, s.k_r_per_s_sigma, "1/s") for s in self.states)

    @property
    def chosen_law(self) -> FittedLaw | None:
        """Law that describes the decay; None if exponentials or a spectrum of rates do."""
        return next((law for law in self.laws if law.name == self.law), None)

    @property
    def parameters(self) -> dict[str, Measured]:
        """Parameters that tell the decay's course, by name: `k_r_per_s 1`, …, or the law's own."""
        if self.chosen_law is not None:
            return self.chosen_law.parameters
        return {f"k_r_per_s {number}": rate for number, rate in enumerate(self.rates, start=1)}

    @property
    def brightest_channel(self) -> str:
        """Name of the channel of weight 1, in whose DN/s the amplitudes are."""
        return self.channels[self.brightest]

    @property
    def named_intervals(self) -> dict[str, ProfileInterval]:
        """Intervals by the symbols and units of their parameters."""
        return {interval_name(name): each for name, each in self.intervals.items()}

    def amplitudes_in(self, channel: str) -> tuple[Measured, ...]:
        """Return the amplitude of every state at lamp off in the DN/s of a channel.

        Raises
        ------
        DataError
            There is no such channel.
        """
        if channel not in self.channels:
            raise DataError(
                f"expected the same channels in both runs, got {channel} in one of them and "
                f"{', '.join(self.channels)} in the other"
            )
        index = self.channels.index(channel)
        weight = Measured(self.channel_weights[index], self.channel_weights_sigma[index])
        return tuple(
            Measured(s.amplitude, s.amplitude_sigma, "DN/s").times(weight)
            for s in self.states_at_lamp_off
        )

    @property
    def states_at_lamp_off(self) -> tuple[DecayState, ...]:
        """States with their amplitudes at t = 0; infinite where numbers do not hold them."""
        earlier_s = self.reference.t_s
        if earlier_s == 0:
            return self.states
        states = []
        with np.errstate(over="ignore", invalid="ignore"):
            for number, state in enumerate(self.states):
                growth = float(np.exp(state.k_r_per_s * earlier_s))
                own = self.covariance[2 * number : 2 * number + 2, 2 * number : 2 * number + 2]
                by_both = growth * np.array([state.amplitude * earlier_s, 1.0])
                sigma = float(np.sqrt(by_both @ own @ by_both))
                states.append(
                    replace(
                        state,
                        amplitude=state.amplitude * growth,
                        amplitude_sigma=sigma if math.isfinite(sigma) else math.inf,
                    )
                )
        return tuple(states)

    @property
    def n_states(self) -> int:
        """Number of states."""
        return len(self.states)

    @property
    def brightest(self) -> int:
        """Index of the channel of weight 1, in whose unit the amplitudes are."""
        return int(np.argmax(self.channel_weights))

    @property
    def offset(self) -> float:
        """Offset of the brightest channel in the unit of the values."""
        return self.offsets[self.brightest]

    @property
    def offset_sigma(self) -> float:
        """Standard uncertainty of the brightest channel's offset."""
        return self.offsets_sigma[self.brightest]

    @property
    def reduced_chi2(self) -> float:
        """χ² per degree of freedom; NaN if there are none."""
        return self.chi2 / self.dof if self.dof > 0 else math.nan

    def predict(self, t_s: ArrayLike, exposure_s: ArrayLike = 0.0) -> FloatArray:
        """Return the mean signal during exposures, offsets included, shape (n, C).

        Parameters
        ----------
        t_s
            Start of each exposure in seconds, as the fitted times count, shape (n,).
        exposure_s
            Exposure time in seconds, ≥ 0, one for all or shape (n,).

        Raises
        ------
        FitError
            The shapes do not agree.
        """
        t = np.atleast_1d(np.asarray(t_s, dtype=np.float64))
        exposure = np.asarray(exposure_s, dtype=np.float64)
        if t.ndim != 1 or exposure.shape not in {(), t.shape}:
            raise FitError(
                f"expected times (n,) and one exposure or (n,), got {t.shape} and "
                f"{exposure.shape}; give one exposure per time"
            )
        signal, _ = self.signal(t, np.broadcast_to(exposure, t.shape))
        law = self._law(self.law)
        weights, offsets = (
            (self.channel_weights, self.offsets)
            if law is None
            else (law.channel_weights, law.offsets)
        )
        predicted: FloatArray = np.multiply.outer(signal, weights) + offsets
        return predicted

    def _law(self, name: str) -> FittedLaw | FittedRateSpectrum | None:
        """Return a law by its name; None for the exponentials."""
        if name == EXPONENTIALS:
            return None
        for law in self.other_laws:
            if law.name == name:
                return law
        raise FitError(f"expected one of the laws that were fitted, got '{name}'")

    def signal(
        self,
        t_s: FloatArray,
        exposure_s: FloatArray,
        law: str | None = None,
        *,
        with_offset: bool = False,
    ) -> tuple[FloatArray, FloatArray]:
        """Return the signal in the brightest channel and its variance, (n,) each.

        Parameters
        ----------
        t_s, exposure_s
            Begin, as the fitted times count, and length of the exposures in seconds, shape (n,).
        law
            Name of the law; None is the one that describes the decay.
        with_offset
            Whether the offset of the channel is a part of it.

        Raises
        ------
        FitError
            The law was not fitted.
        """
        other = self._law(law or self.law)
        t_s = t_s - self.reference.t_s
        if other is not None:
            return other.signal(t_s, exposure_s, with_offset=with_offset)
        rates = np.array([state.k_r_per_s for state in self.states])
        amplitudes = np.array([state.amplitude for state in self.states])
        means, slopes = exponential_means_and_slopes(rates, t_s, exposure_s)
        jacobian = np.full((len(t_s), len(self.covariance)), float(with_offset))
        jacobian[:, 0:-1:2] = slopes / rates * amplitudes
        jacobian[:, 1:-1:2] = means
        shift = self.offset if with_offset else 0.0
        return means @ amplitudes + shift, curve_variance(jacobian, self.covariance)

    @property
    def compared_laws(self) -> tuple[ComparedLaw, ...]:
        """Laws that were fitted, the best first."""
        begin = self.reference.name
        others = [
            (law.name, law.formula.replace("lamp off", begin), law.reduced_chi2, law.bic)
            for law in self.other_laws
        ]
        own: tuple[Candidate | FittedDecay, ...] = self.candidates or (self,)
        best = min(own, key=lambda each: each.bic)
        number = f"{self.n_states} state{'' if self.n_states == 1 else 's'}"
        entries = [(EXPONENTIALS, number, best.reduced_chi2, best.bic), *others]
        lowest = min(bic for *_, bic in entries)
        weights = [math.exp((lowest - bic) / 2) for *_, bic in entries]
        compared = [
            ComparedLaw(name, formula, chi2, bic - lowest, weight / sum(weights))
            for (name, formula, chi2, bic), weight in zip(entries, weights, strict=True)
        ]
        return tuple(sorted(compared, key=lambda law: law.bic_above_best))

    @property
    def best_bic(self) -> float:
        """Lowest Bayesian information criterion of all numbers of states and all laws."""
        bics = [candidate.bic for candidate in self.candidates] or [self.bic]
        return min([*bics, *(law.bic for law in self.other_laws)])

    def forecast(
        self, t_s: ArrayLike, exposure_s: float = 0.0, after_s: float = 0.0
    ) -> DecayForecast:
        """Return the signal at any times, averaged over the laws by probability.

        A law that describes what was measured may be wrong by a large factor later: beyond three
        times the last measured time there is no value with σ, only the bracket of all laws that
        describe the data about as well as the best one does.

        Parameters
        ----------
        t_s
            Start of each exposure in seconds after `after_s`, shape (n,).
        exposure_s
            Exposure time in seconds, ≥ 0.
        after_s
            Time from which `t_s` count, as the fitted times do: 0 is lamp off.
        """
        after = np.atleast_1d(np.asarray(t_s, dtype=np.float64))
        t = after + after_s
        exposure = np.full_like(t, exposure_s)
        compared = self.compared_laws
        curves = [self.signal(t, exposure, law.name) for law in compared]
        values = np.stack([value for value, _ in curves])
        weights = np.array([law.probability for law in compared])[:, None]
        value = (weights * values).sum(axis=0)
        spread = np.stack([variance for _, variance in curves]) + (values - value) ** 2
        # A law that is not probable may have an infinite σ.
        sigma = np.sqrt((weights * np.where(weights > 0, spread, 0.0)).sum(axis=0))
        chi2 = np.array([law.reduced_chi2 for law in compared])
        describes = chi2 <= BRACKET_CHI2 * np.nanmin(chi2) if np.isfinite(chi2).any() else chi2 != 0
        is_far = t > self.forecast_until_s
        return DecayForecast(
            t_s=after,
            value=np.where(is_far, np.nan, value),
            sigma=np.where(is_far, np.nan, sigma),
            low=values[describes].min(axis=0),
            high=values[describes].max(axis=0),
        )

    @property
    def forecast_until_s(self) -> float:
        """Time up to which a signal is predicted with σ, as the fitted times count."""
        begin_s = self.reference.t_s
        return begin_s + FORECAST_SPANS * (self.measured_until_s - begin_s)

    @property
    def outside_sigma(self) -> str:
        """Changes by a state that goes unseen, in words; empty if they are next to nothing."""
        unseen = self.unseen_state
        if unseen is None or self.law != EXPONENTIALS:
            return ""
        changes = self.describe_changes(unseen.rate_changes, unseen.amplitude_changes)
        if not changes:
            return ""
        return (
            f"a state that lives {rounded(unseen.lifetime_s, 2)} s would go unseen up to "
            f"{rounded(100 * unseen.share, 2)} % of the light at {self.reference.name}; it would "
            f"change {changes}; {unseen.remedy} would show it"
        )

    def describe_changes(
        self, rate_changes: Sequence[float], amplitude_changes: Sequence[float]
    ) -> str:
        """Return the sizes of relative changes of rates and amplitudes in words.

        Parameters
        ----------
        rate_changes, amplitude_changes
            Relative change of rate and amplitude of every state, by falling rate.

        Returns
        -------
        str
            The ones that are the largest in σ; empty if none of them is worth a word.
        """
        rates = [(state.k_r_per_s, state.k_r_per_s_sigma) for state in self.states]
        amplitudes = [(state.amplitude, state.amplitude_sigma) for state in self.states]
        largest = [
            _largest_in_sigma(rate_changes, rates),
            _largest_in_sigma(amplitude_changes, amplitudes),
        ]
        if max(in_sigma for _, in_sigma in largest) < REPORTED_ABOVE_SIGMA:
            return ""
        of_rates, of_amplitudes = (
            f"{rounded(100 * relative, 2)} % ({rounded(in_sigma, 2)} σ)"
            for relative, in_sigma in largest
        )
        return f"rates by up to {of_rates} and amplitudes by up to {of_amplitudes}"

    def to_dict(self) -> dict[str, Any]:
        """Return the content of `fit.json`; values that are not finite are None."""
        fields: dict[str, Any] = {
            "schema_version": SCHEMA_VERSION,
            "n_states": self.n_states,
            "states": [asdict(state) for state in self.states],
            "channel_weights": self._by_channel(self.channel_weights),
            "channel_weights_sigma": self._by_channel(self.channel_weights_sigma),
            "offset": self.offset,
            "offset_sigma": self.offset_sigma,
            "offsets": self._by_channel(self.offsets),
            "offsets_sigma": self._by_channel(self.offsets_sigma),
            "levels": dict(zip(self.repeats, self.levels, strict=True)),
            "flicker": self.flicker,
            "flicker_sigma": self.flicker_sigma,
            "chi2": self.chi2,
            "dof": self.dof,
            "reduced_chi2": self.reduced_chi2,
            "bic": self.bic,
            "covariance_parameters": list(self.covariance_parameters),
            "covariance": self.covariance.tolist(),
            "warnings": [each.to_dict() for each in self.warnings],
            "candidates": [asdict(candidate) for candidate in self.candidates],
            "law": self.law,
            "laws": [law.to_dict() for law in self.laws],
            "rate_spectrum": self.rate_spectrum.to_dict() if self.rate_spectrum else None,
            "law_comparison": [asdict(law) for law in self.compared_laws],
            "measured_until_s": self.measured_until_s,
            "reference": asdict(self.reference),
            "sigma_from_scatter": asdict(self.scatter) if self.scatter else None,
            "sigma_origin": self.sigma_origin,
            "sigma_factor": self.sigma_factor,
            "unseen_state": asdict(self.unseen_state) if self.unseen_state else None,
            "intervals": {name: each.to_dict() for name, each in self.intervals.items()},
            "value_unit": self.value_unit,
            "unseen_flicker": asdict(self.unseen_flicker) if self.unseen_flicker else None,
        }
        content: dict[str, Any] = finite(fields)
        return content

    def to_json(self) -> str:
        """Return the text of `fit.json`."""
        return json_text(self.to_dict())

    def __str__(self) -> str:
        """Return the table and the warnings, a line each."""
        return "\n".join([self.table(), *warning_lines(self.warnings)])

    def table(self) -> str:
        """Return a table for people; digits in brackets are σ in units of the last places."""
        rows = [
            [
                str(number),
                with_uncertainty(state.k_r_per_s, state.k_r_per_s_sigma),
                with_uncertainty(1 / state.k_r_per_s, state.k_r_per_s_sigma / state.k_r_per_s**2),
                with_uncertainty(state.amplitude, state.amplitude_sigma),
            ]
            for number, state in enumerate(self.states, start=1)
        ]
        amplitude = f"amplitude / ({self.value_unit})" if self.value_unit else "amplitude"
        lines = aligned([["state", "k / s⁻¹", "1/k / s", amplitude], *rows])
        if not self.reference.is_lamp_off:
            lines.append(f"amplitudes are those at {self.reference}, where laws begin")
        lines += interval_lines(self.named_intervals)
        lines.append(
            f"weights  {self._values_text(self.channel_weights, self.channel_weights_sigma)}"
        )
        if any(self.offsets_sigma):
            offsets = self._values_text(self.offsets, self.offsets_sigma)
            lines.append(f"offsets  {offsets} {self.value_unit}".rstrip())
        if len(self.repeats) > 1:
            pairs = zip(self.repeats, self.levels, strict=True)
            lines.append(f"levels   {', '.join(f'{name} {level:.4f}' for name, level in pairs)}")
        if self.flicker or self.flicker_sigma:
            percent = (
                with_uncertainty(100 * self.flicker, 100 * self.flicker_sigma)
                if self.flicker_sigma
                else f"{100 * self.flicker:.2g}"
            )
            lines.append(f"flicker  {percent} %{'' if self.flicker_sigma else ' (held)'}")
        if self.scatter is not None or self.sigma_origin:
            lines.append(f"σ        {self.scatter or f'of {self.sigma_origin}'}")
        lines.append(f"reduced χ² {self.reduced_chi2:.3g} ({self.dof} dof), BIC {self.bic:.1f}")
        if self.other_laws:
            lines += aligned([["law (* taken)", "reduced χ²", "BIC", ""], *self._law_rows()])
            if self.compared_laws[0].name != self.law:
                lines.append(
                    f"{LAW_LABELS[self.compared_laws[0].name]} has the lowest BIC and is not "
                    "taken: a law replaces another one where its BIC is lower by a margin, or it "
                    "was asked for"
                )
        for outside in filter(None, (self.outside_sigma, str(self.unseen_flicker or ""))):
            lines.append(f"not in σ {outside}")
        return "\n".join(lines)

    def _law_rows(self) -> list[list[str]]:
        """Return the laws for people, the best first, with the one that was taken marked."""
        return [
            [
                f"{LAW_LABELS[law.name]}{' *' if law.name == self.law else ''}",
                f"{law.reduced_chi2:.3g}",
                f"+{law.bic_above_best:.1f}" if law.bic_above_best else "best",
                law.formula,
            ]
            for law in self.compared_laws
        ]

    def _by_channel(self, values: tuple[float, ...]) -> dict[str, float]:
        return dict(zip(self.channels, values, strict=True))

    def _values_text(self, values: tuple[float, ...], sigmas: tuple[float, ...]) -> str:
        return ", ".join(
            f"{name} {with_uncertainty(value, sigma)}"
            for name, value, sigma in zip(self.channels, values, sigmas, strict=True)
        )


def _largest_in_sigma(
    changes: Sequence[float], values: Sequence[tuple[float, float]]
) -> tuple[float, float]:
    """Return size and size in σ of the relative change that is the largest in σ; of (value, σ)."""
    sizes = [
        (abs(change), abs(change * value) / sigma if 0 < sigma < math.inf else 0.0)
        for change, (value, sigma) in zip(changes, values, strict=True)
    ]
    return max(sizes, key=lambda size: size[1])
