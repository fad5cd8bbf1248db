"""The picture of a re-radiation matrix over incident and returning wavelength."""

from typing import TYPE_CHECKING

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.material import ReradiationMatrix
from labrig.report.figure_style import INK

# matplotlib is slow to load.
if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import QuadMesh
    from matplotlib.figure import Figure


#: Width in nm of the bands for which re-radiation is shown, as in the instruments' files.
BAND_NM = 10.0
#: Colour of entries on and beyond the diagonal, and of those that were not measured.
EMPTY = "#eceff1"
INCIDENT, RETURNING = "Incident wavelength / nm", "Returning wavelength / nm"
#: Height of a matrix in a report, room for the colour bar on its right, and the bar's width.
HEAT_HEIGHT_PT, BAR_ROOM_PT, BAR_PT = 330.0, 74.0, 11.0


def shown_values(matrix: ReradiationMatrix) -> FloatArray:
    """Return the re-radiation per 10 nm, NaN on and beyond the diagonal, shape (n, m)."""
    return np.where(matrix.is_stokes, BAND_NM * matrix.reradiation, np.nan)


def largest(values: FloatArray) -> float:
    """Return the largest value, 0 where nothing was measured."""
    return float(np.nanmax(values)) if np.isfinite(values).any() else 0.0


def draw_heat(
    axes: "Axes",
    matrix: ReradiationMatrix,
    values: FloatArray,
    limits: tuple[float, float],
    colours: str = "magma_r",
) -> "QuadMesh":
    """Draw values (n, m) on the bands of a matrix."""
    return axes.pcolormesh(
        matrix.input_edges_nm, matrix.output_edges_nm, values, cmap=colours, vmin=limits[0],
        vmax=limits[1], rasterized=True,
    )  # fmt: skip


def label_heat(axes: "Axes", title: str) -> None:
    """Name both axes of a matrix."""
    axes.set_facecolor(EMPTY)
    axes.set(xlabel="incident wavelength / nm", ylabel="returning wavelength / nm")
    axes.set_title(title, fontsize="medium", color=INK)


def heat_figure(
    matrix: ReradiationMatrix,
    values: FloatArray,
    limits: tuple[float, float],
    colours: str = "magma_r",
) -> "tuple[Figure, Axes]":
    """Draw values (n, m) on the bands of a matrix as a figure of a report, with a colour bar."""
    from labrig.report.figure_style import LEFT_PT, SHADE, new_figure, place

    figure = new_figure(HEAT_HEIGHT_PT)
    axes = place(figure, left=LEFT_PT, bottom=38, right=BAR_ROOM_PT, top=12)
    axes.grid(visible=False)
    axes.set_facecolor(SHADE)
    mesh = draw_heat(axes, matrix, values, limits, colours)
    axes.set(xlim=matrix.input_edges_nm[[0, -1]], ylim=matrix.output_edges_nm[[0, -1]])
    axes.set(xlabel=INCIDENT, ylabel=RETURNING)
    bar_left = figure.get_figwidth() * 72 - BAR_ROOM_PT + 8
    beside = place(figure, left=bar_left, bottom=38, right=BAR_ROOM_PT - 8 - BAR_PT, top=12)
    bar = figure.colorbar(mesh, cax=beside)
    bar.outline.set_visible(False)
    beside.grid(visible=False)
    return figure, axes
