"""A decay as measured and fitted, on a linear and on a logarithmic scale."""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import NDArray

from labrig.fit import DecayFit
from labrig.reduce import Series
from labrig.report.figure_style import (
    INK,
    MARKERS,
    MUTED,
    PAPER,
    SMALL_PT,
    channel_colour,
    new_figure,
    place,
)
from labrig.report.written_numbers import power_of_ten, rounded

FloatArray = NDArray[np.float64]

TIME_LABEL = "Time after lamp off / s"
SIGNAL_LABEL = "Signal / (DN/s)"
HEIGHT_PT = 272.0
CURVE_POINTS = 240
#: A logarithmic axis begins at this share of the noise at the end of the decay, and spans no more
#: than so many decades: below is nothing but the noise's chance zeros.
SHARE_OF_NOISE = 0.5
MOST_DECADES = 6.0
#: Values left out of the fit are shown up to this many times the highest fitted one.
LEFT_OUT_SHOWN = 3.0


@dataclass(frozen=True, eq=False)
class Curve:
    """The fit as a line.

    Parameters
    ----------
    t_s
        Shape (m,): middles of exposures.
    total
        Shape (m, C), what frames there would measure.
    states
        Shape (m, n): each state in the brightest channel, offset left out.
    brightest
        That channel's number.
    """

    t_s: FloatArray
    total: FloatArray
    states: FloatArray
    brightest: int


def middles_s(series: Series) -> FloatArray:
    """Middle of each exposure after lamp off, where its value is drawn."""
    return series.t_s + series.exposure_s / 2


def fitted_curve(series: Series, fit: DecayFit) -> Curve:
    """`fit` along the times of `series`, for the exposures that frames had around them."""
    order = np.argsort(series.t_s, kind="stable")
    known_t, known_exposure = series.t_s[order], series.exposure_s[order]
    t_s = np.linspace(known_t[0], known_t[-1], CURVE_POINTS)
    exposure_s = np.interp(t_s, known_t, known_exposure)
    middle_s = t_s + exposure_s / 2
    states = [state.amplitude * np.exp(-state.k_r_per_s * middle_s) for state in fit.states]
    return Curve(
        t_s=middle_s,
        total=fit.predict(t_s, exposure_s),
        states=np.stack(states, axis=1),
        brightest=fit.brightest,
    )


def linear_decay(series: Series, fit: DecayFit | None) -> Figure:
    """Signal over time."""
    figure, axes = _axes()
    _draw(axes, series, fit)
    highest, lowest = max(_highest(series), 0.0), min(float(_used(series).min()), 0.0)
    room = 0.06 * (highest - lowest) or 1.0
    axes.set_ylim(lowest - (room if lowest < 0 else 0.0), highest + room)
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: rounded(value)))
    _legend(figure, series, fit)
    return figure


def logarithmic_decay(series: Series, fit: DecayFit | None) -> Figure:
    """Signal over time with a logarithmic axis; what is not positive stands at its foot."""
    figure, axes = _axes()
    axes.set_yscale("log", nonpositive="clip")
    _draw(axes, series, fit)
    low, high = log_axis_ends(series)
    axes.set_ylim(low, high)
    axes.yaxis.set_major_locator(LogLocator(numticks=8))
    axes.yaxis.set_major_formatter(FuncFormatter(decade_text))
    axes.yaxis.set_minor_formatter(NullFormatter())
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


def decade_text(value: float, _: int | None) -> str:
    """A decade's tick: `0.01` to `10000`, beyond that a power of ten."""
    exponent = round(np.log10(value))
    return f"{value:g}" if -3 <= exponent <= 4 else power_of_ten(exponent)


def _axes() -> tuple[Figure, Axes]:
    figure = new_figure(HEIGHT_PT)
    axes = place(figure, left=62, bottom=38, right=12, top=30)
    axes.set_xlabel(TIME_LABEL)
    axes.set_ylabel(SIGNAL_LABEL)
    return figure, axes


def _used(series: Series) -> FloatArray:
    """Values that are fitted, shape (m, C); all if none are."""
    return series.values[series.usable] if series.usable.any() else series.values


def _highest(series: Series) -> float:
    """The highest value worth an axis: those left out of the fit do not dwarf the fitted ones."""
    used = float(_used(series).max())
    return min(float(series.values.max()), LEFT_OUT_SHOWN * used) if used > 0 else used


def _draw(axes: Axes, series: Series, fit: DecayFit | None) -> None:
    t_s, usable = middles_s(series), series.usable
    for number, name in enumerate(series.channels):
        colour = channel_colour(name, number)
        for rows, face in ((usable, colour), (~usable, PAPER)):
            if rows.any():
                axes.errorbar(
                    t_s[rows],
                    series.values[rows, number],
                    yerr=np.nan_to_num(series.sigma[rows, number]),
                    linestyle="none",
                    marker=MARKERS[number % len(MARKERS)],
                    markersize=3.8,
                    markerfacecolor=face,
                    markeredgecolor=colour,
                    markeredgewidth=0.9,
                    ecolor=colour,
                    elinewidth=0.9,
                    zorder=3,
                )
    if fit is not None:
        curve = fitted_curve(series, fit)
        for number, name in enumerate(series.channels):
            axes.plot(
                curve.t_s, curve.total[:, number], color=channel_colour(name, number), linewidth=1.2
            )
        if fit.n_states > 1:
            axes.plot(curve.t_s, curve.states, color=INK, linewidth=0.9, linestyle=(0, (4, 2.5)))
    last = float(t_s.max())
    axes.set_xlim(-0.02 * last if last else -1.0, 1.03 * last or 1.0)


def _legend(figure: Figure, series: Series, fit: DecayFit | None) -> None:
    """In a row above the axes, so that it covers nothing."""
    handles = [
        Line2D(
            [],
            [],
            linestyle="none",
            marker=MARKERS[number % len(MARKERS)],
            markersize=5,
            color=channel_colour(name, number),
            label=name,
        )
        for number, name in enumerate(series.channels)
    ]
    if fit is not None:
        handles.append(Line2D([], [], color=MUTED, linewidth=1.2, label="fit"))
        if fit.n_states > 1:
            brightest = series.channels[fit.brightest]
            handles.append(
                Line2D(
                    [],
                    [],
                    color=INK,
                    linewidth=0.9,
                    linestyle=(0, (4, 2.5)),
                    label=f"each state, {brightest}",
                )
            )
    if not series.usable.all():
        handles.append(
            Line2D(
                [],
                [],
                linestyle="none",
                marker="o",
                markersize=5,
                markerfacecolor=PAPER,
                markeredgecolor=MUTED,
                label="left out",
            )
        )
    figure.legend(
        handles=handles,
        loc="upper left",
        bbox_to_anchor=(54 / 420, 1.0),
        ncols=min(len(handles), 6),
        frameon=False,
        fontsize=SMALL_PT,
        labelcolor=INK,
        handlelength=1.6,
        handletextpad=0.4,
        columnspacing=1.3,
        borderaxespad=0.4,
    )
