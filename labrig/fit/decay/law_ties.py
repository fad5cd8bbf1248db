"""Laws that describe a decay about as well as the one that was taken, and predict otherwise."""

from collections.abc import Sequence

import numpy as np

from labrig.foundation.detection import STRONG_EVIDENCE_DELTA_BIC
from labrig.foundation.number_format import rounded
from labrig.results import (
    EXPONENTIALS,
    LAW_LABELS,
    RATE_SPECTRUM,
    ComparedLaw,
    FittedDecay,
)

#: Difference in BIC from which the data support the shape of a law beside one exponential, which is
#: the limit of every law: odds of e² = 7 : 1. At half of that, one clean decay in a hundred had a
#: tie.
SUPPORTED_BIC = 4.0
#: Difference of two laws at the end of a forecast, in their σ, from which it matters which holds.
#: A law that contains the other one, as one trap does the exponential, differs by less.
MATTERS_SIGMAS = 3.0
#: Part of the signal where amplitudes hold below which it does not matter whether rates are spread.
DARKNESS = 1e-4
#: Relative difference of a spectrum's forecast from which it matters: two states that are close
#: together differ from it by less.
SPREAD_MATTERS = 1 / 3


def tie_warnings(fit: FittedDecay) -> list[str]:
    """Return a warning if laws that the data do not tell from the one taken predict otherwise."""
    compared = {law.name: law for law in fit.compared_laws}
    taken = compared.pop(fit.law)
    ties = [
        law for law in compared.values() if _is_close(fit, taken, law) and _differs(fit, law.name)
    ]
    if not ties:
        return []
    at_s = fit.forecast_until_s - fit.reference.t_s
    signals = [_signal(fit, law.name)[0] for law in (taken, *ties)]
    lowest = max(min(signals), np.finfo(float).tiny)
    return [
        f"the data do not tell {_name(fit, taken)} from {_names(fit, ties)} (ΔBIC below "
        f"{STRONG_EVIDENCE_DELTA_BIC:.0f}): at {at_s:.3g} s they differ by a factor of "
        f"{rounded(max(signals) / lowest, 2)}; record longer, or take more light at first"
    ]


def _is_close(fit: FittedDecay, taken: ComparedLaw, other: ComparedLaw) -> bool:
    difference = other.bic_above_best - taken.bic_above_best
    is_limit = fit.law == EXPONENTIALS and fit.n_states == 1
    return (
        -STRONG_EVIDENCE_DELTA_BIC
        < difference
        < (-SUPPORTED_BIC if is_limit else STRONG_EVIDENCE_DELTA_BIC)
    )


def _signal(fit: FittedDecay, law: str) -> tuple[float, float]:
    return _signal_at(fit.forecast_until_s, fit, law)


def _signal_at(t_s: float, fit: FittedDecay, law: str) -> tuple[float, float]:
    value, variance = fit.signal(np.array([t_s]), np.zeros(1), law)
    return float(value[0]), float(variance[0])


def _differs(fit: FittedDecay, law: str) -> bool:
    own, own_variance = _signal(fit, fit.law)
    other, variance = _signal(fit, law)
    if law == RATE_SPECTRUM:
        # What it has beyond the record hardly constrains: the law taken would have to hold it.
        variance = (DARKNESS * _signal_at(fit.reference.t_s, fit, fit.law)[0]) ** 2
        if abs(own - other) < SPREAD_MATTERS * min(own, other):
            return False
    return bool(abs(own - other) > MATTERS_SIGMAS * np.sqrt(own_variance + variance))


def _name(fit: FittedDecay, law: ComparedLaw) -> str:
    if law.name != EXPONENTIALS:
        return LAW_LABELS[law.name]
    return f"{fit.n_states} exponential{'s' if fit.n_states > 1 else ''}"


def _names(fit: FittedDecay, laws: Sequence[ComparedLaw]) -> str:
    return " or ".join(_name(fit, law) for law in laws)
