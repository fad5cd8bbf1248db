"""Charts as figures of matplotlib, for PDF."""

from dataclasses import asdict

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from labrig.report.chart import Band, Chart, ErrorBars, Mark, Panel, Points
from labrig.report.figure_style import (
    SMALL_PT,
    band_entry,
    error_bars,
    legend_above,
    line_entry,
    marker_entry,
    new_figure,
    place,
    points,
    set_ticks,
)


def chart_figure(chart: Chart) -> Figure:
    """Draw a chart with matplotlib, within `figure_style`."""
    figure = new_figure(chart.height_pt, chart.width_pt)
    for panel in chart.panels:
        axes = place(figure, **asdict(panel.margins))
        _set_axes(axes, panel, chart)
        # Above the grid, in the order of the chart.
        for number, mark in enumerate(panel.marks, start=2):
            draw_mark(axes, mark, number)
    if chart.legend:
        legend_above(figure, [_entry(label, mark) for label, mark in chart.legend], chart.columns)
    return figure


def _set_axes(axes: Axes, panel: Panel, chart: Chart) -> None:
    """Set limits, ticks and labels."""
    if panel.x.is_logarithmic:
        axes.set_xscale("log")
    axes.set_xlim(panel.x.low, panel.x.high)
    if panel.y.is_logarithmic:
        axes.set_yscale("log", nonpositive="clip")
    axes.set_ylim(panel.y.low, panel.y.high)
    set_ticks(axes.xaxis, panel.x.ticks)
    set_ticks(axes.yaxis, panel.y.ticks, panel.y.short_ticks)
    size = min(SMALL_PT, chart.label_pt)
    axes.tick_params(labelsize=size, labelbottom=panel.has_x_labels)
    axes.set_ylabel(panel.y.label, fontsize=chart.label_pt)
    if panel.has_x_labels:
        axes.set_xlabel(panel.x.label, fontsize=chart.label_pt)


def draw_mark(axes: Axes, mark: Mark, order: int) -> None:
    """Draw a mark, in front of those of lower order."""
    before = len(axes.lines), len(axes.collections)
    if isinstance(mark, Points):
        face = mark.face or mark.colour
        points(axes, mark.x, mark.y, mark.marker, mark.colour, face, mark.size_pt)
        axes.lines[-1].set_clip_on(mark.is_clipped)
    elif isinstance(mark, ErrorBars):
        error_bars(axes, mark.x, mark.y, mark.sigma, mark.colour)
    elif isinstance(mark, Band):
        axes.fill_between(
            mark.x, mark.low, mark.high, color=mark.colour, alpha=mark.opacity, linewidth=0
        )
    else:
        axes.plot(
            mark.x,
            mark.y,
            color=mark.colour,
            linewidth=mark.width_pt,
            linestyle=mark.style,
            alpha=mark.opacity,
        )
    for artist in (*axes.lines[before[0] :], *axes.collections[before[1] :]):
        artist.set_zorder(order)


def _entry(label: str, mark: Mark) -> Artist:
    """Return the entry of the legend for a mark."""
    if isinstance(mark, Points):
        return marker_entry(label, mark.marker, mark.colour, mark.face or None)
    if isinstance(mark, Band):
        return band_entry(label, mark.colour)
    if isinstance(mark, ErrorBars):
        return line_entry(label, mark.colour)
    return line_entry(label, mark.colour, mark.style, mark.width_pt, mark.opacity)
