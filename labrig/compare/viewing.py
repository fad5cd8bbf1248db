"""Conversion of photographs to CIELAB with a given white point."""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from labrig.foundation import colour_science
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.optics import CIE_1931, CameraResponse, observer, white_xyz
from labrig.report import camera_to_xyz

#: White of the screens on which comparisons are viewed.
DEFAULT_WHITE = "D65"

#: `all`: one factor for all photographs of a patch, as with one exposure; `each`: one factor for
#: every photograph, as if each had an exposure of its own.
Normalisation = Literal["all", "each"]


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
    source
        How X, Y, Z follow from raw values, for people.
    description
        Description of the conversion for people.
    """

    to_xyz: FloatArray
    white: FloatArray
    normalisation: Normalisation
    source: str
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
        source=f"white {white} of the CIE 1931 2° observer; {source}",
        description=(
            f"CIELAB with white {white} of the CIE 1931 2° observer; {source}; {factor} just "
            "reaches the white in X, Y or Z; the predictions have the same factor."
        ),
    )
