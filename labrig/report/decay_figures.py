"""A decay as measured and fitted, on a linear and on a logarithmic scale."""

import math

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter
from numpy.typing import NDArray

from labrig.report.figure_style import (
    DASHED,
    INK,
    LEFT_PT,
    MARKERS,
    MUTED,
    PAPER,
    channel_colour,
    error_bars,
    new_figure,
    place,
    points,
)
from labrig.report.fitted_curve import fitted_curve, middles_s
from labrig.report.legend import BAND_OPACITY, legend_above, lined, marked, shaded
from labrig.report.log_axis import mark_decades
from labrig.results import FittedDecay, Series
from labrig.written_numbers import power_of_ten, rounded

FloatArray = NDArray[np.float64]

TIME_LABEL = "Time after lamp off / s"
SIGNAL_LABEL = "Signal / (DN/s)"
HEIGHT_PT = 256.0
#: A logarithmic axis begins at this share of the noise at the end of the decay, and spans no more
#: than so many decades: below is nothing but the noise's chance zeros.
SHARE_OF_NOISE = 0.5
MOST_DECADES = 6.0
#: Highest values from here to there are written without a power of ten.
PLAIN_FROM, PLAIN_TO = 0.02, 1e5
#: Values left out of the fit are shown up to this many times the highest fitted one.
LEFT_OUT_SHOWN = 3.0


def linear_decay(series: Series, fit: FittedDecay | None) -> Figure:
    """Signal over time."""
    figure, axes = _axes()
    _draw(axes, series, fit)
    highest, lowest = max(_highest(series), 0.0), min(float(_used(series).min()), 0.0)
    room = 0.06 * (highest - lowest) or 1.0
    axes.set_ylim(lowest - (room if lowest < 0 else 0.0), highest + room)
    exponent = _common_exponent(highest)
    unit = 10.0**exponent
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: rounded(value / unit)))
    if exponent:
        axes.set_ylabel(f"Signal / ({power_of_ten(exponent)} DN/s)")
    _legend(figure, series, fit)
    return figure


def logarithmic_decay(series: Series, fit: FittedDecay | None) -> Figure:
    """Signal over time with a logarithmic axis; what is not positive stands at its foot."""
    figure, axes = _axes()
    axes.set_yscale("log", nonpositive="clip")
    _draw(axes, series, fit)
    low, high = log_axis_ends(series)
    axes.set_ylim(low, high)
    mark_decades(axes)
    for number, name in enumerate(series.channels):
        below = series.values[:, number] < low
        if below.any():
            axes.plot(
                middles_s(series)[below],
                np.full(np.count_nonzero(below), low),
                linestyle="none",
                marker=7,  # a caret that points down, its tip on the value
                markersize=5,
                color=channel_colour(name, number),
                clip_on=False,
                zorder=4,
            )
    _legend(figure, series, fit)
    return figure


def values_below_axis(series: Series) -> int:
    """How many values a logarithmic axis cannot show."""
    return int(np.count_nonzero(series.values < log_axis_ends(series)[0]))


def log_axis_ends(series: Series) -> tuple[float, float]:
    """Lower and upper end of a logarithmic axis."""
    highest = _highest(series)
    if highest <= 0:
        return 0.1, 10.0
    positive = float(series.values[series.values > 0].min())
    late = np.argsort(series.t_s, kind="stable")[-max(1, len(series.t_s) // 4) :]
    noise = series.sigma[late][np.isfinite(series.sigma[late])]
    floor = SHARE_OF_NOISE * float(np.median(noise)) if noise.size else 0.0
    low = max(positive * 0.7, floor, highest * 10.0**-MOST_DECADES)
    return min(low, highest / 10), highest * 1.6


def _axes() -> tuple[Figure, Axes]:
    figure = new_figure(HEIGHT_PT)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=30)
    axes.set_xlabel(TIME_LABEL)
    axes.set_ylabel(SIGNAL_LABEL)
    return figure, axes


def _common_exponent(highest: float) -> int:
    """The power of ten in the unit of an axis, so that its ticks are short."""
    if PLAIN_FROM <= highest < PLAIN_TO or highest <= 0:
        return 0
    return 3 * math.floor(math.log10(highest) / 3)


def _used(series: Series) -> FloatArray:
    """Values that are fitted, shape (m, C); all if none are."""
    return series.values[series.usable] if series.usable.any() else series.values


def _highest(series: Series) -> float:
    """The highest value worth an axis: those left out of the fit do not dwarf the fitted ones."""
    used = float(_used(series).max())
    return min(float(series.values.max()), LEFT_OUT_SHOWN * used) if used > 0 else used


def _draw(axes: Axes, series: Series, fit: FittedDecay | None) -> None:
    t_s, usable = middles_s(series), series.usable
    for number, name in enumerate(series.channels):
        marker = MARKERS[number % len(MARKERS)]
        colour = channel_colour(name, number)
        sigma = np.nan_to_num(series.sigma[:, number])
        error_bars(axes, t_s, series.values[:, number], sigma, colour)
        for rows, face in ((usable, colour), (~usable, PAPER)):
            points(axes, t_s[rows], series.values[rows, number], marker, colour, face)
    if fit is not None:
        curve = fitted_curve(series, fit)
        for number, name in enumerate(series.channels):
            axes.plot(
                curve.t_s, curve.total[:, number], color=channel_colour(name, number), linewidth=1.2
            )
        if np.isfinite(curve.sigma).all():
            middle = curve.total[:, fit.brightest]
            axes.fill_between(
                curve.t_s,
                middle - curve.sigma,
                middle + curve.sigma,
                color=_brightest_colour(fit),
                alpha=BAND_OPACITY,
                linewidth=0,
            )
        if fit.n_states > 1:
            axes.plot(curve.t_s, curve.states, color=INK, linewidth=0.9, linestyle=DASHED)
    last = float(t_s.max())
    axes.set_xlim(-0.02 * last if last else -1.0, 1.03 * last or 1.0)


def _brightest_colour(fit: FittedDecay) -> str:
    return channel_colour(fit.channels[fit.brightest], fit.brightest)


def _legend(figure: Figure, series: Series, fit: FittedDecay | None) -> None:
    entries: list[Artist] = [
        marked(name, MARKERS[number % len(MARKERS)], channel_colour(name, number))
        for number, name in enumerate(series.channels)
    ]
    if fit is not None:
        brightest = series.channels[fit.brightest]
        entries += [lined("fit", MUTED), shaded("± 1 σ", _brightest_colour(fit))]
        if fit.n_states > 1:
            entries.append(lined(f"each state, {brightest}", INK, DASHED, width=0.9))
    if not series.usable.all():
        entries.append(marked("left out", "o", MUTED, PAPER))
    legend_above(figure, entries, columns=7)
