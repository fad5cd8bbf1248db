"""Tables of curves in labrig's own form.

The header is `wavelength_nm` followed by one column per curve, σ of the curve NAME in `NAME_sigma`;
or `name,wavelength_nm,value`, with the curves one below the other. Four columns without a header
are wavelength, R, G and B (Jiang et al. 2013). Commas or blanks are between; or semicolons, and
then numbers may have decimal commas.
"""

import csv
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.optics.spectral_columns import PLAUSIBLE_NM, Quantity
from labrig.text_table import plain_text

#: Wavelengths, values and σ of a curve.
Columns: TypeAlias = tuple[FloatArray, FloatArray, FloatArray | None]
#: Columns by the name of the curve; the only curve of a file without names is called "".
Curves: TypeAlias = dict[str, Columns]


@dataclass(frozen=True, eq=False)
class NamedCurve:
    """A curve of a file.

    Attributes
    ----------
    name
        Name of the sample or of the column; empty if neither is named.
    columns
        Wavelengths in nm, linear values and their σ, sorted by wavelength.
    quantity
        What the values are; None leaves it to their use.
    notes
        What was converted, taken or left out, in words.
    """

    name: str
    columns: Columns
    quantity: Quantity | None = None
    notes: tuple[str, ...] = ()


WAVELENGTH = "wavelength_nm"
#: End of the name of the column with σ of another one.
SIGMA = "_sigma"
_CHANNELS = ("R", "G", "B")


def is_own_table(text: str) -> bool:
    """Return whether a text is a table in this form, rather than one of another program."""
    content = _content(text)
    if not content:
        return True
    header = content[0]
    cells = [cell.strip() for cell in header.split(_separator(header))]
    if WAVELENGTH in (cells[0], *cells[1:2]):
        return cells[0] == WAVELENGTH or cells[0] == "name"
    # JCAMP-DX has several values of one spectrum in a row.
    is_jcamp = "XYDATA" in text
    return len(cells) == 1 + len(_CHANNELS) and all(map(_is_number, cells)) and not is_jcamp


def curves_from_table(text: str) -> tuple[str, Curves]:
    """Return the title, which may be empty, and the curves of a table by name.

    Raises
    ------
    ValueError
        The text is no such table.
    """
    rows = _rows(_content(text))
    titles = (line[8:].strip() for line in text.splitlines() if line.startswith("#Camera:"))
    title = plain_text(next(titles, ""))
    header = rows[0]
    if _is_number(header[0]):
        return title, _from_columns(_CHANNELS, rows)
    if header[0] == WAVELENGTH and len(header) > 1:
        return title, _from_columns(tuple(header[1:]), rows[1:])
    if header[:2] == ["name", WAVELENGTH] and len(header) == 3:
        return title, _from_long_form(rows[1:])
    raise ValueError(
        "expected a header wavelength_nm and a name for each curve, or name,wavelength_nm,value; "
        f"got '{','.join(header[:3])}'"
    )


def _content(text: str) -> list[str]:
    """Return the lines that are neither blank nor comments."""
    return [line for line in text.splitlines() if line.strip() and not line.startswith("#")]


def _separator(header: str) -> str | None:
    return next((mark for mark in ("\t", ";", ",") if mark in header), None)


def sorted_columns(wavelength_nm: FloatArray, values: FloatArray) -> Columns:
    """Return rows sorted by wavelength, without σ.

    Raises
    ------
    ValueError
        Some wavelength is not one of light.
    """
    low, high = PLAUSIBLE_NM
    if not ((wavelength_nm >= low) & (wavelength_nm <= high)).all():
        raise ValueError(f"{WAVELENGTH} is expected from {low:g} to {high:g} nm in every row")
    order = np.argsort(wavelength_nm, kind="stable")
    return wavelength_nm[order], values[order], None


def _rows(lines: list[str]) -> list[list[str]]:
    if not lines:
        raise ValueError("there is nothing in it")
    separator = _separator(lines[0])
    try:
        rows = (
            list(csv.reader(lines, delimiter=separator))
            if separator
            else [line.split() for line in lines]
        )
    except csv.Error as error:
        raise ValueError(f"not a table ({error})") from None
    rows = [[cell.strip() for cell in row] for row in rows]
    ragged = next((number for number, row in enumerate(rows) if len(row) != len(rows[0])), None)
    if ragged is not None:
        raise ValueError(
            f"row {ragged + 1} has {len(rows[ragged])} columns, the first has {len(rows[0])}"
        )
    if separator == ";":
        # Programs separate columns by semicolons where the comma is the decimal mark.
        rows[1:] = [[_with_point(cell) for cell in row] for row in rows[1:]]
    return rows


def _with_point(cell: str) -> str:
    with_point = cell.replace(",", ".")
    return with_point if _is_number(with_point) else cell


def _from_columns(names: tuple[str, ...], rows: list[list[str]]) -> Curves:
    if len(set(names)) < len(names):
        duplicate = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"the column '{duplicate}' stands twice")
    table = _numbers(rows)
    wavelength_nm, values, _ = sorted_columns(table[:, 0], table[:, 1:])
    if names in (("value",), ("value", "sigma")):
        sigma = values[:, 1] if len(names) == 2 else None
        return {"": (wavelength_nm, values[:, 0], sigma)}
    columns = dict(zip(names, values.T, strict=True))
    return {
        name: (wavelength_nm, column, columns.get(f"{name}{SIGMA}"))
        for name, column in columns.items()
        if name.removesuffix(SIGMA) == name or name.removesuffix(SIGMA) not in columns
    }


def _from_long_form(rows: list[list[str]]) -> Curves:
    rows_by_name: dict[str, list[list[str]]] = {}
    for row in rows:
        rows_by_name.setdefault(row[0], []).append(row[1:])
    tables = {name: _numbers(part) for name, part in rows_by_name.items()}
    return {name: sorted_columns(table[:, 0], table[:, 1]) for name, table in tables.items()}


def _numbers(rows: list[list[str]]) -> FloatArray:
    try:
        table = np.array(rows, dtype=np.float64)
    except ValueError as error:
        raise ValueError(f"something is not a number ({error})") from None
    if table.ndim != 2:
        raise ValueError("there are no rows of numbers")
    return table


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True
