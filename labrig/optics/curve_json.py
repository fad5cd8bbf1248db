"""Curves in JSON: of rawtoaces, of LSPDD, and of a gel catalogue (color-filter-sds)."""

from typing import Any

import numpy as np

from labrig.optics.curve_table import Columns, Curves, curves_from_table, sorted_columns

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
