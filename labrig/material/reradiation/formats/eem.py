"""Excitation-emission matrices (EEM) of spectrofluorometers, as text.

Those of instruments and spreadsheets are read in any of their layouts; what is scattered light in
them, and what is not measured, is left out. labrig's own begin with the cell
`excitation_nm/emission_nm` and the emission wavelengths in nm; every other line is an excitation
wavelength, then intensities in an arbitrary unit, of which 0 was not measured. There is no
reflectance.
"""

import logging
from dataclasses import dataclass

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.material.reradiation.formats.eem_axes import emission_in_rows
from labrig.material.reradiation.formats.eem_grid import Axis, read_grid
from labrig.material.reradiation.formats.eem_scatter import without_scatter
from labrig.material.reradiation.formats.text_rows import (
    Line,
    check_wavelengths,
    filled_lines,
    numbers,
    wavelengths,
)
from labrig.material.reradiation.matrix import ReradiationMatrix

_logger = logging.getLogger(__name__)

#: First cell of labrig's own files.
_CORNER = "excitation_nm/emission_nm"


@dataclass(frozen=True, eq=False)
class MatrixLayout:
    """Answers to what the table of an excitation-emission matrix leaves open.

    Parameters
    ----------
    rows
        What its rows are, `emission` or `excitation`; None leaves it to the names and the signal.
    excitation_nm
        Excitation wavelengths of emission spectra that stand one below the other without them,
        shape (m,).

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.material import MatrixLayout
    >>> MatrixLayout(excitation_nm=np.arange(230.0, 455, 5)).rows is None
    True
    """

    rows: Axis | None = None
    excitation_nm: FloatArray | None = None


def parse_eem(text: str, layout: MatrixLayout, place: str) -> ReradiationMatrix:
    """Return the matrix in the text of an EEM, without a name, in a relative unit.

    What was taken and left out is logged.

    Parameters
    ----------
    text
        Text of the file.
    layout
        Answers to what the table leaves open.
    place
        Name of the file in what is logged.

    Raises
    ------
    ValueError
        The text is broken, or its axes are not told.
    """
    if text.lstrip().startswith(_CORNER):
        return _own(text)
    grid = read_grid(text, layout.excitation_nm)
    is_emission, told = emission_in_rows(grid, layout.rows)
    emission_nm, input_nm, intensity = grid.row_nm, grid.column_nm, grid.intensity
    if not is_emission:
        emission_nm, input_nm, intensity = input_nm, emission_nm, intensity.T
    order, input_order = np.argsort(emission_nm), np.argsort(input_nm)
    emission_nm, input_nm = emission_nm[order], input_nm[input_order]
    intensity = intensity[np.ix_(order, input_order)]
    check_wavelengths(emission_nm, "emission: ")
    check_wavelengths(input_nm, "excitation: ")
    if not np.isfinite(intensity).any():
        raise ValueError("expected intensities, got none")
    notes = [*grid.notes, *([told] if told else [])]
    if _is_cut(emission_nm, input_nm, intensity):
        intensity = np.where(intensity == 0, np.nan, intensity)
        notes.append("0 is taken for not measured, as all of it is at and below the excitation")
    else:
        intensity, left_out = without_scatter(input_nm, emission_nm, intensity)
        notes += left_out
    for note in notes:
        _logger.warning("note: %s: %s", place, note)
    return _relative(input_nm, emission_nm, intensity)


def _is_cut(emission_nm: FloatArray, input_nm: FloatArray, intensity: FloatArray) -> bool:
    """Return whether all entries up to the excitation wavelength are 0: scatter was taken out."""
    below = intensity[emission_nm[:, np.newaxis] <= input_nm]
    return len(below) > 0 and bool((below == 0).all())


def _relative(input_nm: FloatArray, output_nm: FloatArray, table: FloatArray) -> ReradiationMatrix:
    nothing = np.full(len(output_nm), np.nan)
    return ReradiationMatrix("", input_nm, output_nm, nothing, table, unit="relative")


def _own(text: str) -> ReradiationMatrix:
    lines = filled_lines(text)
    if len(lines) < 3:
        raise ValueError(
            "expected a line of emission wavelengths and one for each excitation, "
            f"got {len(lines)} lines"
        )
    output_nm = wavelengths(lines[0].text.split()[1:], lines[0].number)
    rows = np.array([_row(line, len(output_nm)) for line in lines[1:]])
    if rows[0, 0] > rows[-1, 0]:
        rows = rows[::-1]
    input_nm = rows[:, 0]
    check_wavelengths(input_nm, f"lines {lines[1].number} to {lines[-1].number}: ")
    intensities = rows[:, 1:].T
    return _relative(input_nm, output_nm, np.where(intensities == 0, np.nan, intensities))


def _row(line: Line, n_emission: int) -> list[float]:
    values = numbers(line.text.split(), line.number)
    if len(values) != n_emission + 1:
        raise ValueError(
            f"line {line.number}: expected an excitation wavelength and {n_emission} "
            f"intensities, got {len(values)} numbers"
        )
    return values


def eem_text(matrix: ReradiationMatrix) -> str:
    """Return the text of an EEM, excitation falling.

    Raises
    ------
    ValueError
        The matrix has a reflectance, a unit, or a measured 0.
    """
    check_wavelengths(matrix.input_nm)
    check_wavelengths(matrix.output_nm)
    if matrix.unit != "relative" or not np.isnan(matrix.reflectance).all():
        raise ValueError("EEM text holds relative intensities without reflectance; use CSV")
    if (matrix.reradiation == 0).any():
        raise ValueError("in EEM text an intensity of 0 was not measured; use CSV")
    rows = [" ".join([_CORNER, *map(_text, matrix.output_nm)])]
    for nm, column in zip(matrix.input_nm[::-1], matrix.reradiation.T[::-1], strict=True):
        rows.append(" ".join([_text(nm), *map(_text, np.nan_to_num(column))]))
    return "\n".join(rows) + "\n"


def _text(value: float) -> str:
    return repr(float(value)).removesuffix(".0")
