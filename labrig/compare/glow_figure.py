"""Photographed and predicted glow as colour patches over time, as in fig. 8 of Nalbach et al."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from labrig.compare.glow import GlowComparison
from labrig.foundation import colour_science
from labrig.foundation.arrays import FloatArray
from labrig.foundation.number_format import rounded
from labrig.report import (
    EDGE_PT,
    FONT_PT,
    INK,
    MUTED,
    SMALL_PT,
    WIDTH_PT,
    css_colour,
    into_gamut,
    new_figure,
)

#: Number of photographs side by side, and exponent of their spacing, dense at early times.
COLUMNS = 9
SPREAD = 1.6
WRITING_PT = 8.5
LABELS_PT, MEANS_PT, CELL_HEIGHT_PT = 74.0, 34.0, 24.0
TITLE_PT, TIMES_PT, GAP_PT = 20.0, 16.0, 8.0
#: Luminance from which black text has more contrast than white text.
BRIGHT = 0.18


def glow_figure(glows: Sequence[GlowComparison], notes: Sequence[str] = ()) -> Figure:
    """Draw a block for each patch: photographs above, predictions with their ΔE below.

    The mean ΔE over all photographs stands at the end of each row.
    Notes stand under the times, a line each.
    """
    times = [tuple(glow.t_s[shown_rows(glow)]) for glow in glows]
    # Patches of one run were mostly photographed together: their times stand once.
    timed = [
        current != following for current, following in zip(times, [*times[1:], ()], strict=True)
    ]
    tops = np.cumsum([0.0, *(_height(*block) for block in zip(glows, timed, strict=True))])
    height = float(tops[-1]) + TIMES_PT * (1 + len(notes))
    figure = new_figure(height)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(0, WIDTH_PT), ylim=(height, 0))
    axes.axis("off")
    for glow, top, with_times in zip(glows, tops, timed, strict=False):
        _block(axes, glow, float(top), with_times)
    centre = (LABELS_PT + WIDTH_PT - MEANS_PT) / 2
    times_pt = float(tops[-1]) + TIMES_PT - EDGE_PT
    axes.text(centre, times_pt, "Time after lamp off / s", ha="center", color=INK)
    for number, note in enumerate(notes, start=1):
        axes.text(
            EDGE_PT, times_pt + number * TIMES_PT, note, color=MUTED, fontsize=SMALL_PT, wrap=True
        )
    return figure


def shown_rows(glow: GlowComparison) -> NDArray[np.intp]:
    """Return the rows of the photographs shown: of the first decay, denser at early times."""
    rows = np.flatnonzero(glow.first)
    if len(rows) <= COLUMNS:
        return rows
    fractions = np.linspace(0, 1, COLUMNS) ** SPREAD
    return np.asarray(rows[np.unique(np.rint(fractions * (len(rows) - 1)).astype(int))])


def screen_colours(glow: GlowComparison) -> dict[str, FloatArray]:
    """Return linear sRGB of photographs and predictions by name, shape (n, 3).

    The brightest photograph has a channel of 1. Photographs that are nothing but noise are black.
    """
    colour = colour_science.load()
    matrix = np.asarray(colour.RGB_COLOURSPACES["sRGB"].matrix_XYZ_to_RGB)
    photographed = into_gamut(glow.photographed @ matrix.T) * glow.seen[:, np.newaxis]
    full = max(float(photographed.max()), 1e-12)
    strips = {"photograph": photographed / full}
    for name, xyz in glow.predicted.items():
        strips[name] = into_gamut(xyz @ matrix.T) / full
    return strips


def _height(glow: GlowComparison, with_times: bool) -> float:
    below = TIMES_PT if with_times else GAP_PT
    return TITLE_PT + (1 + len(glow.predicted)) * CELL_HEIGHT_PT + below


def _block(axes: Axes, glow: GlowComparison, top: float, with_times: bool) -> None:
    rows = shown_rows(glow)
    width = (WIDTH_PT - LABELS_PT - MEANS_PT - EDGE_PT) / max(len(rows), 1)
    axes.text(EDGE_PT, top + 14, glow.patch, color=INK, fontsize=FONT_PT, weight="bold")
    y, right = top + TITLE_PT, WIDTH_PT - EDGE_PT
    axes.text(right, top + 14, "mean ΔE", ha="right", color=MUTED, fontsize=SMALL_PT)
    for name, strip in screen_colours(glow).items():
        axes.text(LABELS_PT - 6, y + CELL_HEIGHT_PT / 2, name, ha="right", va="center", color=INK,
                  fontsize=SMALL_PT)  # fmt: skip
        if name in glow.predicted:
            axes.text(right, y + CELL_HEIGHT_PT / 2, f"{glow.mean(name):.2f}", ha="right",
                      va="center", color=INK, fontsize=SMALL_PT)  # fmt: skip
        for column, row in enumerate(rows):
            x = LABELS_PT + column * width
            delta_e = glow.delta_e.get(name)
            text = "" if delta_e is None else _delta_e_text(float(delta_e[row]))
            draw_cell(axes, (x, y), width, strip[row], text)
        y += CELL_HEIGHT_PT
    for column, row in enumerate(rows if with_times else ()):
        axes.text(LABELS_PT + (column + 0.5) * width, y + 12, rounded(float(glow.t_s[row]), 3),
                  ha="center", color=MUTED, fontsize=SMALL_PT)  # fmt: skip


def draw_cell(
    axes: Axes, corner: tuple[float, float], width: float, colour: FloatArray, text: str
) -> None:
    """Draw a cell of a colour in linear sRGB (3,), with a text that stands out of it."""
    x, y = corner
    axes.add_patch(Rectangle((x, y), width, CELL_HEIGHT_PT, color=css_colour(colour), linewidth=0))
    axes.text(
        x + width / 2,
        y + CELL_HEIGHT_PT / 2,
        text,
        ha="center",
        va="center",
        fontsize=WRITING_PT,
        color="#000000" if _luminance(colour) > BRIGHT else "#ffffff",
    )


def _delta_e_text(delta_e: float) -> str:
    return "–" if np.isnan(delta_e) else f"{delta_e:.1f}"


def _luminance(linear: FloatArray) -> float:
    return float(np.clip(linear, 0, 1) @ (0.2126, 0.7152, 0.0722))
