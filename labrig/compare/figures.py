"""Figures of a comparison: colour patches over time and under lamps, and spectra."""

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from labrig.compare.glow import GlowComparison
from labrig.compare.rendered_lamps import LOOKS, RenderedLamp, RenderedSample
from labrig.compare.three_channels import ThreeChannels
from labrig.foundation import colour_science
from labrig.foundation.arrays import FloatArray
from labrig.foundation.number_format import rounded
from labrig.optics import XYZ_TO_SRGB
from labrig.report import (
    DASHED,
    EDGE_PT,
    FONT_PT,
    INK,
    MUTED,
    SMALL_PT,
    WIDTH_PT,
    css_colour,
    into_gamut,
    legend_above,
    line_entry,
    new_figure,
    place,
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


#: Characters of a sample's name that fit below its colours, by their width in points.
LETTER_PT = 5.0
#: What stands where there is no number.
NOTHING = "–"

Block = tuple[str, str, tuple[tuple[str, RenderedSample], ...]]


def lamps_figure(lamps: Sequence[RenderedLamp]) -> Figure:
    """Draw a block for each lamp: photographs above, the rendering and its parts below."""
    blocks = [block for lamp in lamps for block in _blocks(lamp)]
    height_pt = TITLE_PT + len(LOOKS) * CELL_HEIGHT_PT + TIMES_PT + GAP_PT
    figure = new_figure(len(blocks) * height_pt)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(0, WIDTH_PT), ylim=(len(blocks) * height_pt, 0))
    axes.axis("off")
    for number, block in enumerate(blocks):
        _draw(axes, block, number * height_pt)
    return figure


def _blocks(lamp: RenderedLamp) -> Iterator[Block]:
    """Yield title, text at the right and samples of each block of a lamp."""
    samples = list(lamp.samples.items())
    mean = float(np.mean([sample.delta_e for _, sample in samples]))
    edges = np.linspace(0, len(samples), -(-len(samples) // COLUMNS) + 1).astype(int)
    for first, end in pairwise(edges.tolist()):
        yield (
            lamp.name if first == 0 else "",
            f"mean ΔE {mean:.2f}" if first == 0 else "",
            tuple(samples[first:end]),
        )


def _draw(axes: Axes, block: Block, top: float) -> None:
    title, text, samples = block
    axes.text(EDGE_PT, top + 14, title, color=INK, fontsize=FONT_PT, weight="bold")
    axes.text(WIDTH_PT - EDGE_PT, top + 14, text, ha="right", color=MUTED, fontsize=SMALL_PT)
    width = (WIDTH_PT - LABELS_PT - EDGE_PT) / len(samples)
    for row, look in enumerate(LOOKS):
        y = top + TITLE_PT + row * CELL_HEIGHT_PT
        axes.text(LABELS_PT - 6, y + CELL_HEIGHT_PT / 2, look, ha="right", va="center", color=INK,
                  fontsize=SMALL_PT)  # fmt: skip
        for column, (_, sample) in enumerate(samples):
            x = LABELS_PT + column * width
            draw_cell(axes, (x, y), width, _on_screen(sample.xyz[look]), _written(sample, look))
    y = top + TITLE_PT + len(LOOKS) * CELL_HEIGHT_PT + 12
    most = max(int(width / LETTER_PT), 2)
    for column, (name, _) in enumerate(samples):
        short = name if len(name) <= most else f"{name[: most - 1]}…"
        axes.text(LABELS_PT + (column + 0.5) * width, y, short, ha="center", color=MUTED,
                  fontsize=SMALL_PT)  # fmt: skip


def _written(sample: RenderedSample, look: str) -> str:
    """Return what stands in a cell: ΔE2000, or the share of the luminance."""
    return {
        "rendered": f"{sample.delta_e:.1f}",
        "reflected": f"{sample.delta_e_reflected:.1f}",
        "re-radiated": f"{percent(sample.reradiated_luminance, '.0f')} %",
    }.get(look, "")


def percent(fraction: float, form: str) -> str:
    """Return a fraction in per cent, a dash for none."""
    return NOTHING if np.isnan(fraction) else f"{100 * fraction:{form}}"


def _on_screen(xyz: FloatArray) -> FloatArray:
    """Return linear sRGB of X, Y, Z; what is brighter than the screen's white is clipped."""
    return np.clip(into_gamut(XYZ_TO_SRGB @ xyz), 0.0, 1.0)


PANEL_COLUMNS = 3

PANEL_HEIGHT_PT, LEGEND_PT, BELOW_PT, LEFT_PT = 112.0, 22.0, 18.0, 16.0
FROM_NM, TO_NM = 395.0, 705.0
TICKS_NM = (400, 500, 600, 700)
#: Alignment of the labels: the outer ones end with their axes, so that panels stay apart.
_SIDES: tuple[Literal["left", "center", "right"], ...] = ("left", "center", "center", "right")
TICK_PT = 8.5
#: Upper limit of the vertical axes, with space for the colours above 1.
HIGHEST = 1.4


def spectra_figure(results: Sequence[ThreeChannels]) -> Figure:
    """Draw a panel for each spectrum, with its colour next to the colour from R, G, B."""
    rows = math.ceil(len(results) / PANEL_COLUMNS)
    height = LEGEND_PT + rows * PANEL_HEIGHT_PT + BELOW_PT
    figure = new_figure(height)
    width = (WIDTH_PT - LEFT_PT) / PANEL_COLUMNS
    for number, result in enumerate(results):
        row, column = divmod(number, PANEL_COLUMNS)
        axes = place(
            figure,
            left=LEFT_PT + column * width + 6,
            bottom=BELOW_PT + (rows - 1 - row) * PANEL_HEIGHT_PT + 16,
            right=WIDTH_PT - LEFT_PT - (column + 1) * width + 10,
            top=LEGEND_PT + row * PANEL_HEIGHT_PT + 18,
        )
        full = float(result.spectrum.max())
        axes.plot(result.wavelength_nm, result.spectrum / full, color=INK, linewidth=1.2)
        axes.plot(
            result.wavelength_nm,
            result.approximation / full,
            color=MUTED,
            linewidth=1.2,
            linestyle=DASHED,
        )
        axes.set_xlim(FROM_NM, TO_NM)
        axes.set_xticks(TICKS_NM)
        lowest = float(result.approximation.min()) / full
        axes.set_ylim(min(lowest * 1.1, -0.04), HIGHEST)
        axes.set_yticks((0, 1), ("0", "1") if column == 0 else ("", ""))
        axes.tick_params(labelsize=TICK_PT, pad=2)
        for label, side in zip(axes.get_xticklabels(), _SIDES, strict=True):
            label.set_horizontalalignment(side)
        axes.set_title(result.name, fontsize=SMALL_PT, color=INK, loc="left", pad=4)
        axes.set_title(
            f"ΔE {result.delta_e:.1f}", fontsize=SMALL_PT, color=MUTED, loc="right", pad=4
        )
        for place_x, xyz in ((0.72, result.xyz), (0.86, result.xyz_from_rgb)):
            axes.add_patch(
                Rectangle(
                    (place_x, 0.84),
                    0.14,
                    0.16,
                    transform=axes.transAxes,
                    color=css_colour(_brightest_on_screen(xyz)),
                    linewidth=0,
                    zorder=4,
                )
            )
    figure.text(0.5, EDGE_PT / height, "Wavelength / nm", ha="center", va="bottom", color=INK)
    legend_above(
        figure,
        [
            line_entry("spectrum", INK),
            line_entry("best sum of three CIE 2015 functions", MUTED, DASHED),
        ],
        columns=2,
    )
    return figure


def _brightest_on_screen(xyz: FloatArray) -> FloatArray:
    """Return linear sRGB of X, Y, Z with a maximum of 1, shape (3,)."""
    colour = colour_science.load()
    linear = into_gamut(np.asarray(colour.RGB_COLOURSPACES["sRGB"].matrix_XYZ_to_RGB) @ xyz)
    return linear / max(float(linear.max()), 1e-12)
