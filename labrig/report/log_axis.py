"""Ticks of a logarithmic axis."""

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.markers import TICKLEFT
from matplotlib.ticker import FixedLocator, FuncFormatter, MaxNLocator, NullLocator

from labrig.report.figure_style import MUTED
from labrig.written_numbers import power_of_ten

#: An axis of fewer decades than this has labels between them, too.
FEW_DECADES = 2.0
#: With fewer of them, evenly spaced ticks are labelled instead.
FEWEST_LABELS = 2


def mark_decades(axes: Axes, most: int = 8) -> None:
    """Ticks of the vertical axis, its limits set: `most` of them at decades or between, labelled,
    and short ones at the whole numbers between decades, if every decade is labelled.
    """
    low, high = axes.get_ylim()
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    inside = [decade for decade in decades if low <= 10.0**decade <= high]
    step = max(1, math.ceil(len(inside) / most))
    every = decades[::step]
    labelled = [10.0**decade for decade in every]
    if high < low * 10**FEW_DECADES:
        labelled = [digit * 10.0**decade for decade in every for digit in (1, 2, 5)]
    labelled = [at for at in labelled if low <= at <= high]
    if len(labelled) < FEWEST_LABELS:
        labelled = [at for at in MaxNLocator(5).tick_values(low, high) if low <= at <= high]
    axes.yaxis.set_major_locator(FixedLocator(labelled))
    axes.yaxis.set_major_formatter(FuncFormatter(decade_text))
    # Matplotlib's own minor ticks would be half of the work of drawing the figure.
    axes.yaxis.set_minor_locator(NullLocator())
    if step == 1:
        between = [digit * 10.0**decade for decade in decades for digit in range(2, 10)]
        shown = [at for at in between if low <= at <= high]
        axes.plot(
            np.zeros(len(shown)),
            shown,
            transform=axes.get_yaxis_transform(),
            linestyle="none",
            marker=TICKLEFT,
            markersize=2,
            markeredgewidth=0.6,
            color=MUTED,
            clip_on=False,
        )


def decade_text(value: float, _: int | None) -> str:
    """A tick: `0.01` to `10000`, beyond that with a power of ten."""
    exponent = math.floor(math.log10(value) + 1e-9)
    if -3 <= exponent <= 4:
        return f"{value:g}"
    digit = round(value / 10.0**exponent)
    return power_of_ten(exponent) if digit == 1 else f"{digit} × {power_of_ten(exponent)}"
