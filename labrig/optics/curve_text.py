"""Curves in tables of text, with commas, tabs or blanks between the columns."""

import csv
from typing import TypeAlias

import numpy as np

from labrig.optics.piecewise import FloatArray

#: Wavelengths, values and σ of a curve.
Columns: TypeAlias = tuple[FloatArray, FloatArray, FloatArray | None]
#: Name → columns; the only curve of a file without names is called "".
Curves: TypeAlias = dict[str, Columns]

WAVELENGTH = "wavelength_nm"
_UNNAMED = {2: ("",), 4: ("R", "G", "B")}
_EXPECTED = (
    "expected a header that begins with wavelength_nm or name,wavelength_nm; or, without a header, "
    "wavelength and value, or wavelength, R, G and B"
)
#: Wavelengths of a table in µm or in Hz lie outside.
PLAUSIBLE_NM = (100.0, 20_000.0)


def curves_from_text(text: str) -> tuple[str, Curves]:
    """Title (may be empty) and name → columns.

    Raises
    ------
    ValueError
        Not such a table.
    """
    lines = [line for line in text.splitlines() if line.strip()]
    rows = _rows([line for line in lines if not line.startswith("#")])
    title = next((line[8:].strip() for line in lines if line.startswith("#Camera:")), "")
    header = rows[0]
    if _is_number(header[0]):
        if len(header) not in _UNNAMED:
            raise ValueError(f"{_EXPECTED}; got {len(header)} columns")
        return title, _side_by_side(_UNNAMED[len(header)], rows)
    if header[0] == WAVELENGTH and len(header) > 1:
        return title, _side_by_side(tuple(header[1:]), rows[1:])
    if header[:2] == ["name", WAVELENGTH] and len(header) == 3:
        return title, _one_below_the_other(rows[1:])
    raise ValueError(f"{_EXPECTED}; got '{','.join(header[:3])}'")


def sorted_columns(wavelength_nm: FloatArray, values: FloatArray) -> Columns:
    """Rows sorted by wavelength, no σ."""
    order = np.argsort(wavelength_nm, kind="stable")
    return wavelength_nm[order], values[order], None


def _rows(lines: list[str]) -> list[list[str]]:
    if not lines:
        raise ValueError("there is nothing in it")
    if ";" in lines[0]:
        raise ValueError("it has semicolons; save it with commas between and points in numbers")
    try:
        rows = list(csv.reader(lines)) if "," in lines[0] else [line.split() for line in lines]
    except csv.Error as error:
        raise ValueError(f"not a table ({error})") from None
    rows = [[cell.strip() for cell in row] for row in rows]
    odd = next((number for number, row in enumerate(rows) if len(row) != len(rows[0])), None)
    if odd is not None:
        raise ValueError(
            f"row {odd + 1} has {len(rows[odd])} columns, the first has {len(rows[0])}"
        )
    return rows


def _side_by_side(names: tuple[str, ...], rows: list[list[str]]) -> Curves:
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"the column '{twice}' stands twice")
    table = _numbers(rows)
    wavelength_nm, values, _ = sorted_columns(table[:, 0], table[:, 1:])
    if names in (("value",), ("value", "sigma")):
        sigma = values[:, 1] if len(names) == 2 else None
        return {"": (wavelength_nm, values[:, 0], sigma)}
    return {name: (wavelength_nm, values[:, k], None) for k, name in enumerate(names)}


def _one_below_the_other(rows: list[list[str]]) -> Curves:
    of_name: dict[str, list[list[str]]] = {}
    for row in rows:
        of_name.setdefault(row[0], []).append(row[1:])
    tables = {name: _numbers(part) for name, part in of_name.items()}
    return {name: sorted_columns(table[:, 0], table[:, 1]) for name, table in tables.items()}


def _numbers(rows: list[list[str]]) -> FloatArray:
    try:
        table = np.array(rows, dtype=np.float64)
    except ValueError as error:
        raise ValueError(f"something is not a number ({error})") from None
    if table.ndim != 2:
        raise ValueError("there are no rows of numbers")
    low, high = PLAUSIBLE_NM
    if not ((table[:, 0] >= low) & (table[:, 0] <= high)).all():
        raise ValueError(f"{WAVELENGTH} is expected from {low:g} to {high:g} nm in every row")
    return table


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True
