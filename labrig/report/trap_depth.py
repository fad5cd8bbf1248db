"""Page and figure of trap depths: rates over temperature."""

from collections.abc import Sequence

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.quantity import ZERO_C_K
from labrig.record import RunDescription
from labrig.report.chart import (
    Axis,
    Chart,
    ErrorBars,
    Line,
    Margins,
    Mark,
    Panel,
    Points,
    logarithmic_axis,
)
from labrig.report.figure_style import INK, MARKERS, OTHER_CHANNELS, linear_ticks
from labrig.report.page import Report
from labrig.report.sections import Picture, Section, Table
from labrig.results import StateDepth

HEIGHT_PT = 300.0
COLOURS = (INK, OTHER_CHANNELS[1], OTHER_CHANNELS[0], OTHER_CHANNELS[2])
#: Part of the range of temperatures that the axis has beyond them.
BEYOND = 0.08
CAPTION = (
    "Decay rates over the temperature of the sample, on a scale of 1/T, on which a trap of one "
    "depth is a line. Bars are ± 1 σ of the rates alone."
)
METHOD = (
    "Each line is k = s exp(−E/kT). Weights hold the σ of rates and temperatures. An error "
    "that all temperatures have in common hardly matters: E depends on their differences."
)


def trap_depth_chart(depths: Sequence[StateDepth]) -> Chart:
    """Return a chart of rates over temperature with the fitted lines.

    Parameters
    ----------
    depths
        Depths of the states of one run or more; not empty.

    Returns
    -------
    Chart
        Points with bars of ± 1 σ and lines, a colour for each state, a marker for each patch.

    Examples
    --------
    >>> from labrig.fit import fit_trap_depth
    >>> from labrig.report import trap_depth_chart
    >>> from labrig.results import StateDepth
    >>> depth = fit_trap_depth([15, 21, 27], [0.030, 0.048, 0.074], [0.001, 0.001, 0.002])
    >>> [text for _, text in trap_depth_chart([StateDepth("", 1, depth)]).panels[0].x.ticks]
    ['16', '18', '20', '22', '24', '26']
    """
    celsius = np.concatenate([each.depth.temperature_c for each in depths])
    margin = BEYOND * np.ptp(celsius)
    low, high = float(celsius.min() - margin), float(celsius.max() + margin)
    line_c = np.linspace(low, high, 60)
    patches = list(dict.fromkeys(each.patch for each in depths))
    marks: list[Mark] = []
    legend: list[tuple[str, Mark]] = []
    for each in depths:
        depth, colour = each.depth, COLOURS[(each.number - 1) % len(COLOURS)]
        at = _inverse(depth.temperature_c)
        marker = MARKERS[patches.index(each.patch) % len(MARKERS)]
        dots = Points(colour, at, depth.rate_per_s, marker=marker, size_pt=5.0)
        line = np.array([depth.rate_at(float(t_c)).value for t_c in line_c])
        marks += [
            Line(colour, _inverse(line_c), line),
            ErrorBars(colour, at, depth.rate_per_s, depth.rate_per_s_sigma),
            dots,
        ]
        legend.append((f"{each.name}, E = {depth.depth_ev}", dots))
    rates = np.concatenate([each.depth.rate_per_s for each in depths])
    ticks = tuple((_inverse_of(t_c), text) for t_c, text in linear_ticks(low, high, 8))
    x = Axis("Temperature / °C", _inverse_of(low), _inverse_of(high), ticks)
    y = logarithmic_axis("k_r / s⁻¹", float(rates.min()) / 1.6, float(rates.max()) * 1.6)
    panel = Panel(x, y, tuple(marks), Margins(top=30.0))
    return Chart((panel,), HEIGHT_PT, legend=tuple(legend), columns=min(len(legend), 2))


def trap_depth_report(depths: Sequence[StateDepth], about: RunDescription) -> Report:
    """Return the page of trap depths.

    Parameters
    ----------
    depths
        Depths of the states; not empty.
    about
        Description of what they were made of.

    Returns
    -------
    Report
        A page with the figure, a table and the warnings.

    Examples
    --------
    >>> from labrig.fit import fit_trap_depth
    >>> from labrig.process import describe_without_run
    >>> from labrig.report import trap_depth_report
    >>> from labrig.results import StateDepth
    >>> depth = fit_trap_depth([15, 21, 27], [0.030, 0.048, 0.074], [0.001, 0.001, 0.002])
    >>> about = describe_without_run("Trap depths", "trap_depth", "", ())
    >>> trap_depth_report([StateDepth("", 1, depth)], about).sections[0].tables[0].rows[0][1]
    '0.560(33)'
    """
    head = ("state", "E / eV", "log₁₀(s / s⁻¹)", "k_r / s⁻¹", "at / °C", "p")
    rows = tuple(
        (
            each.name,
            str(each.depth.depth_ev).removesuffix(" eV"),
            str(each.depth.log10_frequency),
            str(each.depth.rate_at(each.depth.reference_c)).removesuffix(" 1/s"),
            f"{each.depth.reference_c:.1f}",
            "–" if each.depth.dof == 0 else f"{each.depth.p_value:.2g}",
        )
        for each in depths
    )
    section = Section(
        "Trap depths",
        (METHOD,),
        figures=(Picture("rates-over-temperature", trap_depth_chart(depths), CAPTION),),
        tables=(Table(head, rows, "σ in units of the last places; p of the misfit."),),
    )
    warnings = tuple(warning.about(each.name) for each in depths for warning in each.depth.warnings)
    return Report(about, warnings, (section,))


def _inverse_of(celsius: float) -> float:
    return -1 / (celsius + ZERO_C_K)


def _inverse(celsius: FloatArray) -> FloatArray:
    """Return −1/T in 1/K, which rises with the temperature."""
    return np.asarray(-1 / (celsius + ZERO_C_K))
