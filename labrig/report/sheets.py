"""Sheets of pictures: frames of a rendered scene by time, fluorescent materials side by side."""

import math
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.errors import UsageError
from labrig.material import ReradiationMatrix
from labrig.optics import Spectrum
from labrig.report.figure_files import DPI, require_picture, save_picture
from labrig.report.figure_style import INK, MUTED, figure_style
from labrig.report.reradiation import screen_colour
from labrig.report.reradiation_figures import BAND_NM, draw_heat, largest, shown_values

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLUMNS = 8
CELL_INCHES = (1.5, 1.75)
#: Re-radiation per 10 nm that is dark at least: what is weaker than this is noise in most cells.
MIN_TOP = 0.02
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
            f"maximum, {MIN_TOP:g} per {BAND_NM:g} nm at least; colour under {light.name}"
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
    draw_heat(axes, matrix, values, (0.0, max(largest(values), MIN_TOP)))
    axes.set(xticks=[], yticks=[], xlim=(left, right), ylim=(bottom, high))
    name = matrix.name if len(matrix.name) <= NAME_CHARACTERS else matrix.name[:19] + "…"
    fraction = 100 * max(float(matrix.reradiated_fraction.max()), 0.0)
    axes.set_title(f"{name}\nup to {fraction:.0f} %", fontsize=6.5, color=INK)


Bytes = NDArray[np.uint8]

#: Widths in pixels between which frames are shown as they are; smaller ones are magnified.
MIN_PX, MAX_PX = 200, 480
#: Largest width of a sheet in pixels, and margins for texts and between frames.
SHEET_PX = 2000
GAP_PX, LABEL_PX, TITLE_PX, CAPTION_PX = 14, 28, 46, 34
#: Size in pixels of a letter of the caption, and of its lines.
CHARACTER_PX, LINE_PX = 0.6 * 6.5 * DPI / 72, 1.4 * 6.5 * DPI / 72


def draw_frames(
    frames: Sequence[Bytes], labels: Sequence[str], path: Path, title: str = "", caption: str = ""
) -> None:
    """Draw frames of one size side by side, pixel by pixel where they are neither small nor large.

    Parameters
    ----------
    frames
        Pictures in sRGB, at least one, shape (height, width, 3) each.
    labels
        Label of each, such as its time.
    path
        Path of the sheet, which ends in `.png`, `.svg` or `.pdf`.
    title
        Title above all.
    caption
        Line below all, such as the display transform.

    Raises
    ------
    UsageError
        There is no frame, sizes differ, labels are missing, or the file name is not that of a
        picture.
    DiskError
        The file cannot be written.

    Examples
    --------
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from labrig.report import draw_frames
    >>> frames = [np.full((20, 30, 3), grey, np.uint8) for grey in (200, 90, 40)]
    >>> draw_frames(frames, ["0 s", "1 s", "80 s"], Path("frames.png"), title="after the light")
    """
    from matplotlib.figure import Figure

    require_picture(path)
    if not frames or len({frame.shape for frame in frames}) > 1 or frames[0].shape[2:] != (3,):
        raise UsageError(
            f"{path}: expected one frame or more of one shape (height, width, 3), got "
            f"{', '.join(str(frame.shape) for frame in frames[:4]) or 'none'}"
        )
    if len(labels) != len(frames):
        raise UsageError(f"{path}: expected {len(frames)} labels of frames, got {len(labels)}")
    shown = [_resized(frame) for frame in frames]
    height, width = shown[0].shape[:2]
    columns = _columns(len(frames), width, height)
    rows = -(-len(frames) // columns)
    top = TITLE_PX if title else GAP_PX
    sheet_width = columns * (width + GAP_PX) + GAP_PX
    lines = textwrap.wrap(caption, int((sheet_width - 2 * GAP_PX) / CHARACTER_PX))
    below = CAPTION_PX + LINE_PX * (len(lines) - 1) if lines else 0
    sheet_height = top + rows * (height + LABEL_PX) + below
    with figure_style():
        figure = Figure(figsize=(sheet_width / DPI, sheet_height / DPI), dpi=DPI)
        for number, (frame, label) in enumerate(zip(shown, labels, strict=True)):
            row, column = divmod(number, columns)
            x = GAP_PX + column * (width + GAP_PX)
            y = sheet_height - top - row * (height + LABEL_PX) - height
            place = (x / sheet_width, y / sheet_height, width / sheet_width, height / sheet_height)
            axes = figure.add_axes(place)
            axes.imshow(frame, interpolation="none", aspect="auto")
            axes.set_axis_off()
            figure.text(
                (x + width / 2) / sheet_width, (y - 5) / sheet_height, label,
                ha="center", va="top", fontsize=7, color=INK,
            )  # fmt: skip
        figure.text(
            GAP_PX / sheet_width, 1 - 12 / sheet_height, title, va="top", fontsize=10.5, color=INK
        )
        figure.text(
            GAP_PX / sheet_width,
            10 / sheet_height,
            "\n".join(lines),
            va="bottom",
            fontsize=6.5,
            color=MUTED,
        )
        save_picture(figure, path)


def _resized(frame: Bytes) -> Bytes:
    """Return a frame of a fitting width: small ones magnified pixel by pixel, large ones averaged.

    Averages are of bytes: a sheet is for looking at, and values are in the frames' own files.
    """
    # slow to load
    import cv2

    height, width = frame.shape[:2]
    if width > MAX_PX:
        size = (MAX_PX, max(1, round(height * MAX_PX / width)))
        return np.asarray(cv2.resize(frame, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    times = math.ceil(MIN_PX / width)
    return frame.repeat(times, axis=0).repeat(times, axis=1)


def _columns(frames: int, width: int, height: int) -> int:
    """Return the number of columns of a sheet with few empty cells and about 3 : 2."""
    most = max(1, min(frames, (SHEET_PX - GAP_PX) // (width + GAP_PX)))

    def cost(columns: int) -> float:
        rows = -(-frames // columns)
        shape = columns * (width + GAP_PX) / (rows * (height + LABEL_PX))
        empty = rows * columns - frames
        # A sheet of twice that shape is as bad as one with a quarter of its cells empty.
        return abs(math.log2(shape / 1.5)) + 4 * empty / (rows * columns)

    return min(range(1, most + 1), key=cost)
