"""Matrices as tables with commas, which hold all that a matrix has.

The header is `output_nm`, `reflectance`, and the input wavelengths in nm; a row begins with its
output wavelength, and what was not measured is empty. Above it may stand `# name: …` and `# unit:`
of the re-radiation: `per band`, `1/nm`, `relative`. A second table after the line `# sigma` holds
standard deviations, and `# correlation:` the correlation of errors in each column, separated by
blanks. Numbers are written so that they are read back exactly.

Without the column of the reflectance, as in the tables of other programs, it stands where input
and output wavelength are the same; without a unit, entries are per band.
"""

import difflib
from dataclasses import dataclass, replace

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.material.reradiation.formats.text_rows import (
    Line,
    check_fractions,
    check_wavelengths,
    filled_lines,
    number,
    number_text,
    numbers_or_nan,
    one_line,
    shown,
    wavelengths,
)
from labrig.material.reradiation.matrix import ReradiationMatrix, are_same_bands
from labrig.optics import edges_from_centres
from labrig.text_table import cell_text, plain_text

PER_BAND = "per band"
_UNITS = (PER_BAND, "1/nm", "relative")
_KEYS = ("name", "unit", "correlation", "sigma")
_REFLECTANCE = "reflectance"


@dataclass(frozen=True, eq=False)
class _Table:
    """One table; without input wavelengths these have shape (0,)."""

    input_nm: FloatArray
    output_nm: FloatArray
    reflectance: FloatArray | None
    entries: FloatArray


def is_fraction_table(text: str) -> bool:
    """Return whether a text is such a table, rather than one of a spectrofluorometer."""
    lines = filled_lines(text)
    comments = [line.text.lstrip("# ") for line in lines if line.text.startswith("#")]
    if any(comment.startswith(key) for comment in comments for key in _KEYS):
        return True
    content = (line for line in lines if not line.text.startswith("#"))
    header = next(content, None)
    return header is None or header.text.lstrip('"').lower().startswith("out")


def parse_csv(text: str) -> ReradiationMatrix:
    """Return the matrix in a table with commas; its name may be empty.

    Raises
    ------
    ValueError
        It is no such table; the message names the line.
    """
    said, blocks = _blocks(filled_lines(text))
    unit = said["unit"]
    if unit not in _UNITS:
        raise ValueError(f"expected '# unit:' {', '.join(_UNITS)}; got {shown(unit)}")
    values = _table(blocks["values"], unit == PER_BAND)
    if not len(values.input_nm):
        raise ValueError("expected input wavelengths in the header, got none")
    sigmas = _table(blocks["sigma"], False) if blocks["sigma"] else None
    if sigmas is not None:
        _check_same_columns(values, sigmas)
    matrix = _matrix(one_line(plain_text(said["name"])), unit, values, sigmas)
    return replace(matrix, column_correlation=_correlation(said["correlation"], values.input_nm))


def _correlation(text: str, input_nm: FloatArray) -> FloatArray | None:
    if not text:
        return None
    try:
        correlation = np.array([float(cell) for cell in text.split()])
    except ValueError:
        correlation = np.zeros(0)
    if len(correlation) != len(input_nm):
        raise ValueError(
            f"expected '# correlation:' and {len(input_nm)} numbers, one for each column, got "
            f"{shown(text)}"
        )
    return correlation


def _blocks(lines: list[Line]) -> tuple[dict[str, str], dict[str, list[Line]]]:
    """Return what stands above the table, and the lines of the tables."""
    said = {"name": "", "unit": PER_BAND, "correlation": ""}
    blocks: dict[str, list[Line]] = {"values": [], "sigma": []}
    block = "values"
    for line in lines:
        if not line.text.startswith("#"):
            blocks[block].append(line)
            continue
        key, colon, value = (part.strip() for part in line.text.lstrip("# ").partition(":"))
        # Spreadsheets fill every line with commas.
        key = key.rstrip(",")
        if key == "sigma":
            block = "sigma"
        elif key in said and colon:
            said[key] = value if key == "name" else value.rstrip(",")
        elif close := difflib.get_close_matches(key, _KEYS, n=1, cutoff=0.8):
            # A misspelt unit would be a wrong scale.
            raise ValueError(f"line {line.number}: did you mean '# {close[0]}:'?")
    return said, blocks


def _table(lines: list[Line], are_fractions: bool) -> _Table:
    if len(lines) < 2:
        raise ValueError("expected a header and rows of numbers, got none")
    header = _cells(lines[0])
    if len(header) < 2 or not header[0].lower().startswith("out") or ";" in header[0]:
        hint = "; save it with commas between and points in numbers" if ";" in header[0] else ""
        raise ValueError(
            f"line {lines[0].number}: expected a header output_nm,reflectance,300,310,…; "
            f"got {shown(lines[0].text)}{hint}"
        )
    has_reflectance = header[1].lower() == _REFLECTANCE
    input_cells = header[2:] if has_reflectance else header[1:]
    input_nm = wavelengths(input_cells, lines[0].number) if input_cells else np.zeros(0)
    rows = [_row(line, len(header), are_fractions) for line in lines[1:]]
    output_nm = np.array([row[0] for row in rows])
    check_wavelengths(output_nm, f"lines {lines[1].number} to {lines[-1].number}: ")
    table = np.array([row[1:] for row in rows])
    return _Table(
        input_nm,
        output_nm,
        table[:, 0] if has_reflectance else None,
        table[:, int(has_reflectance) :],
    )


def _row(line: Line, n_cells: int, are_fractions: bool) -> list[float]:
    cells = _cells(line)
    if len(cells) != n_cells:
        raise ValueError(
            f"line {line.number}: expected {n_cells} cells as in the header, got {len(cells)}"
        )
    values = numbers_or_nan(cells[1:], line.number)
    if are_fractions:
        check_fractions(values, f"line {line.number}")
    return [number(cells[0], line.number), *values]


def _cells(line: Line) -> list[str]:
    return [cell.strip().strip('"') for cell in line.text.split(",")]


def _check_same_columns(values: _Table, sigmas: _Table) -> None:
    same_input = not len(sigmas.input_nm) or np.array_equal(sigmas.input_nm, values.input_nm)
    if not same_input or not np.array_equal(sigmas.output_nm, values.output_nm):
        raise ValueError("expected the same wavelengths in the table of sigma as above it")
    if sigmas.reflectance is not None and values.reflectance is None:
        raise ValueError("expected the column 'reflectance' in both tables, got it in one")


def _matrix(name: str, unit: str, values: _Table, sigmas: _Table | None) -> ReradiationMatrix:
    input_nm, output_nm = values.input_nm, values.output_nm
    width_nm = np.diff(edges_from_centres(output_nm))[:, np.newaxis]
    sigma = sigmas.entries if sigmas is not None and len(sigmas.input_nm) else None
    if values.reflectance is None and unit != "relative":
        same = are_same_bands(output_nm, input_nm)
        to_band = np.where(same, 1.0, 1.0 if unit == PER_BAND else width_nm)
        sigma = None if sigma is None else sigma * to_band
        return ReradiationMatrix.from_bands(
            name, input_nm, output_nm, values.entries * to_band, sigma
        )
    # What is exact in the file stays exact.
    per = width_nm if unit == PER_BAND else 1.0
    return ReradiationMatrix(
        name,
        input_nm,
        output_nm,
        np.full(len(output_nm), np.nan) if values.reflectance is None else values.reflectance,
        values.entries / per,
        None if sigmas is None else sigmas.reflectance,
        None if sigma is None else sigma / per,
        "relative" if unit == "relative" else "1/nm",
    )


def csv_text(matrix: ReradiationMatrix) -> str:
    """Return the table of a matrix, with its standard deviations where they are known."""
    check_wavelengths(matrix.input_nm)
    check_wavelengths(matrix.output_nm)
    lines = [f"# name: {cell_text(one_line(matrix.name))}", f"# unit: {matrix.unit}"]
    lines += _table_lines(matrix, matrix.reflectance, matrix.reradiation)
    if matrix.reflectance_sigma is not None or matrix.reradiation_sigma is not None:
        lines += ["# sigma"]
        lines += _table_lines(matrix, matrix.reflectance_sigma, matrix.reradiation_sigma)
    if matrix.column_correlation is not None:
        lines.append(f"# correlation: {' '.join(map(number_text, matrix.column_correlation))}")
    return "\n".join(lines) + "\n"


def _table_lines(
    matrix: ReradiationMatrix, reflectance: FloatArray | None, entries: FloatArray | None
) -> list[str]:
    columns = [matrix.output_nm[:, np.newaxis]]
    header = ["output_nm"]
    if reflectance is not None:
        columns.append(reflectance[:, np.newaxis])
        header.append(_REFLECTANCE)
    if entries is not None:
        columns.append(entries)
        header += map(number_text, matrix.input_nm)
    rows = np.hstack(columns)
    return [",".join(header), *(",".join(map(number_text, row)) for row in rows)]
