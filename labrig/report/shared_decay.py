"""Page of several tables that were fitted with shared rates."""

from collections.abc import Sequence

import numpy as np

from labrig.record import RunDescription
from labrig.report.chart import (
    Chart,
    ErrorBars,
    Line,
    Mark,
    Panel,
    Points,
    linear_axis,
    logarithmic_axis,
)
from labrig.report.figure_style import INK, MARKERS, OTHER_CHANNELS
from labrig.report.page import Report
from labrig.report.sections import Picture, Section, Table
from labrig.results import Series, SharedDecay

HEIGHT_PT = 300.0
#: Decades of relative signal that are shown at most, and number of points of a curve.
MAX_DECADES, POINTS = 5.0, 160


def shared_decay_report(
    fit: SharedDecay, series: Sequence[Series], about: RunDescription
) -> Report:
    """Return the report of several tables with shared rates.

    Parameters
    ----------
    fit
        The fit.
    series
        Series of each table, in the order of `fit.tables`.
    about
        Description of the tables.

    Returns
    -------
    Report
        Rates, amplitudes and the figure of all tables.

    Examples
    --------
    >>> import numpy as np
    >>> import labrig
    >>> from dataclasses import replace
    >>> from labrig.fit import DecayTable, fit_shared_rates
    >>> from labrig.process import describe_without_run
    >>> from labrig.report import shared_decay_report
    >>> [decay] = labrig.read_series("series.csv")
    >>> green = replace(
    ...     decay, values=decay.values[:, 1:2], sigma=decay.sigma[:, 1:2],
    ...     dark_sigma=decay.dark_sigma[1:2], channels=("G",)
    ... )
    >>> tables = [
    ...     DecayTable(name, green.t_s, green.exposure_s, green.values[:, 0], green.sigma[:, 0])
    ...     for name in ("one", "two")
    ... ]
    >>> about = describe_without_run("two tables", "decay", "one.csv, two.csv", ())
    >>> report = shared_decay_report(fit_shared_rates(tables, 2), [green, green], about)
    >>> [section.title for section in report.sections]
    ['Shared rates', 'Decays', 'How it was found']
    """
    head, *rows = fit.rate_rows()
    rates = Table(tuple(head), tuple(map(tuple, rows)), "Digits in brackets are σ, 1 σ.")
    head, *rows = fit.table_rows()
    amplitudes = Table(
        tuple(head),
        tuple(map(tuple, rows)),
        "Amplitudes and offsets in the unit of each table's values.",
    )
    found = (
        "All tables were fitted together by weighted nonlinear least squares: Σ aᵢ exp(−kᵢ t) + b "
        "with rates kᵢ that are the same in all tables, amplitudes aᵢ ≥ 0 and offset b of each "
        "table's own. σ of rates and amplitudes are from one covariance.",
    )
    return Report(
        about,
        fit.warnings,
        (
            Section("Shared rates", tables=(rates, amplitudes)),
            Section(
                "Decays",
                figures=(
                    Picture(
                        "decays",
                        _figure(fit, series),
                        "Signals without offset over that of the fit at the first row, with ± 1 σ; "
                        "lines are the fit.",
                    ),
                ),
            ),
            Section("How it was found", points=found),
        ),
        (),
    )


def _figure(fit: SharedDecay, series: Sequence[Series]) -> Chart:
    """Return all decays, each relative to its first signal and from its first row."""
    marks: list[Mark] = []
    legend: list[tuple[str, Mark]] = []
    longest, lowest, highest = 0.0, 1.0, 1.0
    for number, (table, part) in enumerate(zip(fit.tables, series, strict=True)):
        colour = OTHER_CHANNELS[number % len(OTHER_CHANNELS)]
        marker = MARKERS[number % len(MARKERS)]
        rows = np.flatnonzero(part.usable)
        t_s, exposure_s = part.t_s[rows], part.exposure_s[rows]
        first_s, last_s = float(t_s.min()), float(t_s.max())
        at_s = np.linspace(first_s, last_s, POINTS)
        curve = table.predict(at_s, np.zeros(POINTS)) - table.offset
        first = float(curve[0]) or 1.0
        values = (part.values[rows, 0] - table.offset) / first
        sigma = np.nan_to_num(part.sigma[rows, 0]) / first
        after_s = t_s + exposure_s / 2 - first_s
        shown = values > 10.0**-MAX_DECADES
        marks += [
            ErrorBars(colour, after_s[shown], values[shown], sigma[shown]),
            Points(colour, after_s[shown], values[shown], marker, size_pt=3.2),
            Line(INK, at_s - first_s, curve / first, width_pt=0.9),
        ]
        legend.append((table.name, Points(colour, marker=marker, size_pt=5.0)))
        longest = max(longest, last_s - first_s)
        lowest = min(lowest, float(values[shown].min(initial=1.0)))
        highest = max(highest, float(values.max()))
    panel = Panel(
        linear_axis("Time after the first row / s", -0.02 * longest, 1.03 * longest),
        logarithmic_axis("Relative signal", max(0.7 * lowest, 1e-5), 1.5 * highest),
        tuple(marks),
    )
    return Chart((panel,), HEIGHT_PT, legend=tuple(legend), columns=4)
