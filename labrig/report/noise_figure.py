"""The uncertainty of a value and its parts, over the course of a decay."""

from matplotlib.artist import Artist
from matplotlib.figure import Figure

from labrig.report.decay_figures import TIME_LABEL
from labrig.report.figure_style import (
    DASH_DOTTED,
    DASHED,
    DOTTED,
    INK,
    LEFT_PT,
    LONG_DASHED,
    MUTED,
    OTHER_CHANNELS,
    LineStyle,
    new_figure,
    place,
)
from labrig.report.legend import BAND_OPACITY, legend_above, lined
from labrig.report.log_axis import mark_decades
from labrig.results import FloatArray, NoiseBudget

HEIGHT_PT = 268.0
#: Parts below this share of the whole are not worth their line.
LEAST_SHARE = 0.03
_LINES: dict[str, tuple[str, LineStyle]] = {
    "photons": (OTHER_CHANNELS[1], "-"),
    "reading": (OTHER_CHANNELS[2], DASHED),
    "uneven light": (OTHER_CHANNELS[3], DASH_DOTTED),
    "flicker": (OTHER_CHANNELS[0], DOTTED),
    "dark level": (MUTED, LONG_DASHED),
}
#: Where nothing is seen any more, how little need not be shown.
MOST_PERCENT = 300.0


def visible_parts(budget: NoiseBudget) -> dict[str, FloatArray]:
    """The parts that somewhere are worth a line, by their names."""
    parts = {
        "photons": budget.photons,
        "reading": budget.reading,
        "uneven light": budget.uneven,
        "flicker": budget.flicker,
        "dark level": budget.dark_level,
    }
    worth = LEAST_SHARE * budget.together
    return {name: part for name, part in parts.items() if (part > worth).any()}


def noise_figure(budget: NoiseBudget) -> Figure:
    """Relative standard uncertainty of a value of the brightest channel, and what it is made of."""
    figure = new_figure(HEIGHT_PT)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=46)
    together = 100 * budget.together
    axes.set_yscale("log")
    # Broad and pale, since the largest part is nearly as large.
    entries: list[Artist] = [lined("together", INK, width=4.5, opacity=BAND_OPACITY)]
    shown = [together]
    axes.plot(budget.t_s, together, color=INK, linewidth=4.5, alpha=BAND_OPACITY)
    for name, part in visible_parts(budget).items():
        percent, (colour, style) = 100 * part, _LINES[name]
        axes.plot(budget.t_s, percent, color=colour, linewidth=1.2, linestyle=style)
        entries.append(lined(name, colour, style))
        shown.append(percent[percent > LEAST_SHARE * together])
    low, high = min(part.min() for part in shown), max(part.max() for part in shown)
    axes.set_ylim(0.8 * low, 1.3 * max(min(high, MOST_PERCENT), together.min()))
    mark_decades(axes)
    last = float(budget.t_s.max())
    axes.set_xlim(-0.02 * last if last else -1.0, 1.03 * last or 1.0)
    axes.set_xlabel(TIME_LABEL)
    axes.set_ylabel("σ of a value / % of the signal")
    legend_above(figure, entries, columns=3)
    return figure
