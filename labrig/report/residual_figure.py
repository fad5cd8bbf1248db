"""What the fit left over: value by value, and what the channels of a frame have in common."""

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter
from numpy.typing import NDArray

from labrig.report.decay_figures import TIME_LABEL
from labrig.report.figure_style import (
    INK,
    LEFT_PT,
    MARKERS,
    MUTED,
    PAPER,
    SHADE,
    channel_colour,
    error_bars,
    new_figure,
    place,
    points,
)
from labrig.report.fitted_curve import middles_s
from labrig.report.legend import legend_above, marked
from labrig.results import FittedDecay, Series
from labrig.written_numbers import rounded

FloatArray = NDArray[np.float64]

HEIGHT_PT = 268.0
LOW_HEIGHT_PT = 200.0
BAND = 2.0
#: Beyond this many σ a residual is drawn at the edge of the figure.
FARTHEST = 8.0
#: A frame's common deviation is shown if its own noise leaves it known to this, or to three times
#: what the best frame has.
COMMON_SIGMA = 0.02


@dataclass(frozen=True, eq=False)
class Residuals:
    """Deviations of the values from the fit.

    Parameters
    ----------
    normalised
        Shape (n, C): over the standard deviation expected of a value, flicker included.
    common, common_sigma
        Shape (n,): relative deviation that fits all channels of a frame best, and what photon and
        read noise leave it uncertain by.
    """

    normalised: FloatArray
    common: FloatArray
    common_sigma: FloatArray


def residuals(series: Series, fit: FittedDecay) -> Residuals:
    """Of all rows of `series`, those left out of the fit, too."""
    model = fit.predict(series.t_s, series.exposure_s)
    signal = model - fit.offsets
    deviation = series.values - model
    # Without σ (a table from elsewhere) the scatter of the residuals has to do.
    scatter = np.full_like(deviation, np.sqrt(np.mean(deviation**2)) or 1.0)
    sigma = np.where(np.isfinite(series.sigma), series.sigma, scatter)
    information = np.sum((signal / sigma) ** 2, axis=1)
    information = np.where(information > 0, information, np.nan)
    return Residuals(
        normalised=deviation / np.hypot(sigma, fit.flicker * signal),
        common=np.sum(deviation * signal / sigma**2, axis=1) / information,
        common_sigma=1 / np.sqrt(information),
    )


def residual_figure(series: Series, fit: FittedDecay) -> Figure:
    """Normalised residuals; with several channels below them what a frame's channels share."""
    left = residuals(series, fit)
    several = len(series.channels) > 1
    figure = new_figure(HEIGHT_PT if several else LOW_HEIGHT_PT)
    upper = place(figure, left=LEFT_PT, bottom=136 if several else 38, right=12, top=30)
    t_s, usable = middles_s(series), series.usable
    last = float(t_s.max())
    upper.axhspan(-BAND, BAND, color=SHADE, linewidth=0)
    upper.axhline(0, color=MUTED, linewidth=0.8)
    cut = np.clip(left.normalised, -FARTHEST, FARTHEST)
    for number, name in enumerate(series.channels):
        marker = MARKERS[number % len(MARKERS)]
        colour = channel_colour(name, number)
        for rows, face in ((usable, colour), (~usable, PAPER)):
            points(upper, t_s[rows], cut[rows, number], marker, colour, face, size=3.6)
    _legend(figure, series)
    reach = float(np.abs(cut[usable]).max()) if usable.any() else BAND
    upper.set_ylim(-max(reach * 1.1, 3.2), max(reach * 1.1, 3.2))
    upper.set_xlim(-0.02 * last if last else -1.0, 1.03 * last or 1.0)
    upper.set_ylabel("Residual / σ")
    if not several:
        upper.set_xlabel(TIME_LABEL)
        return figure
    upper.tick_params(labelbottom=False)
    lower = place(figure, left=LEFT_PT, bottom=38, right=12, top=150, share_x=upper)
    lower.axhspan(-200 * fit.flicker, 200 * fit.flicker, color=SHADE, linewidth=0)
    lower.axhline(0, color=MUTED, linewidth=0.8)
    known = left.common_sigma <= max(COMMON_SIGMA, 3 * np.nanmin(left.common_sigma))
    shown = known & usable if (known & usable).any() else known
    common, common_sigma = 100 * left.common[shown], 100 * left.common_sigma[shown]
    error_bars(lower, t_s[shown], common, common_sigma, INK)
    points(lower, t_s[shown], common, "o", INK, INK, size=2.6)
    reach = max(
        float(np.max(np.abs(left.common[shown]) + left.common_sigma[shown])), 2.4 * fit.flicker
    )
    lower.set_ylim(-110 * reach, 110 * reach)
    lower.yaxis.set_major_formatter(FuncFormatter(lambda value, _: rounded(value)))
    lower.set_ylabel("In common / %")
    lower.set_xlabel(TIME_LABEL)
    return figure


def _legend(figure: Figure, series: Series) -> None:
    entries = [
        marked(name, MARKERS[number % len(MARKERS)], channel_colour(name, number))
        for number, name in enumerate(series.channels)
    ]
    if len(series.channels) > 1:
        entries.append(marked("in common", ".", INK))
    if not series.usable.all():
        entries.append(marked("left out", "o", MUTED, PAPER))
    legend_above(figure, entries, columns=7)
