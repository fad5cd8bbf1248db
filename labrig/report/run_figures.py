"""Figures about the run as a whole: all patches side by side, and whether frames came on time."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

from labrig.fit import DecayFit
from labrig.report.content import PatchReport
from labrig.report.decay_figures import (
    SIGNAL_LABEL,
    TIME_LABEL,
    decade_text,
    fitted_curve,
    log_axis_ends,
    middles_s,
)
from labrig.report.figure_style import INK, MUTED, SMALL_PT, channel_colour, new_figure, place
from labrig.report.written_numbers import rounded

COLUMNS = 3
ROW_PT = 104.0
TIMING_HEIGHT_PT = 190.0


def overview_figure(patches: Sequence[PatchReport]) -> Figure:
    """Small logarithmic decays of all patches on common axes."""
    columns = min(COLUMNS, len(patches))
    rows = -(-len(patches) // columns)
    height = rows * ROW_PT + 48
    figure = new_figure(height)
    ends = [log_axis_ends(patch.series) for patch in patches]
    low, high = min(end[0] for end in ends), max(end[1] for end in ends)
    last = max(float(middles_s(patch.series).max()) for patch in patches) or 1.0
    wide = (420.0 - 54 - 8) / columns
    for number, patch in enumerate(patches):
        row, column = divmod(number, columns)
        left = 54 + column * wide
        top = row * ROW_PT
        axes = place(
            figure,
            left=left + (6 if column else 0),
            bottom=height - top - ROW_PT,
            right=420 - left - wide,
            top=top + 20,
        )
        axes.set_yscale("log", nonpositive="clip")
        axes.set_ylim(low, high)
        axes.set_xlim(-0.02 * last, 1.03 * last)
        axes.yaxis.set_major_locator(LogLocator(numticks=5))
        axes.yaxis.set_minor_locator(NullLocator())
        axes.yaxis.set_major_formatter(FuncFormatter(decade_text))
        axes.yaxis.set_minor_formatter(NullFormatter())
        axes.tick_params(labelleft=column == 0, labelbottom=number + columns >= len(patches))
        axes.locator_params(axis="x", nbins=4)
        axes.set_title(patch.name, fontsize=SMALL_PT, color=INK, loc="left", pad=4)
        _small_decay(axes, patch)
    figure.text(
        0.5 + 23 / 420, 4 / height, TIME_LABEL, ha="center", va="bottom", color=INK
    )
    figure.text(
        12 / 420, 0.5 + 24 / height, SIGNAL_LABEL, rotation=90, ha="center", va="center", color=INK
    )
    return figure
