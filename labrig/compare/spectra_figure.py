"""Spectra, their approximations by three functions and their colours (Nalbach et al., fig. 9)."""

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from labrig.compare.three_channels import ThreeChannels
from labrig.foundation import colour_science
from labrig.foundation.arrays import FloatArray
from labrig.report import (
    DASHED,
    EDGE_PT,
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

COLUMNS = 3
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
    rows = math.ceil(len(results) / COLUMNS)
    height = LEGEND_PT + rows * PANEL_HEIGHT_PT + BELOW_PT
    figure = new_figure(height)
    width = (WIDTH_PT - LEFT_PT) / COLUMNS
    for number, result in enumerate(results):
        row, column = divmod(number, COLUMNS)
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
                    color=css_colour(_on_screen(xyz)),
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


def _on_screen(xyz: FloatArray) -> FloatArray:
    """Return linear sRGB of X, Y, Z with a maximum of 1, shape (3,)."""
    colour = colour_science.load()
    linear = into_gamut(np.asarray(colour.RGB_COLOURSPACES["sRGB"].matrix_XYZ_to_RGB) @ xyz)
    return linear / max(float(linear.max()), 1e-12)
