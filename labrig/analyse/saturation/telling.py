"""What decays after several charges say: lines, warnings, the section of the report."""

from typing import Protocol

import numpy as np

from labrig.analyse.saturation.figures import decays_figure, plateau_figure
from labrig.analyse.saturation.found import Saturation
from labrig.quantity import duration_text
from labrig.report.sections import Picture, Section, Table
from labrig.written_numbers import plus_minus, rounded

#: Where a longer charge brightens the glow by less, the plateau is reached.
PLATEAU = 0.02
SIGMAS = 2.0


class WeakerLight(Protocol):
    """As the protocol says it."""

    share: float
    share_sigma: float


def lines(found: Saturation) -> list[str]:
    """Saturation in time, in level, and the rates."""
    begin, end = (f"{_percent(growth)} ± {_percent(sigma)}" for growth, sigma in _growth(found))
    shorter, longer = (duration_text(float(charge)) for charge in found.charges_s["full"][-2:])
    told = [
        f"from {shorter} to {longer} of charge the glow changes by {begin} at lamp off, {end} at "
        f"the end of the decay: {_in_time(found)}"
    ]
    told += [
        f"state {number} (k = {rounded(float(k), 3)} s⁻¹): r(0) = {plus_minus(one.r, one.sigma)}; "
        f"r(0) = 1 may be believed: {one.verdict}"
        for number, (one, k) in enumerate(
            zip(found.levels, found.test.shared_per_s, strict=False), start=1
        )
    ]
    if not found.levels:
        told.append(
            "r(0): nothing can be said without a weaker light; saturation in time is none in level"
        )
    return [*told, _rates_text(found)]


def verdicts(found: Saturation) -> list[str]:
    """Warnings."""
    told = []
    if _in_time(found) == "not saturated":
        told.append(
            "the glow still grows at the longest charge: charge for longer before decays whose "
            "amplitudes are to be compared"
        )
    if any(one.verdict == "no" for one in found.levels):
        said = ", ".join(plus_minus(one.r, one.sigma) for one in found.levels)
        told.append(
            f"r(0) = 1 does not hold after the longest charge: r(0) = {said}; Λ from the decay "
            "alone would be too small by that factor, in each state by another: fit excitation "
            "and decay jointly"
        )
    if found.test.differ:
        told.append(
            f"the rates depend on the charge (p = {found.test.p_value:.2g}): the decay is no sum "
            f"of {found.fit.n_states} exponentials of fixed rates, as power laws are none; what "
            "was found holds for the charge it was measured at"
        )
    return told


def section(name: str, found: Saturation, weaker: WeakerLight | None) -> Section:
    """Of the report."""
    text = [*lines(found)]
    if weaker is not None:
        text.append(
            f"The weaker light was {weaker.share:.0%} of the full one (σ {weaker.share_sigma:.0%} "
            "of that). From the ratio of the amplitudes follows κ/k of each state, and r(0), "
            "whatever Λ and the camera's scale are."
        )
    text.append(
        "Rates are compared by an F-test of all decays with shared against each with its own "
        "rates, amplitudes always their own."
    )
    return Section(
        f"Saturation: {name}",
        tuple(f"{line[0].upper()}{line[1:]}." if line[-1] != "." else line for line in text),
        (
            Picture(
                f"plateaus-{name}",
                plateau_figure(found.charges_s, found.amplitude, found.sigma),
                "Amplitude of each state at lamp off over the length of the charge; bars: 1 σ.",
            ),
            Picture(
                f"charges-{name}",
                decays_figure(found.curves, found.test),
                "Decays after different charges over their begin, and what shared rates leave of "
                "them in σ.",
            ),
        ),
        (_rates_table(found),),
    )


def _growth(found: Saturation) -> list[tuple[float, float]]:
    """Of the glow between the last two charges under the full light, at the begin and the end of
    their decays, where slow states show; each with its σ.
    """
    before, last = [one for unit, one in found.curves.items() if unit.startswith("full")][-2:]
    count = min(len(before.value), len(last.value))
    ratio = last.value[:count] / before.value[:count]
    sigma = np.abs(ratio) * np.hypot(
        last.sigma[:count] / last.value[:count], before.sigma[:count] / before.value[:count]
    )
    part = max(count // 4, 1)
    growths = []
    for rows in (slice(None, part), slice(-part, None)):
        weight = 1 / sigma[rows] ** 2
        mean = float(weight @ ratio[rows] / weight.sum())
        growths.append((mean - 1, float(1 / np.sqrt(weight.sum()))))
    return growths


def _percent(share: float) -> str:
    return f"{share:.1%}".replace("-", "−")


def _in_time(found: Saturation) -> str:
    growths = _growth(found)
    if any(growth - SIGMAS * sigma > PLATEAU for growth, sigma in growths):
        return "not saturated"
    if all(growth + SIGMAS * sigma < 2 * PLATEAU for growth, sigma in growths):
        return "saturated in time"
    return "not decided"


def _rates_text(found: Saturation) -> str:
    test = found.test
    if test.misfit and not test.differ:
        return (
            f"rates: nothing can be said, {found.fit.n_states} exponential(s) do not describe the "
            f"decays (reduced χ² {test.chi2_own / test.dof_own:.3g} with own rates)"
        )
    said = "differ with" if test.differ else "are the same after"
    return (
        f"rates {said} all {len(found.curves)} charges: shared rates cost χ² "
        f"{test.chi2_shared - test.chi2_own:.3g} (reduced χ² {test.chi2_own / test.dof_own:.3g} "
        f"with own rates), p = {test.p_value:.2g}"
    )


def _rates_table(found: Saturation) -> Table:
    test = found.test
    states = range(len(test.shared_per_s))
    rows = [
        (
            unit,
            *(plus_minus(test.own_per_s[row, n], test.own_sigma_per_s[row, n]) for n in states),
        )
        for row, unit in enumerate(found.curves)
    ]
    shared = ("shared", *(rounded(float(k)) for k in test.shared_per_s))
    head = ("decay", *(f"k{number + 1} / s⁻¹" for number in states))
    return Table(head, (*rows, shared))
