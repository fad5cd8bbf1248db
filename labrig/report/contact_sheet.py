"""Many fluorescent materials on one sheet."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from labrig.foundation.errors import UsageError
from labrig.material import ReradiationMatrix
from labrig.optics import Spectrum
from labrig.report.figure_style import INK, MUTED, figure_style
from labrig.report.heat_map import BAND_NM, draw_heat, largest, shown_values
from labrig.report.picture_file import require_picture, save_picture
from labrig.report.reradiation import screen_colour

# matplotlib is slow to load.
if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLUMNS = 8
CELL_INCHES = (1.5, 1.75)
#: Re-radiation per 10 nm that is dark at least: what is weaker than this is noise in most cells.
LEAST_TOP = 0.02
#: Characters of a name that fit above a cell.
NAME_CHARACTERS = 20


def draw_contact_sheet(matrices: Sequence[ReradiationMatrix], light: Spectrum, path: Path) -> None:
    """Draw the matrix of each material, and its colour under a light.

    Parameters
    ----------
    matrices
        The materials, at least one.
    light
        Broad light, such as D65.
    path
        Path of the picture, which ends in `.png`, `.svg` or `.pdf`.

    Raises
    ------
    UsageError
        There is no material, or the file name is not that of a picture.
    DiskError
        The file cannot be written.

    Examples
    --------
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from labrig.material import ReradiationMatrix
    >>> from labrig.optics import read_light
    >>> from labrig.report import draw_contact_sheet
    >>> nm = np.arange(380.0, 781.0, 10.0)
    >>> grey = ReradiationMatrix.from_bands("grey", nm, nm, np.diag(np.full(41, 0.2)))
    >>> draw_contact_sheet([grey], read_light("D65"), Path("sheet.svg"))
    """
    from matplotlib.figure import Figure

    require_picture(path)
    if not matrices:
        raise UsageError("expected at least one material for the sheet, got none")
    columns = min(COLUMNS, len(matrices))
    rows = -(-len(matrices) // columns)
    with figure_style():
        size = (CELL_INCHES[0] * columns, CELL_INCHES[1] * rows + 0.3)
        figure = Figure(figsize=size, layout="constrained")
        cells = np.atleast_1d(figure.subplots(rows, columns)).ravel()
        for axes, matrix in zip(cells, matrices, strict=False):
            _draw_cell(axes, matrix, light)
        for axes in cells[len(matrices) :]:
            axes.set_axis_off()
        caption = (
            "re-radiation by incident (across) and returning wavelength (up), each to its own "
            f"maximum, {LEAST_TOP:g} per {BAND_NM:g} nm at least; colour under {light.name}"
        )
        figure.supxlabel(caption, fontsize="small", color=MUTED)
        save_picture(figure, path)


def _draw_cell(axes: "Axes", matrix: ReradiationMatrix, light: Spectrum) -> None:
    """Draw the matrix above the diagonal, and the colour below."""
    from matplotlib.patches import Polygon

    values = shown_values(matrix)
    left, right = matrix.input_edges_nm[[0, -1]]
    bottom, high = matrix.output_edges_nm[[0, -1]]
    start, end = max(left, bottom), min(right, high)
    corners = [(start, start), (end, end), (right, bottom), (start, bottom)]
    axes.add_patch(Polygon(corners, facecolor=screen_colour(matrix, light), linewidth=0))
    draw_heat(axes, matrix, values, (0.0, max(largest(values), LEAST_TOP)))
    axes.set(xticks=[], yticks=[], xlim=(left, right), ylim=(bottom, high))
    name = matrix.name if len(matrix.name) <= NAME_CHARACTERS else matrix.name[:19] + "…"
    fraction = 100 * max(float(matrix.reradiated_fraction.max()), 0.0)
    axes.set_title(f"{name}\nup to {fraction:.0f} %", fontsize=6.5, color=INK)
