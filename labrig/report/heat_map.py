"""The picture of a re-radiation matrix over incident and returning wavelength."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from labrig.material import ReradiationMatrix
from labrig.report.figure_style import INK

# matplotlib is slow to load.
if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import QuadMesh

FloatArray = NDArray[np.float64]

#: Width in nm of the bands for which re-radiation is shown, as in the instruments' files.
BAND_NM = 10.0
#: Colour of entries on and beyond the diagonal, and of those that were not measured.
EMPTY = "#eceff1"


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
