"""Files of measured curves in several formats: named curves over wavelength.

Supported formats are JSON of rawtoaces, of LSPDD and of a gel catalogue (color-filter-sds), and
text tables: `wavelength_nm` followed by one column per curve, and σ of the curve NAME in
`NAME_sigma`; `name,wavelength_nm,value` in long form; and without a header wavelength and R, G, B
(Jiang et al. 2013) or wavelength and value.
"""

import csv
import json
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias, TypeVar

import numpy as np

from labrig.errors import UsageError
from labrig.input_file import read_text
from labrig.optics.piecewise import FloatArray
from labrig.optics.spectrum import Spectrum, Transmittance
from labrig.yaml_file import did_you_mean

#: Wavelengths, values and σ of a curve.
Columns: TypeAlias = tuple[FloatArray, FloatArray, FloatArray | None]
#: Columns by the name of the curve; the only curve of a file without names is called "".
Curves: TypeAlias = dict[str, Columns]

WAVELENGTH = "wavelength_nm"
#: End of the name of the column with σ of another one.
SIGMA = "_sigma"
_UNNAMED = {2: ("",), 4: ("R", "G", "B")}
_EXPECTED_TEXT = (
    "expected a header that begins with wavelength_nm or name,wavelength_nm; or, without a header, "
    "wavelength and value, or wavelength, R, G and B"
)
#: Range of wavelengths in nm, which excludes tables in µm or in Hz.
PLAUSIBLE_NM = (100.0, 20_000.0)


def curves_from_text(text: str) -> tuple[str, Curves]:
    """Return the title, which may be empty, and the curves of a table by name.

    Raises
    ------
    ValueError
        The text is no such table.
    """
    lines = [line for line in text.splitlines() if line.strip()]
    rows = _rows([line for line in lines if not line.startswith("#")])
    title = next((line[8:].strip() for line in lines if line.startswith("#Camera:")), "")
    header = rows[0]
    if _is_number(header[0]):
        if len(header) not in _UNNAMED:
            raise ValueError(f"{_EXPECTED_TEXT}; got {len(header)} columns")
        return title, _from_columns(_UNNAMED[len(header)], rows)
    if header[0] == WAVELENGTH and len(header) > 1:
        return title, _from_columns(tuple(header[1:]), rows[1:])
    if header[:2] == ["name", WAVELENGTH] and len(header) == 3:
        return title, _from_long_form(rows[1:])
    raise ValueError(f"{_EXPECTED_TEXT}; got '{','.join(header[:3])}'")


def sorted_columns(wavelength_nm: FloatArray, values: FloatArray) -> Columns:
    """Return rows sorted by wavelength, without σ."""
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
    ragged = next((number for number, row in enumerate(rows) if len(row) != len(rows[0])), None)
    if ragged is not None:
        raise ValueError(
            f"row {ragged + 1} has {len(rows[ragged])} columns, the first has {len(rows[0])}"
        )
    return rows


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


_EXPECTED_JSON = (
    "; expected rawtoaces data, such as R, G and B under every wavelength in "
    "spectral_data.data.main"
)


def curves_from_json(content: Any) -> tuple[str, Curves]:
    """Return the title, which may be empty, and the curves of JSON content by name.

    Raises
    ------
    ValueError
        The content has none of the formats.
    """
    if isinstance(content, dict) and isinstance(content.get("spectraldata"), str):
        return _lspdd(content)
    if isinstance(content, dict) and isinstance(content.get("filters"), dict):
        return "gel catalogue", _gels(content["filters"])
    try:
        return _rawtoaces(content)
    except ValueError as error:
        raise ValueError(f"{error}{_EXPECTED_JSON}") from None


def _lspdd(content: dict[str, Any]) -> tuple[str, Curves]:
    _, curves = curves_from_text(content["spectraldata"].replace("wavelength,", "wavelength_nm,"))
    parts = (content.get(key) for key in ("brand", "category", "lamptype", "id"))
    title = " ".join(str(part) for part in parts if part)
    return title, {title or name: columns for name, columns in curves.items()}


def _gels(filters: dict[str, Any]) -> Curves:
    """Return the gels that have a spectrum."""
    return {
        name: _columns(gel["sd"])
        for name, gel in filters.items()
        if isinstance(gel, dict) and isinstance(gel.get("sd"), dict)
    }


def _rawtoaces(content: Any) -> tuple[str, Curves]:
    table = content
    for key in ("spectral_data", "data", "main"):
        if not isinstance(table, dict) or key not in table:
            raise ValueError(f"the key '{key}' is missing")
        table = table[key]
    if not isinstance(table, dict) or len(table) < 2:
        raise ValueError("there are fewer than two wavelengths")
    wavelength_nm, values, _ = _columns(table)
    if values.ndim == 1:
        values = values[:, np.newaxis]
    names = _entry(content["spectral_data"], "index", "main")
    if names is None:
        names = ["R", "G", "B"]
    if not isinstance(names, list) or values.shape[1] != len(names):
        raise ValueError("some wavelength has not one value for every name in index.main")
    title = " ".join(
        str(part)
        for part in (_entry(content, "header", key) for key in ("manufacturer", "model"))
        if part
    )
    return title, {
        str(name): (wavelength_nm, values[:, column], None) for column, name in enumerate(names)
    }


def _columns(table: dict[str, Any]) -> Columns:
    try:
        wavelength_nm = np.array([float(key) for key in table])
        values = np.array(list(table.values()), dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError("something is not a number") from None
    return sorted_columns(wavelength_nm, values)


def _entry(content: dict[str, Any], section: str, key: str) -> Any:
    """Return `content[section][key]`, or None if it is missing."""
    part = content.get(section)
    return part.get(key) if isinstance(part, dict) else None


T = TypeVar("T")

#: Largest number of names listed in a message.
LISTED = 8


class Curve(NamedTuple):
    """One curve of a file, sorted by wavelength, otherwise unchecked."""

    wavelength_nm: FloatArray
    value: FloatArray
    sigma: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class CurveFile:
    """Curves of a file.

    Attributes
    ----------
    path
        Path of the file.
    title
        Maker and model or another title in the file; else the file's name.
    curves
        Curves by name, in the file's order.
    """

    path: Path
    title: str
    curves: Mapping[str, Curve]

    def pick(self, name: str | None) -> tuple[str, Curve]:
        """Return the name and the curve of that name, or of the only one.

        Raises
        ------
        UsageError
            There is no such curve, or there are several and no name is given.
        """
        if name is None:
            if len(self.curves) == 1:
                return next(iter(self.curves.items()))
            listed = ", ".join(list(self.curves)[:LISTED])
            ellipsis = ", …" if len(self.curves) > LISTED else ""
            raise UsageError(
                f"{self.path}: expected one curve, got {len(self.curves)} "
                f"({listed}{ellipsis}); name one"
            )
        if name not in self.curves:
            names = list(self.curves)
            hint = (
                did_you_mean(name, names)
                if len(names) <= LISTED or _has_close_match(name, names)
                else (f"it has {len(names)}, such as {', '.join(names[:LISTED])}")
            )
            raise UsageError(f"{self.path}: no curve is called '{name}'; {hint}")
        return name, self.curves[name]


def read_curve_file(path: str | os.PathLike[str]) -> CurveFile:
    r"""Read all curves of a file.

    Parameters
    ----------
    path
        Path of a JSON file (rawtoaces, LSPDD, color-filter-sds) or of a text table.

    Returns
    -------
    CurveFile
        The curves by name, each sorted by wavelength, otherwise unchecked.

    Raises
    ------
    UsageError
        The file cannot be read, or it has none of these formats.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.optics import read_curve_file
    >>> _ = Path("leds.csv").write_text("wavelength_nm,blue,red\n450,1,0\n550,0.1,0.2\n650,0,1\n")
    >>> file = read_curve_file("leds.csv")
    >>> file.title, list(file.curves)
    ('leds', ['blue', 'red'])
    >>> file.curves["red"].value.tolist()
    [0.0, 0.2, 1.0]
    """
    file_path = Path(path)
    text = read_text(file_path)
    if file_path.suffix.lower() == ".json":
        try:
            content = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise UsageError(f"{file_path}: not JSON ({' '.join(str(error).split())})") from None
        title, curves = checked(file_path, curves_from_json, content)
    else:
        title, curves = checked(file_path, curves_from_text, text)
    sorted_curves = {(name or file_path.stem): Curve(*columns) for name, columns in curves.items()}
    return CurveFile(file_path, title or file_path.stem, sorted_curves)


def read_spectrum(path: str | os.PathLike[str], name: str | None = None) -> Spectrum:
    r"""Read the spectrum of a lamp, an emission … from a file.

    Parameters
    ----------
    path
        Path of a curve file in any format of `read_curve_file`.
    name
        Name of the curve in the file; not needed where there is only one.

    Returns
    -------
    Spectrum
        The checked curve, with σ where the file has it.

    Raises
    ------
    UsageError
        The file is malformed, has no curve of that name, or the curve is invalid.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.optics import read_spectrum
    >>> _ = Path("lamp.csv").write_text("wavelength_nm,value\n400,0.5\n500,1.0\n600,1.2\n")
    >>> lamp = read_spectrum("lamp.csv")
    >>> lamp.name, lamp.at([450, 550, 700]).round(3).tolist()
    ('lamp', [0.75, 1.1, 0.0])
    """
    file = read_curve_file(path)
    curve_name, curve = file.pick(name)
    return checked(f"{file.path}: {curve_name}", lambda c: Spectrum(curve_name, *c), curve)


def read_transmittance(path: str | os.PathLike[str], name: str | None = None) -> Transmittance:
    r"""Read the transmittance of a filter or the reflectance of a grey card from a file.

    Parameters
    ----------
    path
        Path of a curve file in any format of `read_curve_file`.
    name
        Name of the curve in the file; not needed where there is only one.

    Returns
    -------
    Transmittance
        The checked curve of fractions from 0 to 1.

    Raises
    ------
    UsageError
        The file is malformed, has no curve of that name, or its values are no fractions.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.optics import read_transmittance
    >>> _ = Path("card.csv").write_text("wavelength_nm,value\n400,0.17\n500,0.18\n700,0.18\n")
    >>> card = read_transmittance("card.csv")
    >>> card.at([450, 800]).round(3).tolist()
    [0.175, 0.18]
    """
    file = read_curve_file(path)
    curve_name, curve = file.pick(name)
    return checked(f"{file.path}: {curve_name}", lambda c: Transmittance(curve_name, *c), curve)


ContentT = TypeVar("ContentT")


def checked(place: object, make: Callable[[ContentT], T], content: ContentT) -> T:
    """Return `make(content)`; a ValueError becomes a UsageError in one line about `place`."""
    try:
        return make(content)
    except ValueError as error:
        raise UsageError(f"{place}: {error}") from None


def _has_close_match(name: str, names: list[str]) -> bool:
    return "did you mean" in did_you_mean(name, names)
