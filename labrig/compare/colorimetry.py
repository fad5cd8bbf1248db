"""CIELAB with a given white point, and colour differences (colour-science)."""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from labrig import colour_science
from labrig.errors import UsageError
from labrig.optics import CameraResponse
from labrig.report import camera_to_xyz
from labrig.yaml_file import did_you_mean

FloatArray = NDArray[np.float64]

CIE_1931 = "CIE 1931 2 Degree Standard Observer"
CIE_2015 = "CIE 2015 2 Degree Standard Observer"
#: White of the screens on which comparisons are viewed.
DEFAULT_WHITE = "D65"

#: `all`: one factor for all photographs of a patch, as with one exposure; `each`: one factor for
#: every photograph, as if each had an exposure of its own.
Normalisation = Literal["all", "each"]


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
    """Return a standard observer of colour-science by name."""
    colour = colour_science.load()
    table = colour.MSDS_CMFS[name]
    return Observer(name, np.asarray(table.wavelengths), np.asarray(table.values))


def white_xyz(name: str, standard_observer: Observer) -> FloatArray:
    """Return X, Y, Z of an illuminant such as `D65`, shape (3,), with Y = 1.

    Raises
    ------
    UsageError
        If there is no such illuminant.
    """
    colour = colour_science.load()
    names = {key: key for key in colour.SDS_ILLUMINANTS if "_" not in key}
    if name not in names:
        raise UsageError(
            f"--white: expected the name of a CIE illuminant, got '{name}'; "
            f"{did_you_mean(name, list(names))}"
        )
    light = colour.SDS_ILLUMINANTS[name]
    power = np.interp(
        standard_observer.wavelength_nm, light.wavelengths, light.values, left=0.0, right=0.0
    )
    xyz = power @ standard_observer.functions
    return np.asarray(xyz / xyz[1])


def lab(xyz: FloatArray, white: FloatArray) -> FloatArray:
    """Return CIELAB of X, Y, Z, shape (…, 3), both on the scale on which `white` has Y = 1."""
    colour = colour_science.load()
    return np.asarray(colour.XYZ_to_Lab(xyz, colour.XYZ_to_xy(white)))


def delta_e(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return CIEDE2000 between two CIELAB arrays of shape (…, 3), shape (…).

    References
    ----------
    Sharma, Wu, Dalal, "The CIEDE2000 color-difference formula" (2005).
    """
    colour = colour_science.load()
    return np.asarray(colour.difference.delta_E_CIE2000(first, second))


@dataclass(frozen=True, eq=False)
class Viewing:
    """Conversion of linear raw values of a camera to CIELAB.

    Parameters
    ----------
    to_xyz
        Matrix from R, G, B to relative X, Y, Z, shape (3, 3).
    white
        White point X, Y, Z with Y = 1, shape (3,).
    normalisation
        Normalisation of the photographs, see `Normalisation`.
    description
        Description of the conversion for people.
    """

    to_xyz: FloatArray
    white: FloatArray
    normalisation: Normalisation
    description: str


def viewing(
    camera: CameraResponse | None,
    white: str = DEFAULT_WHITE,
    normalisation: str = "all",
) -> Viewing:
    """Return the conversion for a camera.

    Parameters
    ----------
    camera
        Spectral responses of the camera; None takes its R, G, B for linear sRGB.
    white
        CIE illuminant that is the white.
    normalisation
        `all` or `each`, see `Normalisation`.

    Raises
    ------
    UsageError
        If there is no such white or normalisation.
    """
    colour = colour_science.load()
    if normalisation not in get_args(Normalisation):
        raise UsageError(f"--normalise: expected 'all' or 'each', got '{normalisation}'")
    each = normalisation == "each"
    if camera is None:
        to_xyz = np.asarray(colour.RGB_COLOURSPACES["sRGB"].matrix_RGB_to_XYZ)
        source = "raw R, G, B taken for linear sRGB, since the camera's curves are not known"
    else:
        to_xyz = camera_to_xyz(camera)
        source = (
            f"raw R, G, B to X, Y, Z by the best 3 × 3 matrix for the curves of {camera.name} "
            "(least squares over all wavelengths, equal energy exact)"
        )
    factor = (
        "every photograph has a factor of its own, by which it"
        if each
        else ("all photographs of a patch have one factor, by which the brightest")
    )
    return Viewing(
        to_xyz=to_xyz,
        white=white_xyz(white, observer(CIE_1931)),
        normalisation="each" if each else "all",
        description=(
            f"CIELAB with white {white} of the CIE 1931 2° observer; {source}; {factor} just "
            "reaches the white in X, Y or Z; the predictions have the same factor."
        ),
    )
