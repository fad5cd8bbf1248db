"""Columns of a spectrum in a text: the axis in nm, the values linear, by their names and units.

Fractions of light become fractions: from per cent, and from absorbance A by 10^-A. Irradiances and
radiances become W m⁻² nm⁻¹ (sr⁻¹). What has no such meaning, such as a column in dB, is refused by
its name.

Wavelengths count as those in air wherever a file does not say more: the 0.03 % to those in a
vacuum, which an energy or a wavenumber means, are less than the pass band of most spectrometers.
"""

import re
import unicodedata
from dataclasses import dataclass
from enum import Enum
from math import log, log10

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.optics.spectrum import FRACTION_SLACK

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
        raise ValueError(
            f"expected a column of wavelengths, got '{shown}'; call it wavelength_nm if it has them"
        )
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


#: Largest value from which fractions whose unit is not stated must be per cent. Between fractions
#: and this, a dark filter in per cent and a noisy one in fractions look alike.
_SURELY_PER_CENT = 2.0


class Quantity(Enum):
    """Quantity that the values of a curve are."""

    LIGHT = "light"
    TRANSMITTANCE = "transmittance"
    REFLECTANCE = "reflectance"
    OTHER_DENSITY = "light over wavenumbers or energies"
    UNKNOWN = "of unknown meaning"


class _Form(Enum):
    LINEAR = "linear"
    PER_CENT = "per cent"
    ABSORBANCE = "absorbance"
    UNSTATED = "a fraction or per cent"


@dataclass(frozen=True)
class Ordinate:
    """Quantity in a column, and the form in which it is written.

    Attributes
    ----------
    quantity
        What the values are afterwards.
    form
        How the column holds them.
    factor
        Factor of the linear values; of absorbance before it becomes a fraction.
    per
        Unit of the axis per which light is given, such as `nm`; empty where it is not stated.
    unit
        Unit of the values afterwards, where they have one.
    """

    quantity: Quantity
    form: _Form = _Form.LINEAR
    factor: float = 1.0
    per: str = ""
    unit: str = ""

    def linear(
        self, values: FloatArray, sigma: FloatArray | None
    ) -> tuple[FloatArray, FloatArray | None, str]:
        """Return linear values, their σ, and in words what was done, nothing if nothing was.

        Raises
        ------
        ValueError
            The values may be fractions as well as per cent, or are no absorbances.
        """
        if self.form is _Form.ABSORBANCE:
            if np.abs(values * self.factor).max() > _MAX_ABSORBANCE:
                raise ValueError(
                    f"expected absorbances up to {_MAX_ABSORBANCE:g}, got "
                    f"{np.abs(values * self.factor).max():g}"
                )
            fraction = 10.0 ** -(values * self.factor)
            if sigma is not None:
                sigma = fraction * log(10) * self.factor * sigma
            milli = "" if self.factor == 1 else f" of {log10(self.factor):+.0f} decades"
            return fraction, sigma, f"absorbance A{milli}, read as {self.quantity.value} 10^-A"
        if self.form is _Form.UNSTATED:
            return self._by_range(values).linear(values, sigma)
        if self.factor == 1.0:
            return values, sigma, ""
        scaled = None if sigma is None else sigma * self.factor
        what = f"{self.quantity.value} in per cent, divided by 100"
        if self.form is not _Form.PER_CENT:
            what = f"multiplied by {self.factor:g} to be in {self.unit}"
        return values * self.factor, scaled, what

    def _by_range(self, values: FloatArray) -> "Ordinate":
        """Return what fractions without a unit are, by the largest of them."""
        highest = float(np.abs(values).max())
        if highest <= 1 + FRACTION_SLACK:
            return Ordinate(self.quantity)
        if highest > _SURELY_PER_CENT:
            return Ordinate(self.quantity, _Form.PER_CENT, 0.01)
        raise ValueError(
            f"expected a {self.quantity.value} in per cent or as a fraction, got values up to "
            f"{highest:g} without a unit; write % or 'fraction' into the column's name"
        )


#: Absorbance that no instrument measures.
_MAX_ABSORBANCE = 20.0
UNKNOWN = Ordinate(Quantity.UNKNOWN)

_REFUSED = {
    re.compile(pattern): advice
    for pattern, advice in (
        (r"\bdbm?\b", "is in decibels"),
        (r"\b(kubelka|k/s|f\(r\))", "is a Kubelka-Munk function"),
        (r"deriv|d\(abs|\bd[ay]/d", "is a derivative"),
        (
            r"absorptance|absorptivity|molar|(absor|extin|atten)\w* ?[ck]oeff|"
            r"cross.?section|absorption.*%|%.*absorption|"
            r"^ε|^epsilon|^1 ?- ?[rt]\b",
            "is neither transmittance nor absorbance",
        ),
        (r"\b(ln|lg)\b|\b(log|log10)\b(?! *\( *1 */ *[rt]\b)", "is a logarithm"),
        (r"[‰‱]|\bpp[mb]\b|\bper ?mille\b|\bpromille\b", "is in other parts than per cent"),
        (r"\b[µμu]?mol\b|photons? ?(/|per|s-1)|quanta", "counts photons, not energy"),
    )
}
_ABSORBANCE = re.compile(
    r"abs|absorbance|absorbanz|absorption|extinction|extinktion|od|optical ?density|"
    r"optische dichte|densité optique|m?au|log10 ?\(1/[rt]\)|log ?\(1/[rt]\)"
)
_TRANSMITTANCE = re.compile(
    r"t|trans|transm|transmittance|transmission|transmissivity|transmissionsgrad|transmisson|"
    r"transmisión|transmissão|trasmissione|trasmittanza|transmitancia|durchlässigkeit|durchlass"
)
_REFLECTANCE = re.compile(
    r"r|refl|reflectance|reflection|reflectivity|reflexion|reflexionsgrad|remission|réflectance|"
    r"reflectancia|albedo"
)
_LIGHT_WORDS = frozenset(
    {
        "count", "counts", "intensity", "intensität", "intensité", "intensidad", "int",
        "irradiance", "radiance", "exitance", "emission", "fluorescence", "luminescence",
        "photoluminescence", "pl", "scope", "power", "flux", "signal", "cps", "kcps", "raw",
        "voltage", "mv", "v", "volts", "ee", "le", "adu", "dn", "lsb", "s1", "s1c", "s1/r1",
        "s1c/r1", "s1c/r1c", "irr",
    }
)  # fmt: skip
_WORDS = re.compile(r"[^\W\d_][\w'./]*")
_PER_CENT_WORDS = re.compile(r"%|\b(percent|per cent|prozent|pct|pour cent)\b")
_FRACTION_WORDS = re.compile(r"\b(fraction|frac|anteil|0-1|0\.\.1)\b")
_BRACKETS = re.compile(r"[(\[].*?[)\]]")


def read_ordinate(name: str, unit: str = "", *, whole_name: bool = False) -> Ordinate:
    """Return what the values of a column are.

    Parameters
    ----------
    name
        Name of the column, perhaps with its unit, such as `Abs`, `T (%)`, `Intensity (counts)`.
    unit
        Unit of the column where it stands apart; else empty.
    whole_name
        Whether the name must be that of a quantity and nothing else, as where columns are called
        after samples.

    Raises
    ------
    ValueError
        The column holds something that cannot become a spectrum.
    """
    text = f"{plain(name)} ({plain(unit)})" if unit else plain(name)
    spaced = text.replace("_", " ")
    if not whole_name:
        for pattern, what in _REFUSED.items():
            if pattern.search(spaced):
                raise ValueError(f"the column '{' '.join(name.split())}' {what}; convert it first")
    if fraction := _fraction_of_light(spaced, whole_name):
        return fraction
    if whole_name:
        # A unit in brackets is a unit, whatever the curve is called.
        if re.search(r"\bdbm?\b", plain(_in_brackets(name))):
            raise ValueError(f"the column '{name}' is in decibels; convert it first")
        return _irradiance(_in_brackets(name)) or UNKNOWN
    for text in (unit, _in_brackets(name), name):
        if irradiance := _irradiance(text):
            return irradiance
    words = {word.strip("./'") for word in _WORDS.findall(spaced)}
    return Ordinate(Quantity.LIGHT) if words & _LIGHT_WORDS else UNKNOWN


def _fraction_of_light(text: str, whole_name: bool) -> Ordinate | None:
    is_per_cent = _PER_CENT_WORDS.search(text) is not None
    is_fraction = _FRACTION_WORDS.search(text) is not None
    bare = _FRACTION_WORDS.sub(" ", _PER_CENT_WORDS.sub(" ", text))
    unit = _in_brackets(bare)
    bare = " ".join(re.sub(r"[()\[\]/,:]", " ", _BRACKETS.sub(" ", bare)).split())
    # `log(1/R)` lost its brackets, and so does nothing else.
    if re.search(r"log(10)? ?\( ?1 ?/ ?r ?\)", text):
        return Ordinate(Quantity.REFLECTANCE, _Form.ABSORBANCE)
    if re.search(r"log(10)? ?\( ?1 ?/ ?t ?\)", text):
        return Ordinate(Quantity.TRANSMITTANCE, _Form.ABSORBANCE)
    names = [bare] if whole_name else [bare, *bare.split()]
    for meaning, quantity in (
        (_TRANSMITTANCE, Quantity.TRANSMITTANCE),
        (_REFLECTANCE, Quantity.REFLECTANCE),
    ):
        # A letter alone means something where the unit says of what kind it is, or nothing else is.
        found = [word for word in names if meaning.fullmatch(word)]
        if any(len(word) > 1 for word in found) or (bare in found and (is_per_cent or is_fraction)):
            if is_per_cent:
                return Ordinate(quantity, _Form.PER_CENT, 0.01)
            return Ordinate(quantity, _Form.LINEAR if is_fraction else _Form.UNSTATED)
    if is_per_cent:
        return None
    if any(_ABSORBANCE.fullmatch(word) for word in names):
        milli = unit in ("mau", "mabs") or bare in ("mau", "mabs")
        return Ordinate(Quantity.TRANSMITTANCE, _Form.ABSORBANCE, 1e-3 if milli else 1.0)
    return None


def _in_brackets(name: str) -> str:
    match = re.search(r"[(\[]\s*(.*)\s*[)\]]", name)
    return match[1] if match else ""


_PREFIXES = {"": 1.0, "k": 1e3, "m": 1e-3, "µ": 1e-6, "μ": 1e-6, "u": 1e-6, "n": 1e-9, "p": 1e-12}
_AREAS_M2 = {"m2": 1.0, "cm2": 1e-4, "mm2": 1e-6, "sqm": 1.0, "sqcm": 1e-4}
_LENGTHS_NM = {"nm": 1.0, "µm": 1e3, "μm": 1e3, "um": 1e3, "å": 0.1, "a": 0.1, "m": 1e9}
_SYMBOL = re.compile(r"([a-zµμå]+)\^?(-?\d)?")


def _irradiance(unit: str) -> Ordinate | None:
    """Return the ordinate of an irradiance or a radiance per nm, such as `µW/cm²/nm`.

    A unit without power, area and wavelength is none of these.
    """
    # A slash divides by all that follows, as instruments write it.
    over, slash, under = plain(unit).replace("**", "^").partition("/")
    factor, dimensions = 1.0, set()
    for text, is_under in ((over, False), (under if slash else "", True)):
        for symbol, exponent in _SYMBOL.findall(text):
            power = int(exponent or 1) * (-1 if is_under else 1)
            joined = f"{symbol}{abs(power)}" if abs(power) > 1 else symbol
            if joined in _AREAS_M2 and power < 0:
                dimensions.add("area")
                factor /= _AREAS_M2[joined]
            elif symbol in _LENGTHS_NM and power == -1:
                dimensions.add("length")
                factor /= _LENGTHS_NM[symbol]
            elif symbol == "sr" and power == -1:
                dimensions.add("angle")
            elif symbol.endswith("w") and symbol[:-1] in _PREFIXES and power == 1:
                dimensions.add("power")
                factor *= _PREFIXES[symbol[:-1]]
            else:
                return None
    if not {"power", "area", "length"} <= dimensions:
        return None
    written = "W m⁻² nm⁻¹ sr⁻¹" if "angle" in dimensions else "W m⁻² nm⁻¹"
    # What should be 1 is 1.
    return Ordinate(Quantity.LIGHT, factor=float(f"{factor:.12g}"), per="nm", unit=written)
