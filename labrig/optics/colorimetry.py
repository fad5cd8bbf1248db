"""Standard observers, illuminants, CIELAB, colour differences and sRGB.

The observer and the illuminants that every command needs, and CIELAB, are labrig's own, since
colour-science takes more than a second to load; all else is from there.
"""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from labrig.foundation import colour_science
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.foundation.input_file import read_text
from labrig.foundation.yaml_file import did_you_mean
from labrig.optics.spectrum import Spectrum

CIE_1931 = "CIE 1931 2 Degree Standard Observer"
CIE_2015 = "CIE 2015 2 Degree Standard Observer"

#: Table of wavelength in nm and x̄, ȳ, z̄ of `CIE_1931`.
_OBSERVER = Path(__file__).with_name("cie_1931_observer.csv")
#: Table of wavelength in nm and the relative power of the illuminants that its head names.
_ILLUMINANTS = Path(__file__).with_name("cie_illuminants.csv")
#: Limit of the linear part of CIELAB, and its slope and intercept (CIE 15:2018, equations 8.6).
_LAB_LIMIT, _LAB_SLOPE, _LAB_INTERCEPT = (6 / 29) ** 3, (29 / 6) ** 2 / 3, 4 / 29


@dataclass(frozen=True, eq=False)
class Observer:
    """A standard observer.

    Attributes
    ----------
    name
        Name of the observer in colour-science.
    wavelength_nm
        Wavelengths in steps of 1 nm, shape (n,).
    functions
        Colour-matching functions x̄, ȳ, z̄, shape (n, 3).
    """

    name: str
    wavelength_nm: FloatArray
    functions: FloatArray


def observer(name: str) -> Observer:
    """Return a standard observer.

    Parameters
    ----------
    name
        Name in colour-science, such as `CIE_1931`.

    Returns
    -------
    Observer
        Its colour-matching functions.

    Examples
    --------
    >>> from labrig.optics import CIE_1931, observer
    >>> functions = observer(CIE_1931).functions
    >>> [float(round(integral)) for integral in functions.sum(axis=0)]
    [107.0, 107.0, 107.0]
    """
    if name == CIE_1931:
        table_nm, *functions = np.loadtxt(
            read_text(_OBSERVER).splitlines(),
            delimiter=",",
            skiprows=2,
            unpack=True,
            encoding="utf-8",
        )
        return Observer(name, table_nm, np.stack(functions, axis=1))
    table = colour_science.load().MSDS_CMFS[name]
    return Observer(name, np.asarray(table.wavelengths), np.asarray(table.values))


def illuminant(name: str) -> Spectrum:
    """Return a CIE standard illuminant.

    Parameters
    ----------
    name
        Its name, such as `D65`, `A` or `FL2`.

    Returns
    -------
    Spectrum
        Relative spectral power, from 300 nm for D65 and A.

    Raises
    ------
    UsageError
        There is no such illuminant.

    Examples
    --------
    >>> from labrig.optics import illuminant
    >>> float(illuminant("D65").at(560.0))
    100.0
    """
    shipped = _shipped_illuminants()
    if name in shipped:
        return shipped[name]
    colour = colour_science.load()
    names = [key for key in colour.SDS_ILLUMINANTS if "_" not in key]
    if name not in names:
        raise UsageError(
            f"expected the name of a CIE illuminant, got '{name}'; {did_you_mean(name, names)}"
        )
    light = colour.SDS_ILLUMINANTS[name]
    return Spectrum(
        name,
        np.asarray(light.wavelengths, dtype=np.float64),
        np.asarray(light.values, dtype=np.float64),
    )


@cache
def _shipped_illuminants() -> dict[str, Spectrum]:
    """Return the illuminants of labrig's own table, by name."""
    _, head, *lines = read_text(_ILLUMINANTS).splitlines()
    names = head.split(",")[1:]
    nm, *powers = np.loadtxt(lines, delimiter=",", unpack=True, encoding="utf-8")
    return {name: Spectrum(name, nm, power) for name, power in zip(names, powers, strict=True)}


def white_xyz(name: str, standard_observer: Observer) -> FloatArray:
    """Return X, Y, Z of a perfect white under an illuminant.

    Parameters
    ----------
    name
        Name of a CIE illuminant, such as `D65`.
    standard_observer
        The observer.

    Returns
    -------
    ndarray
        X, Y, Z with Y = 1, shape (3,).

    Raises
    ------
    UsageError
        There is no such illuminant.

    Examples
    --------
    >>> from labrig.optics import CIE_1931, observer, white_xyz
    >>> [round(float(value), 3) for value in white_xyz("D65", observer(CIE_1931))]
    [0.95, 1.0, 1.089]
    """
    light = illuminant(name)
    xyz = light.at(standard_observer.wavelength_nm) @ standard_observer.functions
    return np.asarray(xyz / xyz[1])


def lab(xyz: FloatArray, white: FloatArray) -> FloatArray:
    """Return CIELAB of colours.

    Parameters
    ----------
    xyz
        X, Y, Z on the scale on which `white` has Y = 1, shape (…, 3).
    white
        X, Y, Z of the white with Y = 1, shape (3,).

    Returns
    -------
    ndarray
        L*, a*, b*, shape (…, 3).

    References
    ----------
    CIE 15:2018, *Colorimetry*, section 8.2.1.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.optics import lab
    >>> white = np.array([0.95, 1.0, 1.09])
    >>> [round(float(value), 1) + 0 for value in lab(0.2 * white, white)]
    [51.8, 0.0, 0.0]
    """
    ratio = xyz / white
    root = np.where(ratio > _LAB_LIMIT, np.cbrt(ratio), _LAB_SLOPE * ratio + _LAB_INTERCEPT)
    x, y, z = np.moveaxis(root, -1, 0)
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=-1)


def delta_e(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return colour differences CIEDE2000.

    Parameters
    ----------
    first, second
        CIELAB of both sides, shape (…, 3).

    Returns
    -------
    ndarray
        Differences ΔE2000, shape (…).

    References
    ----------
    Sharma, Wu, Dalal, "The CIEDE2000 color-difference formula" (2005).

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.optics import delta_e
    >>> first, second = np.array([50.0, 2.6772, -79.7751]), np.array([50.0, 0.0, -82.7485])
    >>> round(float(delta_e(first, second)), 4)
    2.0425
    """
    colour = colour_science.load()
    return np.asarray(colour.difference.delta_E_CIE2000(first, second))


#: CIE XYZ, white D65 at Y = 1, to linear sRGB, as the standard rounds it.
XYZ_TO_SRGB = np.array(
    [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]]
)


def srgb_bytes(linear: FloatArray) -> NDArray[np.uint8]:
    """Return linear sRGB as bytes with the curve of IEC 61966-2-1.

    Parameters
    ----------
    linear
        Values, of any shape; those outside of 0 to 1 are clipped.

    Returns
    -------
    ndarray
        Bytes from 0 to 255, of the same shape.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.optics import srgb_bytes
    >>> srgb_bytes(np.array([0.0, 0.18, 0.5, 1.2])).tolist()
    [0, 118, 188, 255]
    """
    linear = np.clip(linear, 0.0, 1.0)
    curve = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.asarray(np.rint(255 * curve), dtype=np.uint8)
