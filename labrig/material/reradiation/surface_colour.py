"""The colour of a surface under a light, and how far two surfaces differ in it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.material.reradiation.matrix import ReradiationMatrix
from labrig.optics import (
    CIE_1931,
    Observer,
    Spectrum,
    band_integrals,
    delta_e,
    is_narrow,
    lab,
    observer,
    quadrature,
    white_xyz,
)

#: `light`: a perfect white under the light itself. `D65`: that of a screen, on which the reference
#: has the luminance `REFERENCE_Y`.
White = Literal["light", "D65"]
#: Luminance of the reference under a narrow light, of a white's.
REFERENCE_Y = 0.5


@dataclass(frozen=True, eq=False)
class Appearance:
    """Colour of a surface under a light, for the CIE 1931 2° observer.

    Attributes
    ----------
    light
        Name of the light.
    xyz
        X, Y, Z, where a perfect white under the light has Y = 1, shape (3,).
    white
        X, Y, Z of that white, shape (3,).
    reradiated_y
        The part of Y that is re-radiated.
    """

    light: str
    xyz: FloatArray
    white: FloatArray
    reradiated_y: float

    @property
    def lab(self) -> FloatArray:
        """CIELAB with the perfect white under this light, shape (3,)."""
        return lab(self.xyz, self.white)


@dataclass(frozen=True, eq=False)
class ColourDifference:
    """Difference of the colours of a surface and a reference under a light.

    Attributes
    ----------
    light
        Name of the light.
    white
        White of CIELAB, see `White`.
    delta_e
        CIEDE2000; NaN where the reference is black.
    xyz_error
        Length of the difference in X, Y, Z over the length of the reference's X, Y, Z.
    """

    light: str
    white: White
    delta_e: float
    xyz_error: float

    def to_dict(self) -> dict[str, str | float | None]:
        """Return the content for JSON, in which what is NaN is null."""
        return {
            "light": self.light,
            "white": self.white,
            "delta_e": None if math.isnan(self.delta_e) else self.delta_e,
            "xyz_error": None if math.isnan(self.xyz_error) else self.xyz_error,
        }


@dataclass(frozen=True, eq=False)
class ColourPair:
    """Colours of a surface and a reference under a light, on the scale of one white.

    Attributes
    ----------
    light
        Name of the light.
    white
        Which white that is, see `White`.
    white_xyz
        X, Y, Z of the white, with Y = 1, shape (3,).
    surface_xyz, reference_xyz
        X, Y, Z of both on that scale, shape (3,); NaN under a narrow light in which the reference
        is black.
    """

    light: str
    white: White
    white_xyz: FloatArray
    surface_xyz: FloatArray
    reference_xyz: FloatArray


def appearance(matrix: ReradiationMatrix, light: Spectrum) -> Appearance:
    """Return the colour of a surface under a light.

    Parameters
    ----------
    matrix
        Reflectance and re-radiation of the surface.
    light
        Irradiance per nm, in any unit.

    Returns
    -------
    Appearance
        Its X, Y, Z relative to a perfect white. Reflectance is piecewise linear between the output
        bands' middles and goes on beyond them; what is re-radiated is constant in each band.

    Raises
    ------
    DataError
        No eye sees the light, so that a white under it is black: there is no scale.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.material import ReradiationMatrix, appearance
    >>> from labrig.optics import read_light
    >>> nm = np.arange(380.0, 781.0, 10.0)
    >>> grey = ReradiationMatrix.from_bands("grey", nm, nm, np.diag(np.full(41, 0.2)))
    >>> under = appearance(grey, read_light("D65"))
    >>> f"{under.xyz[1]:.3f}", f"{under.lab[0]:.1f}"
    ('0.200', '51.8')
    """
    eye = _observer()
    white = _seen_by(eye, light)
    if not white[1] > 0:
        raise DataError(
            f"light '{light.name}': expected light from 360 nm to 830 nm, which a white could "
            "reflect visibly, got none; compare spectra instead"
        )
    reflected = _seen_by(eye, light, matrix)
    by_band = band_integrals(eye.wavelength_nm, eye.functions, matrix.output_edges_nm)
    reradiated = matrix.under(light).reradiated.value @ by_band
    return Appearance(
        light.name,
        (reflected + reradiated) / white[1],
        white / white[1],
        float(reradiated[1] / white[1]),
    )


def compare_colours(
    surface: ReradiationMatrix, reference: ReradiationMatrix, lights: Sequence[Spectrum]
) -> list[ColourDifference]:
    """Compare the colours of a surface with those of a reference.

    CIELAB has the perfect white under each light, except under narrow ones (`is_narrow`): there,
    where a fluorescent surface is far brighter than any white, both are scaled so that the
    reference has half the luminance of a D65 white.

    Parameters
    ----------
    surface
        The surface to judge.
    reference
        The surface to compare with.
    lights
        Irradiances per nm.

    Returns
    -------
    list of ColourDifference
        A difference for each light.

    Raises
    ------
    DataError
        No eye sees one of the lights.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.material import ReradiationMatrix, compare_colours
    >>> from labrig.optics import read_light
    >>> nm = np.arange(380.0, 781.0, 10.0)
    >>> first, second = (
    ...     ReradiationMatrix.from_bands("", nm, nm, np.diag(np.full(41, value)))
    ...     for value in (0.20, 0.21)
    ... )
    >>> (difference,) = compare_colours(first, second, [read_light("D65")])
    >>> f"{difference.delta_e:.1f}, {difference.xyz_error:.1%}, white: {difference.white}"
    '1.1, 4.8%, white: light'
    """
    return [_difference(surface, reference, light) for light in lights]


def colour_pair(
    surface: ReradiationMatrix, reference: ReradiationMatrix, light: Spectrum
) -> ColourPair:
    """Return the colours of a surface and a reference, as `compare_colours` compares them.

    Parameters
    ----------
    surface
        The surface to judge.
    reference
        The surface to compare with.
    light
        Irradiance per nm.

    Returns
    -------
    ColourPair
        Both colours on the scale of one white.

    Raises
    ------
    DataError
        No eye sees the light.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.material import ReradiationMatrix, colour_pair
    >>> from labrig.optics import read_light
    >>> nm = np.arange(380.0, 781.0, 10.0)
    >>> first, second = (
    ...     ReradiationMatrix.from_bands("", nm, nm, np.diag(np.full(41, value)))
    ...     for value in (0.20, 0.25)
    ... )
    >>> pair = colour_pair(first, second, read_light("450nm"))
    >>> pair.white, round(float(pair.surface_xyz[1]), 3), round(float(pair.reference_xyz[1]), 3)
    ('D65', 0.4, 0.5)
    """
    ours, theirs = appearance(surface, light), appearance(reference, light)
    if not is_narrow(light):
        return ColourPair(light.name, "light", theirs.white, ours.xyz, theirs.xyz)
    luminance = float(theirs.xyz[1])
    scale = REFERENCE_Y / luminance if luminance > 0 else np.nan
    white = white_xyz("D65", _observer())
    return ColourPair(light.name, "D65", white, scale * ours.xyz, scale * theirs.xyz)


def _difference(
    surface: ReradiationMatrix, reference: ReradiationMatrix, light: Spectrum
) -> ColourDifference:
    pair = colour_pair(surface, reference, light)
    length = float(np.linalg.norm(pair.reference_xyz))
    if np.isnan(length):
        return ColourDifference(light.name, pair.white, np.nan, np.nan)
    apart = float(np.linalg.norm(pair.surface_xyz - pair.reference_xyz))
    error = apart / length if length > 0 else np.nan
    ours, theirs = (lab(xyz, pair.white_xyz) for xyz in (pair.surface_xyz, pair.reference_xyz))
    return ColourDifference(light.name, pair.white, float(delta_e(ours, theirs)), error)


def _seen_by(
    eye: Observer, light: Spectrum, surface: ReradiationMatrix | None = None
) -> FloatArray:
    """Return X, Y, Z of the light that a surface reflects, or a perfect white, shape (3,)."""
    knots_nm = [eye.wavelength_nm, light.wavelength_nm]
    if surface is not None:
        knots_nm.append(surface.output_nm)
    nodes_nm, weights_nm = quadrature(*eye.wavelength_nm[[0, -1]], *knots_nm)
    power = weights_nm * light.at(nodes_nm)
    if surface is not None:
        measured = ~np.isnan(surface.reflectance)
        if not measured.any():
            return np.zeros(3)
        power *= np.interp(nodes_nm, surface.output_nm[measured], surface.reflectance[measured])
    functions = [np.interp(nodes_nm, eye.wavelength_nm, column) for column in eye.functions.T]
    return np.asarray(functions @ power)


@cache
def _observer() -> Observer:
    return observer(CIE_1931)
