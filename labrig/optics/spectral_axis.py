"""Axis of a spectrum: wavelengths, wavenumbers, photon energies or frequencies, in nm.

Wavelengths count as those in air wherever a file does not say more: the 0.03 % to those in a
vacuum, which an energy or a wavenumber means, are less than the pass band of most spectrometers.
"""

import re
import unicodedata
from enum import Enum

import numpy as np

from labrig.foundation.arrays import FloatArray

#: Range of wavelengths in nm, which excludes tables in µm or in Hz.
PLAUSIBLE_NM = (100.0, 20_000.0)
#: Range in nm of an axis without a unit: beyond it are wavenumbers, Å, numbers of pixels.
UNSTATED_NM = (150.0, 3000.0)


class AxisUnit(Enum):
    """Unit of a spectrum's axis: its symbol, its size in nm, whether the axis is reciprocal."""

    NM = ("nm", 1.0, False)
    ANGSTROM = ("Å", 0.1, False)
    UM = ("µm", 1e3, False)
    PER_CM = ("cm⁻¹", 1e7, True)
    # h c / e and c, exact in the SI of 2019.
    EV = ("eV", 1239.8419843320026, True)
    THZ = ("THz", 299_792.458, True)

    def __init__(self, symbol: str, size_nm: float, is_reciprocal: bool) -> None:
        self.symbol = symbol
        self.size_nm = size_nm
        self.is_reciprocal = is_reciprocal

    def in_nm(self, axis: FloatArray) -> FloatArray:
        """Return the wavelengths in nm of an axis in this unit."""
        if not self.is_reciprocal:
            return axis * self.size_nm
        with np.errstate(divide="ignore"):
            return self.size_nm / axis


_UNITS = {
    word: unit
    for unit, words in (
        (AxisUnit.NM, "nm nanometer nanometers nanometre nanometres"),
        (AxisUnit.ANGSTROM, "å angstrom angstroms ångström ångstrom angström aa"),
        (AxisUnit.UM, "μm um micron microns micrometer micrometers micrometre mikrometer"),
        (AxisUnit.PER_CM, "cm-1 cm^-1 1/cm /cm kayser kaysers"),
        (AxisUnit.EV, "ev electronvolt electronvolts"),
        (AxisUnit.THZ, "thz terahertz"),
    )
    for word in words.split()
}
_WAVELENGTH = (
    "wavelength", "wavelengths", "wave length", "wave", "wl", "lambda", "λ", "wellenlänge",
    "longueur d'onde", "longitud de onda", "lunghezza d'onda",
)  # fmt: skip
_WAVENUMBER = ("wavenumber", "wavenumbers", "wave number", "wellenzahl", "nombre d'onde")
_ENERGY = ("energy", "photon energy", "energie", "frequency", "frequenz")
#: Axes over which a table is no spectrum of light.
_OTHER_AXES = (
    "raman shift", "raman", "shift", "pixel", "pixels", "time", "temperature", "delay",
    "2theta", "binding energy", "kinetic energy",
)  # fmt: skip
#: What follows the name: a unit in brackets, after a slash, a comma, a blank, `_` or `in`.
_AFTER_NAME = re.compile(r"[\s_.,]*[\s_.,/(\[]\s*(?:in )?(.*?)\s*[)\]]?")
_NAMES = (*_WAVELENGTH, *_WAVENUMBER, *_ENERGY)


def plain(text: str) -> str:
    """Return a name or a unit in lower case, with one sign for each that is written in two ways."""
    same = unicodedata.normalize("NFKC", text).lower()
    for old, new in (("−", "-"), ("–", "-"), ("’", "'"), ("`", "'"), ("^-", "-"), ("å", "å")):
        same = same.replace(old, new)
    return " ".join(same.strip(" \t#:=\"'").split())


def axis_unit(text: str) -> AxisUnit | None:
    """Return the unit of a spectrum's axis that a text is; None if it is none."""
    word = plain(text).strip(" ()[]{}./,;")
    # The stripped point and slash belong to some units.
    return _UNITS.get(word) or _UNITS.get(plain(text).strip(" ()[]{}"))


def read_axis(name: str, unit: str) -> tuple[bool, AxisUnit | None]:
    """Return whether a column is a spectrum's axis, and its unit where it is stated.

    Parameters
    ----------
    name
        Name of the column, perhaps with its unit, as in `wavelength_nm` or `Wave length/µm`.
    unit
        Unit of the column where it stands apart; else empty.

    Raises
    ------
    ValueError
        The column is the axis of something else than a spectrum, such as `Raman shift`, or of
        energies or frequencies without a unit.
    """
    text = plain(name).strip(".")
    shown = " ".join(name.split())
    if axis_unit(text) is not None:
        return True, axis_unit(unit) or axis_unit(text)
    base, inner = _split(text)
    stated = axis_unit(unit) or axis_unit(inner)
    if base in _OTHER_AXES:
        raise ValueError(f"expected an axis of wavelengths, got '{shown}'")
    if base not in _NAMES:
        return False, None
    if stated is not None:
        return True, stated
    if unit or inner:
        raise ValueError(
            f"expected an axis in nm, Å, µm, cm⁻¹, eV or THz, got '{shown}'"
            + (f" in '{unit}'" if unit else "")
        )
    if base in _ENERGY:
        raise ValueError(
            f"expected the unit of '{shown}', such as eV, got none; write it into the header"
        )
    return True, AxisUnit.PER_CM if base in _WAVENUMBER else None


def _split(text: str) -> tuple[str, str]:
    """Divide a plain name into that of the axis and what follows it, perhaps its unit."""
    for name in sorted((*_NAMES, *_OTHER_AXES), key=len, reverse=True):
        if text == name:
            return name, ""
        if text.startswith(name) and (inner := _AFTER_NAME.fullmatch(text[len(name) :])):
            return name, inner[1]
    return text, ""


def wavelengths_nm(axis: FloatArray, unit: AxisUnit | None) -> FloatArray:
    """Return the wavelengths in nm of an axis; without a unit it is taken for nm.

    Raises
    ------
    ValueError
        These are no wavelengths of light, or without a unit they need not be nm.
    """
    low, high = UNSTATED_NM if unit is None else PLAUSIBLE_NM
    nm = (unit or AxisUnit.NM).in_nm(axis)
    if ((nm >= low) & (nm <= high)).all():
        return nm
    got = f"{axis.min():g} to {axis.max():g}"
    if unit is None:
        raise ValueError(
            f"expected the unit of the first column, got none with {got}, which need not be nm; "
            "write a header, such as wavelength_nm,value"
        )
    of_unit = "" if unit is AxisUnit.NM else f" (from {unit.symbol})"
    raise ValueError(
        f"expected wavelengths from {low:g} to {high:g} nm{of_unit}, got {got} {unit.symbol}"
    )
