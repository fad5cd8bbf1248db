"""Figures of decays on the page of the validation."""

import math
import re

from tests.acceptance.printed import columns, match, span
from tests.acceptance.quote import EXPLANATION, VALIDATION, Quote

PAGE = f"{VALIDATION}/decays.md"


def _rms(case: str, printed: str) -> list[float]:
    """Return the rms of the pulls of each rate, of all cases whose name matches."""
    rows = re.findall(rf"^{case} .*; rms ([\d., ]+);", printed, re.M)
    if not rows:
        raise ValueError(f"not in the output: {case}")
    return [float(value) for row in rows for value in row.split(", ")]


def _correlated(printed: str) -> str:
    def rms(values: str) -> str:
        return span(_rms(rf"flicker, ρ = 0\.8, .*, (?:{values}) values, .*", printed), 1)

    independent = span(_rms(r"flicker, ρ = 0\.0, .*", printed), 1)
    return (
        f"Of tables with a correlation of 0.8 the pulls have an rms of {rms('120')} with 120 "
        f"values, {rms('40|60')} with 40 and 60, and {rms('20')} with 20, which hardly "
        f"distinguish a drift from the decay; of independent noise it is {independent}"
    )


def _wrong_sigma(printed: str) -> str:
    def row(name: str, kind: str, factors: tuple[str, ...]) -> str:
        cases = [f"σ times {factor}, {kind}" for factor in factors]
        both = (math.hypot(*_rms(case, printed)) / math.sqrt(2) for case in cases)
        said = (match(rf"^{case} .* (\d+) % say so", printed) for case in cases)
        of_it = "as it is" if factors == ("1",) else f"{', '.join(factors)} times it"
        pulls = ", ".join(f"{value:.1f}" for value in both)
        return f"| {name}, {of_it} | {pulls} | {', '.join(said)} % |"

    kinds = {"constant": "constant", "as the root of the signal": "root"}
    return "\n".join(
        row(name, kind, factors)
        for factors in (("0.1", "0.3", "0.5"), ("1",), ("2", "5"))
        for name, kind in kinds.items()
    )


def _hidden(printed: str) -> str:
    def silent(rates: str) -> str:
        row = rf"^3 states 0\.5/{rates} +share +8 %.* without a warning +([\d.]+) %"
        return f"{float(match(row, printed)):g} %"

    ((*beyond_stated,),) = columns(r"what is stated +([\d.]+) %", printed)
    return (
        f"beside 0.08 and 0.015 s⁻¹, {silent('0.08/0.015')} are off by more than 3 σ without a "
        f"warning; beside 0.1 and 0.02 s⁻¹ {silent('0.1/0.02')}, and beside 0.2 and 0.02 s⁻¹, "
        f"where the fastest state found is itself hardly resolved, {silent('0.2/0.02')}. Of all "
        f"shares from 0 to 15 % and all rates at most {max(beyond_stated):g} % are off by more "
        "than 3 σ and what is stated"
    )


def _laws(printed: str) -> str:
    ((*right,),) = columns(r"^(?:two rates|general order|one trap).*right +([\d.]+) %", printed)
    ((*table_1,),) = columns(r"^(?:\w+-paint|bottle|gloves|stickers) .*right +([\d.]+) %", printed)
    return (
        f"that is right in {span(right)} % of decays of two states, of general order 1.5 to 3 and "
        f"of one trap, and in {span(table_1)} % of those of Table 1"
    )


def _example(printed: str) -> str:
    def bic(model: str) -> str:
        return match(rf"^{model}: BIC (\d+)", printed)

    flicker, sigma = columns(r"^flicker +([\d.]+)\((\d+)\) %", printed)
    return (
        f"a flicker of {flicker[0]:.2f} ± {sigma[0] / 100:.2f} %. The BIC of two exponentials is "
        f"{bic('2 exponentials')}; three have {bic('3 exponentials')} (F-test: p = "
        f"{float(match(r'^3 exponentials.* p = ([0-9.]+)', printed)):.2f}), one has "
        f"{bic('1 exponentials')}, the stretched exponential {bic('stretched')} and Becquerel's "
        f"law {bic('becquerel')}. Without flicker in the data the σ of the faster rate is "
        f"{float(match(r'is ([0-9.]+) times smaller', printed)):.1f} times smaller"
    )


def _example_rates(printed: str) -> str:
    fast, slow = (match(rf"^{state} +([\d.]+\(\d+\))", printed) for state in (1, 2))
    return f"The fit finds two states, {fast} and {slow} per second"


def _beating(printed: str) -> str:
    def wrong(states: int, spacing: str) -> str:
        return match(rf"^{states} +{spacing} +sine 5\.1 s +([\d.]+)", printed)

    decays = match(r"^(\d+) decays a line", printed)
    return (
        f"Over {decays} decays each, with a sine of 0.7 % and 5.1 s, frames every 5 s have the "
        f"rate of one state wrong by more than 3 σ in {wrong(1, 'even')} % where they are even and "
        f"in {wrong(1, 'random')} % where they are random, and a rate of two states in "
        f"{wrong(2, 'even')} % and {wrong(2, 'random')} %"
    )


QUOTES = (
    Quote(PAGE, "tables_that_drift", _correlated),
    Quote(PAGE, "beating_flicker", _beating),
    Quote(PAGE, "tables_of_wrong_sigma", _wrong_sigma),
    Quote(PAGE, "decay_states_that_hide", _hidden),
    Quote(PAGE, "law_confusion", _laws),
    Quote(f"{EXPLANATION}/decay_fit.md", "decay_fit_example", _example_rates),
    Quote(f"{EXPLANATION}/decay_fit.md", "decay_fit_example", _example),
)
