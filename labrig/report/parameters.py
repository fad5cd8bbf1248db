"""Results of a fitted decay as rows of tables and sentences, and tables of intervals."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from labrig.foundation.number_format import plus_minus, rounded
from labrig.report.sections import Table
from labrig.results import EXPONENTIALS, LAW_LABELS, FittedDecay, ProfileInterval, interval_rows

#: Relative σ of a rate from which its reciprocal is given without σ.
WORST_FOR_LIFETIME = 0.5


@dataclass(frozen=True)
class Row:
    """Row of a table.

    Attributes
    ----------
    quantity
        Name of the quantity.
    unit
        Unit of the values; empty without one.
    values
        Values with σ as text, one a column.
    """

    quantity: str
    unit: str
    values: tuple[str, ...]


@dataclass(frozen=True)
class CandidateRow:
    """Row of the table of decay models that were fitted.

    Attributes
    ----------
    model
        Name of the decay model.
    reduced_chi2
        Reduced χ².
    bic_above_best
        BIC less that of the best model.
    p_value
        p-value of the F-test against one state fewer.
    chosen
        Whether this model was chosen.
    """

    model: str
    reduced_chi2: str
    bic_above_best: str
    p_value: str
    chosen: bool


def state_rows(fit: FittedDecay, unit: str = "DN/s") -> list[Row]:
    """Return rows of rates, lifetimes, half-lives and amplitudes in `unit`, one column a state."""
    rates = [(state.k_r_per_s, state.k_r_per_s_sigma) for state in fit.states]
    lifetimes = [_lifetime(rate, sigma) for rate, sigma in rates]
    half_lives = [(math.log(2) * value, math.log(2) * sigma) for value, sigma in lifetimes]
    amplitudes = [(state.amplitude, state.amplitude_sigma) for state in fit.states]
    return [
        Row("Rate k_r", "s⁻¹", _value_texts(rates)),
        Row("Lifetime 1/k_r", "s", _value_texts(lifetimes)),
        Row("Half-life", "s", _value_texts(half_lives)),
        Row("Amplitude a", unit, _value_texts(amplitudes)),
    ]


def quality_rows(fit: FittedDecay, unit: str = "DN/s") -> list[Row]:
    """Return rows of what the states share: weights, offsets in `unit`, flicker and χ²."""
    rows = []
    several = len(fit.channels) > 1
    if several:
        weights = zip(fit.channels, fit.channel_weights, fit.channel_weights_sigma, strict=True)
        rows += [
            Row(f"Weight of {name}", "", ("1" if weight == 1 else plus_minus(weight, sigma),))
            for name, weight, sigma in weights
        ]
    if several and any(fit.offsets_sigma):
        offsets = zip(fit.channels, fit.offsets, fit.offsets_sigma, strict=True)
        rows += [
            Row(f"Offset of {name}", unit, (plus_minus(offset, sigma),))
            for name, offset, sigma in offsets
        ]
    else:
        rows.append(Row("Offset", unit, (plus_minus(fit.offset, fit.offset_sigma),)))
    if several or fit.flicker > 0:
        flicker = plus_minus(100 * fit.flicker, 100 * fit.flicker_sigma)
        rows.append(Row("Flicker of a frame", "%", (flicker,)))
    chi2 = f"{rounded(fit.reduced_chi2, 3)} ({fit.dof} dof)"
    return [*rows, Row("Reduced χ²", "", (chi2,))]


def reradiance_rows(fit: FittedDecay, unit: str = "DN/s") -> list[Row]:
    """Return rows of Λᵢ = aᵢ/kᵢ in each channel, assuming that every state was full: rᵢ(0) = 1.

    `unit` is that of the amplitudes; Λ has it times s.
    """
    reradiance_unit = unit.removesuffix("/s") if unit.endswith("/s") else f"{unit} s".strip()
    rows = []
    for name, weight, weight_sigma in zip(
        fit.channels, fit.channel_weights, fit.channel_weights_sigma, strict=True
    ):
        values = []
        for number, state in enumerate(fit.states):
            rate, amplitude = state.k_r_per_s, state.amplitude
            relative_covariance = (
                2 * float(fit.covariance[2 * number, 2 * number + 1]) / (rate * amplitude)
            )
            relative2 = (
                (state.k_r_per_s_sigma / rate) ** 2
                + (state.amplitude_sigma / amplitude) ** 2
                - (relative_covariance if math.isfinite(relative_covariance) else 0.0)
                + ((weight_sigma / weight) ** 2 if weight > 0 else 0.0)
            )
            value = weight * amplitude / rate
            values.append((value, value * math.sqrt(max(relative2, 0.0))))
        rows.append(Row(f"Λ in {name}", reradiance_unit, _value_texts(values)))
    return rows


def candidate_rows(fit: FittedDecay) -> list[CandidateRow]:
    """Return rows of the fits with each number of states, and of the alternative models."""
    others = [law for law in fit.compared_laws if law.name != EXPONENTIALS]
    best = fit.best_bic
    rows = [
        CandidateRow(
            model=_states_text(candidate.n_states),
            reduced_chi2=rounded(candidate.reduced_chi2, 3),
            bic_above_best=_bic_difference(candidate.bic, best),
            p_value="–" if candidate.f_p_value is None else _p_value(candidate.f_p_value),
            chosen=candidate.n_states == fit.n_states and fit.law == EXPONENTIALS,
        )
        for candidate in fit.candidates
    ]
    rows += [
        CandidateRow(
            model=f"{LAW_LABELS[law.name]}: {law.formula}",
            reduced_chi2=rounded(law.reduced_chi2, 3),
            bic_above_best=_bic_difference(best + law.bic_above_best, best),
            p_value="–",
            chosen=law.name == fit.law,
        )
        for law in others
    ]
    return rows


_NO_MORE = (
    "One more state was not asked for, or gains nothing: two of the rates merge, or an amplitude "
    "vanishes."
)


def n_states_reason(fit: FittedDecay) -> str:
    """Return the reason for the number of states in a sentence or two."""
    candidates = {candidate.n_states: candidate for candidate in fit.candidates}
    chosen = candidates.get(fit.n_states)
    fewer, more = candidates.get(fit.n_states - 1), candidates.get(fit.n_states + 1)
    sentences = []
    if chosen is not None and fewer is not None:
        gain = rounded(fewer.bic - chosen.bic, 3)
        sentences.append(f"BIC is lower by {gain} than with {_states_text(fewer.n_states)}.")
    if chosen is not None and more is not None:
        change = more.bic - chosen.bic
        verb = "raises" if change >= 0 else "lowers"
        sentences.append(f"One more state {verb} BIC by {rounded(abs(change), 3)}.")
        if more.f_p_value is not None:
            sentences.append(
                f"Chance alone gains as much in χ² with p = {_p_value(more.f_p_value)}."
            )
    if not sentences:
        others = [_states_text(number) for number in candidates if number != fit.n_states]
        sentences.append(
            f"The data do not support {' or '.join(others)}, which were asked for."
            if others
            else _NO_MORE
        )
    elif more is None:
        sentences.append(_NO_MORE)
    if fit.law != EXPONENTIALS:
        above = next(law for law in fit.compared_laws if law.name == EXPONENTIALS).bic_above_best
        sentences.append(
            f"The law of the decay is another: {LAW_LABELS[fit.law]}; exponentials have a BIC "
            f"{rounded(above, 3)} above that of the best law."
        )
    return " ".join(sentences)


def _lifetime(rate_per_s: float, sigma_per_s: float) -> tuple[float, float]:
    """Return 1/k and its σ in s; σ is infinite if 1/k has no symmetric error."""
    determined = sigma_per_s < WORST_FOR_LIFETIME * rate_per_s
    return 1 / rate_per_s, sigma_per_s / rate_per_s**2 if determined else math.inf


def _value_texts(pairs: list[tuple[float, float]]) -> tuple[str, ...]:
    """Return values with their σ as text."""
    return tuple(plus_minus(value, sigma) for value, sigma in pairs)


def _states_text(number: int) -> str:
    """Return a number of states as text."""
    return "1 state" if number == 1 else f"{number} states"


def _bic_difference(bic: float, best: float) -> str:
    """Return the difference of a BIC to the best one as text."""
    return "best" if bic == best else f"+{rounded(bic - best, 3)}"


def _p_value(p: float) -> str:
    """Return a p-value as text."""
    return "< 10⁻⁶" if p < 1e-6 else rounded(p, 2)


CAPTION = (
    "Limits by profile likelihood, all other parameters fitted anew at each value: where ± 1 σ is "
    "off by more than 20 %, or as asked for. < and >: one-sided, the data exclude nothing on the "
    "other side."
)


def interval_tables(intervals: Mapping[str, ProfileInterval]) -> tuple[Table, ...]:
    """Return the table of intervals by the name of their parameter; none without intervals."""
    if not intervals:
        return ()
    head, *rows = interval_rows(intervals)
    return (Table(("", "value", *head[2:]), tuple(tuple(row) for row in rows), CAPTION),)
