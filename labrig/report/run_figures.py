"""Figures about the run as a whole: all patches side by side, and whether frames came on time."""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator

from labrig.report.content import PatchReport
from labrig.report.decay_figures import (
    TIME_LABEL,
    log_axis_ends,
)
from labrig.report.figure_style import (
    INK,
    LEFT_PT,
    MARKERS,
    MUTED,
    OTHER_CHANNELS,
    channel_colour,
    new_figure,
    place,
)
from labrig.report.fitted_curve import fitted_curve, middles_s
from labrig.report.legend import legend_above, marked
from labrig.report.log_axis import mark_decades
from labrig.report.timing import FrameTiming
from labrig.results import FittedDecay
from labrig.written_numbers import rounded

SMALL_WIDTH_PT, SMALL_HEIGHT_PT = 190.0, 140.0
SMALL_FONT_PT = 9.5
TIMING_HEIGHT_PT = 200.0


def overview_figures(patches: Sequence[PatchReport]) -> list[Callable[[], Figure]]:
    """What draws a small logarithmic decay for each patch, all with the same axes."""
    ends = [log_axis_ends(patch.series) for patch in patches]
    low, high = min(end[0] for end in ends), max(end[1] for end in ends)
    last_s = max(float(middles_s(patch.series).max()) for patch in patches) or 1.0
    return [partial(_small_decay, patch, low, high, last_s) for patch in patches]


def _small_decay(patch: PatchReport, low: float, high: float, last_s: float) -> Figure:
    figure = new_figure(SMALL_HEIGHT_PT, SMALL_WIDTH_PT)
    axes = place(figure, left=50, bottom=32, right=14, top=6)
    axes.set_yscale("log", nonpositive="clip")
    axes.set_ylim(low, high)
    axes.set_xlim(-0.03 * last_s, 1.03 * last_s)
    axes.xaxis.set_major_locator(MaxNLocator(4))
    mark_decades(axes, most=6)
    axes.tick_params(labelsize=SMALL_FONT_PT, pad=2)
    axes.set_xlabel("Time / s", fontsize=SMALL_FONT_PT)
    axes.set_ylabel("DN/s", fontsize=SMALL_FONT_PT)
    series = patch.series
    curve = fitted_curve(series, patch.fit) if isinstance(patch.fit, FittedDecay) else None
    for number, name in enumerate(series.channels):
        colour = channel_colour(name, number)
        axes.plot(
            middles_s(series)[series.usable],
            series.values[series.usable, number],
            linestyle="none",
            marker=MARKERS[number % len(MARKERS)],
            markersize=2.2,
            markeredgewidth=0,
            color=colour,
        )
        if curve is not None:
            axes.plot(curve.t_s, curve.total[:, number], color=colour, linewidth=0.9)
    return figure


def timing_figure(timings: Sequence[FrameTiming]) -> Figure:
    """How much later than planned each exposure began, one mark a frame, one colour a unit."""
    units = list(dict.fromkeys(timing.unit for timing in timings))
    several = 1 < len(units) <= len(MARKERS)
    figure = new_figure(TIMING_HEIGHT_PT)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=46 if several else 14)
    axes.axhline(0, color=MUTED, linewidth=0.8)
    entries = []
    for number, unit in enumerate(units):
        of_unit = [timing for timing in timings if timing.unit == unit]
        marker = MARKERS[number % len(MARKERS)]
        colour = INK if number == 0 else OTHER_CHANNELS[number % len(OTHER_CHANNELS)]
        entries.append(marked(unit, marker, colour))
        axes.plot(
            [timing.t_s for timing in of_unit],
            [1e3 * timing.late_s for timing in of_unit],
            linestyle="none",
            marker=marker,
            markersize=3.6,
            color=colour,
        )
    late_ms = np.array([1e3 * timing.late_s for timing in timings])
    reach = max(float(np.abs(late_ms).max()), 0.1)
    axes.set_ylim(min(float(late_ms.min()) * 1.15, -0.08 * reach), 1.15 * reach)
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: rounded(value)))
    axes.set_xlabel(TIME_LABEL)
    axes.set_ylabel("Late by / ms")
    if several:
        legend_above(figure, entries, columns=4)
    return figure
