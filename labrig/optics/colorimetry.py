"""Standard observers, illuminants, CIELAB and colour differences (colour-science)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from labrig import colour_science
from labrig.errors import UsageError
from labrig.optics.spectrum import Spectrum
from labrig.yaml_file import did_you_mean

FloatArray = NDArray[np.float64]

CIE_1931 = "CIE 1931 2 Degree Standard Observer"
CIE_2015 = "CIE 2015 2 Degree Standard Observer"


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
    colour = colour_science.load()
    table = colour.MSDS_CMFS[name]
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

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.optics import lab
    >>> white = np.array([0.95, 1.0, 1.09])
    >>> [round(float(value), 1) + 0 for value in lab(0.2 * white, white)]
    [51.8, 0.0, 0.0]
    """
    colour = colour_science.load()
    return np.asarray(colour.XYZ_to_Lab(xyz, colour.XYZ_to_xy(white)))


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
