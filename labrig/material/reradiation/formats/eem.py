"""Excitation-emission matrices (EEM) of spectrofluorometers, as text.

The first line has the emission wavelengths in nm; every other one an excitation wavelength, then
intensities in an arbitrary unit. An intensity of 0 was not measured. There is no reflectance.
"""

import numpy as np

from labrig.material.reradiation.formats.text_rows import (
    Line,
    check_wavelengths,
    filled_lines,
    numbers,
    wavelengths,
)
from labrig.material.reradiation.matrix import ReradiationMatrix


def parse_eem(text: str) -> ReradiationMatrix:
    """Return the matrix in the text of an EEM, without a name, in a relative unit.

    Raises
    ------
    ValueError
        The text is broken; the message names the line.
    """
    lines = filled_lines(text)
    if len(lines) < 3:
        raise ValueError(
            "expected a line of emission wavelengths and one for each excitation, "
            f"got {len(lines)} lines"
        )
    output_nm = wavelengths(lines[0].text.split(), lines[0].number)
    rows = np.array([_row(line, len(output_nm)) for line in lines[1:]])
    if rows[0, 0] > rows[-1, 0]:
        rows = rows[::-1]
    input_nm = rows[:, 0]
    check_wavelengths(input_nm, f"lines {lines[1].number} to {lines[-1].number}: ")
    intensities = rows[:, 1:].T
    return ReradiationMatrix(
        "",
        input_nm,
        output_nm,
        np.full(len(output_nm), np.nan),
        np.where(intensities == 0, np.nan, intensities),
        unit="relative",
    )


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
    rows = [" ".join(_text(nm) for nm in matrix.output_nm)]
    for nm, column in zip(matrix.input_nm[::-1], matrix.reradiation.T[::-1], strict=True):
        rows.append(" ".join([_text(nm), *map(_text, np.nan_to_num(column))]))
    return "\n".join(rows) + "\n"


def _text(value: float) -> str:
    return repr(float(value)).removesuffix(".0")
