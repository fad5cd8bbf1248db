"""Report of saturation: plateaus of the glow, levels of charge, and rates after each charge."""

from collections.abc import Iterator
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from labrig.foundation.number_format import plus_minus, rounded
from labrig.foundation.quantity import duration_text
from labrig.protocols.saturation.result import (
    FULL_LIGHT,
    LIGHTS,
    OrderTest,
    PatchSaturation,
    RatesTest,
    SaturationResult,
)
from labrig.report.figure_style import (
    DASHED,
    INK,
    LEFT_PT,
    MARKERS,
    MUTED,
    OTHER_CHANNELS,
    PAPER,
    error_bars,
    legend_above,
    line_entry,
    mark_decades,
    marker_entry,
    new_figure,
    place,
    points,
)
from labrig.report.sections import Picture, Rendered, Section, Source, Table
from labrig.results import Measured


def render(result: SaturationResult, source: Source) -> Rendered:
    """Render the saturation of every patch in time and in level, and its rates."""
    several = len(result.patches) > 1
    lines = (
        f"{name}: {line}" if several else line
        for name, patch in result.patches.items()
        for line in _lines(patch)
    )
    sections = (
        _section(name, patch, result.weaker_light) for name, patch in result.patches.items()
    )
    return Rendered(tuple(sections), tuple(lines))


def _lines(patch: PatchSaturation) -> Iterator[str]:
    """Yield the lines on saturation in time, saturation in level, and rates."""
    begin, end = (
        f"{_percent(growth.value)} ± {_percent(growth.sigma)}"
        for growth in (patch.growth_at_begin, patch.growth_at_end)
    )
    last = patch.rows(FULL_LIGHT)[-2:]
    shorter, longer = (duration_text(float(patch.charge_s[row])) for row in last)
    yield (
        f"from {shorter} to {longer} of charge the glow changes by {begin} at lamp off, {end} at "
        f"the end of the decay: {patch.time_saturation}"
    )
    states = zip(patch.levels, patch.rates.shared_per_s, strict=False)
    for number, (level, k_per_s) in enumerate(states, start=1):
        yield (
            f"state {number} (k = {rounded(float(k_per_s), 3)} s⁻¹): r(0) = "
            f"{plus_minus(level.r, level.sigma)}; assumption r(0) = 1: {level.assessment}"
        )
    if not patch.levels:
        yield ("r(0): not determined without a weaker light; saturation in time is none in level")
    yield _rates_text(patch)
    if patch.order is not None:
        yield _order_text(patch.order, is_reported=patch.is_of_general_order)


def _order_text(test: OrderTest, *, is_reported: bool) -> str:
    """Return the verdict on a kinetic order above 1, which other states may describe better."""
    shape, shift = (plus_minus(each.value, each.sigma) for each in (test.shape, test.shift))
    verdict = {
        "first order": "no sign of a kinetic order above 1: it does not depend on the charge",
        "general order": (
            f"as of a state of kinetic order {test.order}"
            if is_reported
            else "it depends on the charge as that of states of first order, filled unequally"
        ),
        "neither": "it depends on the charge, but not as that of a state of one kinetic order",
        "not decided": "a kinetic order is not decided; compare charges that differ more",
    }[test.verdict]
    return (
        f"fall of the glow at lamp off: {verdict} (exponent {shift} by the charge, {shape} by the "
        f"shape of the decays, reduced χ² {test.reduced_chi2:.3g})"
    )


def _rates_text(patch: PatchSaturation) -> str:
    """Return the outcome of the test whether all decays have the same rates."""
    test = patch.rates
    if test.misfit and not test.differ:
        return (
            f"rates: not determined, {patch.fit.n_states} exponential(s) do not describe the "
            f"decays (reduced χ² {test.chi2_own / test.dof_own:.3g} with own rates)"
        )
    verb = "differ with" if test.differ else "are the same after"
    return (
        f"rates {verb} all {len(patch.curves)} charges: shared rates cost χ² "
        f"{test.chi2_shared - test.chi2_own:.3g} (reduced χ² {test.chi2_own / test.dof_own:.3g} "
        f"with own rates), p = {test.p_value:.2g}"
    )


def _section(name: str, patch: PatchSaturation, weaker: Measured | None) -> Section:
    """Return the section of a patch; `weaker` is the weaker light as fraction of the full one."""
    text = [*_lines(patch)]
    if weaker is not None:
        text.append(
            f"The weaker light was {weaker.value:.0%} of the full one (σ "
            f"{weaker.sigma / weaker.value:.0%} of that). From the ratio of the amplitudes follows "
            "κ/k of each state, and r(0), whatever Λ and the camera's scale are."
        )
    text.append(
        "Rates are compared by an F-test of all decays with shared against each with its own "
        "rates, amplitudes always their own."
    )
    order = () if patch.order is None else (_order_picture(name, patch.order),)
    return Section(
        f"Saturation: {name}",
        tuple(f"{line[0].upper()}{line[1:]}." if line[-1] != "." else line for line in text),
        (
            Picture(
                f"plateaus-{name}",
                partial(_plateau_figure, patch),
                "Amplitude of each state at lamp off over the length of the charge; bars: 1 σ.",
            ),
            Picture(
                f"charges-{name}",
                partial(_decays_figure, patch),
                "Decays after different charges over their start, and their residuals with shared "
                "rates, in σ.",
            ),
            *order,
        ),
        (_rates_table(patch.rates, tuple(patch.curves)),),
    )


def _order_picture(name: str, test: OrderTest) -> Picture:
    return Picture(
        f"order-{name}",
        partial(_order_figure, test),
        "Relative fall of the glow at lamp off over the glow there, one point a decay; bars: 1 σ. "
        "Solid: the power of the glow that fits; dashed: no dependence, as of first order.",
    )


def _percent(fraction: float) -> str:
    """Return a fraction in per cent as text."""
    return f"{fraction:.1%}".replace("-", "−")


def _rates_table(test: RatesTest, units: tuple[str, ...]) -> Table:
    """Return the table of the rates of each decay and of the shared rates."""
    states = range(len(test.shared_per_s))
    rows = (
        (
            unit,
            *(plus_minus(test.own_per_s[row, n], test.own_sigma_per_s[row, n]) for n in states),
        )
        for row, unit in enumerate(units)
    )
    shared = ("shared", *(rounded(float(k)) for k in test.shared_per_s))
    head = ("Decay", *(f"k_r {number + 1} / s⁻¹" for number in states))
    return Table(head, (*rows, shared))


def _plateau_figure(patch: PatchSaturation) -> Figure:
    """Draw the amplitude of every state over the length of the charge, by light."""
    figure = new_figure(256.0)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=30)
    entries = []
    lights = [light for light in LIGHTS if light in patch.light]
    for style, light in zip(("-", DASHED), lights, strict=False):
        rows = patch.rows(light)
        minutes = patch.charge_s[rows] / 60
        is_full = light == FULL_LIGHT
        entries.append(line_entry(f"{light} light", MUTED, style))
        for state in range(patch.rates.amplitude.shape[1]):
            colour, marker = _colour_and_marker(state)
            y, sigma = (
                column[rows, state]
                for column in (patch.rates.amplitude, patch.rates.amplitude_sigma)
            )
            axes.plot(minutes, y, color=colour, linestyle=style, linewidth=1.0)
            error_bars(axes, minutes, y, sigma, colour)
            points(axes, minutes, y, marker, colour, colour if is_full else PAPER)
            if is_full:
                entries.append(marker_entry(f"state {state + 1}", marker, colour))
    axes.set_xlim(0, None)
    axes.set_ylim(0, None)
    axes.set_xlabel("Charge / min")
    axes.set_ylabel("Amplitude / (DN/s)")
    legend_above(figure, entries, columns=5)
    return figure


def _order_figure(test: OrderTest) -> Figure:
    """Draw the rate at lamp off over the light there, and the power law through it."""
    figure = new_figure(256.0)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=12)
    error_bars(axes, test.light, test.rate_per_s, test.rate_per_s_sigma, INK)
    points(axes, test.light, test.rate_per_s, MARKERS[0], INK, INK)
    middle = float(np.exp(np.log(test.rate_per_s).mean()))
    light = np.geomspace(test.light.min(), test.light.max(), 64)
    power = (light / np.exp(np.log(test.light).mean())) ** test.shift.value
    axes.plot(light, middle * power, color=INK, linewidth=1.0)
    axes.axhline(middle, color=MUTED, linewidth=1.0, linestyle=DASHED)
    axes.set_xlim(0, None)
    axes.set_ylim(0, None)
    axes.set_xlabel("Glow at lamp off / (DN/s)")
    axes.set_ylabel("Relative fall / s⁻¹")
    return figure


def _decays_figure(patch: PatchSaturation) -> Figure:
    """Draw the decays, normalised to the fit with shared rates at lamp off, and their residuals."""
    figure = new_figure(320.0)
    upper = place(figure, left=LEFT_PT, bottom=150, right=12, top=46)
    lower = place(figure, left=LEFT_PT, bottom=38, right=12, top=190, share_x=upper)
    upper.set_yscale("log", nonpositive="clip")
    entries, lowest = [], np.inf
    for number, (name, curve) in enumerate(patch.curves.items()):
        colour, marker = _colour_and_marker(number)
        begin_signal = float(patch.rates.amplitude[number].sum())
        middle_s = curve.t_s + curve.exposure_s / 2
        points(upper, middle_s, curve.value / begin_signal, marker, colour, colour, size=3.0)
        points(lower, middle_s, patch.rates.residuals[number], marker, colour, colour, size=3.0)
        entries.append(marker_entry(name, marker, colour))
        smallest = float(np.min(curve.value[curve.value > 0], initial=np.inf))
        lowest = min(lowest, smallest / begin_signal)
    upper.set_ylim(max(lowest / 1.5, 1e-5), 1.5)
    mark_decades(upper)
    lower.axhline(0, color=MUTED, linewidth=0.9)
    upper.set_ylabel("Over begin")
    lower.set_ylabel("Residual / σ")
    lower.set_xlabel("Time after lamp off / s")
    upper.tick_params(labelbottom=False)
    legend_above(figure, entries, columns=3)
    return figure


def _colour_and_marker(number: int) -> tuple[str, str]:
    """Return colour and marker of the series with index `number`."""
    colours = (INK, *OTHER_CHANNELS)
    return colours[number % len(colours)], MARKERS[number % len(MARKERS)]
