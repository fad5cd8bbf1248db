"""Fluorescent samples under lamps as colour patches: photographed, rendered, and the two parts."""

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from labrig.compare.glow_figure import (
    CELL_HEIGHT_PT,
    COLUMNS,
    GAP_PT,
    LABELS_PT,
    TIMES_PT,
    TITLE_PT,
    draw_cell,
)
from labrig.compare.rendered_lamps import LOOKS, RenderedLamp, RenderedSample
from labrig.foundation.arrays import FloatArray
from labrig.optics import XYZ_TO_SRGB
from labrig.report import EDGE_PT, FONT_PT, INK, MUTED, SMALL_PT, WIDTH_PT, into_gamut, new_figure

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
