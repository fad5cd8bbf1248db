"""Files of measured curves in several formats: named curves over wavelength.

Supported are tables of labrig's own form, the texts of spectrometers and their programs, and JSON
of rawtoaces, of LSPDD and of a gel catalogue (color-filter-sds).
"""

import json
import logging
import os
from collections.abc import Callable, Container, Mapping
from dataclasses import dataclass, field
from itertools import starmap
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.foundation.input_file import MAX_JSON_BYTES, read_text
from labrig.foundation.yaml_file import did_you_mean
from labrig.optics.curve_table import (
    Columns,
    Curves,
    NamedCurve,
    curves_from_table,
    is_own_table,
    sorted_columns,
)
from labrig.optics.instrument_spectra import foreign_spectra
from labrig.optics.spectral_columns import Quantity, read_ordinate
from labrig.optics.spectrum import Spectrum, Transmittance
from labrig.text_table import read_table_text

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
    _, curves = curves_from_table(content["spectraldata"].replace("wavelength,", "wavelength_nm,"))
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


_logger = logging.getLogger(__name__)

T = TypeVar("T")

_GOT = {
    Quantity.LIGHT: "light, such as counts",
    Quantity.TRANSMITTANCE: "a transmittance or absorbance",
    Quantity.REFLECTANCE: "a reflectance",
    Quantity.OTHER_DENSITY: "light over wavenumbers, energies or frequencies",
    Quantity.UNKNOWN: "values whose meaning is not stated",
}
_OTHER = "give another file or column"
_REMEDY = {
    Quantity.LIGHT: _OTHER,
    Quantity.TRANSMITTANCE: _OTHER,
    Quantity.REFLECTANCE: _OTHER,
    Quantity.OTHER_DENSITY: "whether it is per nm the file does not say: export it over wavelength",
    Quantity.UNKNOWN: "write above the columns what they are, such as wavelength_nm,absorbance or, "
    "for fractions, wavelength_nm,value",
}
#: Largest number of names listed in a message.
LISTED = 8
#: What a curve of a file may be where light, or a fraction of it, is wanted.
_LIGHT = (None, Quantity.LIGHT, Quantity.UNKNOWN)
_FRACTION = (None, Quantity.TRANSMITTANCE, Quantity.REFLECTANCE)


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
    quantities
        What the values of a curve are, where the file says so or leaves it open; labrig's own
        tables leave it to their use.
    notes
        What was converted, taken or left out to read a curve, in words.
    """

    path: Path
    title: str
    curves: Mapping[str, Curve]
    quantities: Mapping[str, Quantity] = field(default_factory=dict)
    notes: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

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
    if file_path.suffix.lower() == ".json":
        try:
            content = json.loads(read_text(file_path, MAX_JSON_BYTES))
        except (ValueError, RecursionError) as error:
            raise UsageError(f"{file_path}: not JSON ({' '.join(str(error).split())})") from None
        title, curves = checked(file_path, curves_from_json, content)
        return CurveFile(file_path, title or file_path.stem, _named(curves, file_path))
    text = read_table_text(file_path)
    if is_own_table(text):
        title, curves = checked(file_path, curves_from_table, text)
        spectra = checked(file_path, lambda curves: list(starmap(_own, curves.items())), curves)
    else:
        ending = file_path.suffix.removeprefix(".").lower()
        title, spectra = "", checked(file_path, lambda text: foreign_spectra(text, ending), text)
    named = {spectrum.name or file_path.stem: spectrum for spectrum in spectra}
    return CurveFile(
        file_path,
        title or file_path.stem,
        {name: Curve(*spectrum.columns) for name, spectrum in named.items()},
        {name: one.quantity for name, one in named.items() if one.quantity},
        {name: spectrum.notes for name, spectrum in named.items() if spectrum.notes},
    )


def _own(name: str, columns: Columns) -> NamedCurve:
    """Return a curve of labrig's own table, linear where its name is that of a quantity."""
    ordinate = read_ordinate(name, whole_name=True)
    if ordinate.quantity is Quantity.UNKNOWN:
        return NamedCurve(name, columns)
    wavelength_nm, values, sigma = columns
    values, sigma, done = ordinate.linear(values, sigma)
    notes = (f"column '{name}': {done}",) if done else ()
    return NamedCurve(name, (wavelength_nm, values, sigma), ordinate.quantity, notes)


def _named(curves: Mapping[str, Columns], path: Path) -> dict[str, Curve]:
    return {name or path.stem: Curve(*columns) for name, columns in curves.items()}


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
    curve_name, curve = _wanted(file, name, _LIGHT, "a spectrum of light")
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
    curve_name, curve = _wanted(file, name, _FRACTION, "a transmittance or reflectance")
    return checked(f"{file.path}: {curve_name}", lambda c: Transmittance(curve_name, *c), curve)


def _wanted(
    file: CurveFile, name: str | None, quantities: Container[Quantity | None], expected: str
) -> tuple[str, Curve]:
    """Return the name and the curve of that name, or of the only one that can be what is expected.

    What was done to read it is logged.
    """
    if name is None:
        fitting = [name for name in file.curves if file.quantities.get(name) in quantities]
        name = fitting[0] if len(fitting) == 1 else None
    name, curve = file.pick(name)
    quantity = file.quantities.get(name)
    if quantity not in quantities:
        assert quantity is not None
        raise UsageError(
            f"{file.path}: {name}: expected {expected}, got {_GOT[quantity]}; {_REMEDY[quantity]}"
        )
    for note in file.notes.get(name, ()):
        _logger.warning("note: %s: %s: %s", file.path, name, note)
    return name, curve


ContentT = TypeVar("ContentT")


def checked(place: object, make: Callable[[ContentT], T], content: ContentT) -> T:
    """Return `make(content)`; a ValueError becomes a UsageError in one line about `place`."""
    try:
        return make(content)
    except ValueError as error:
        raise UsageError(f"{place}: {error}") from None


def _has_close_match(name: str, names: list[str]) -> bool:
    return "did you mean" in did_you_mean(name, names)
