"""Representation of spectra in three channels (Nalbach et al., fig. 9).

A camera's R, G, B with a 3 × 3 matrix give the exact colour of a spectrum only if its curves are
a linear transform of the observer's colour-matching functions. The best approximation of a
spectrum by three numbers, a weighted sum of those functions, lacks features narrower than they.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from labrig.compare.viewing import DEFAULT_WHITE
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.optics import (
    CIE_2015,
    CameraResponse,
    Observer,
    Spectrum,
    delta_e,
    lab,
    observer,
    white_xyz,
)
from labrig.report import Table


@dataclass(frozen=True, eq=False)
class ThreeChannels:
    """A spectrum and its representation in three channels.

    Attributes
    ----------
    name
        Name of the spectrum.
    wavelength_nm
        Wavelengths in nm, shape (n,).
    spectrum
        Relative spectral power, shape (n,).
    approximation
        Best weighted sum of the colour-matching functions, shape (n,).
    missed
        RMS of the difference of the two over the RMS of the spectrum, 0 to 1.
    xyz
        X, Y, Z of the spectrum, shape (3,), scaled so that it just reaches the white in X, Y or Z.
    xyz_from_rgb
        X, Y, Z from the camera's R, G, B by the best 3 × 3 matrix, shape (3,), on the same scale.
    delta_e
        CIEDE2000 between the two colours.
    """

    name: str
    wavelength_nm: FloatArray
    spectrum: FloatArray
    approximation: FloatArray
    missed: float
    xyz: FloatArray
    xyz_from_rgb: FloatArray
    delta_e: float


def three_channels(
    spectrum: Spectrum, camera: CameraResponse, white: str = DEFAULT_WHITE
) -> ThreeChannels:
    """Compare a spectrum with its representation in three channels.

    The observer is the CIE 2015 2° standard observer.

    Parameters
    ----------
    spectrum
        Relative spectral power over wavelength.
    camera
        Spectral responses of the camera's R, G, B.
    white
        CIE illuminant that is the white of CIELAB, such as `D65`.

    Returns
    -------
    ThreeChannels
        Colour difference between spectrum and camera, and the part of the spectrum that three
        colour-matching functions cannot represent.

    Raises
    ------
    DataError
        If the spectrum is zero where the observer is sensitive.
    UsageError
        If there is no such white.

    References
    ----------
    Nalbach, Seidel, Ritschel, "Practical Capture and Reproduction of Phosphorescent Appearance"
    (2017), fig. 9.

    Examples
    --------
    >>> import numpy as np
    >>> import labrig
    >>> from labrig.compare import three_channels
    >>> from labrig.optics import Spectrum
    >>> wavelength_nm = np.arange(400.0, 701.0, 5.0)
    >>> green = Spectrum("green", wavelength_nm, np.exp(-(((wavelength_nm - 520) / 40) ** 2)))
    >>> result = three_channels(green, labrig.read_camera("canon_eos_5d_mark_ii"))
    >>> f"{result.delta_e:.1f}, {result.missed:.0%}"
    '1.6, 40%'
    """
    standard_observer = observer(CIE_2015)
    resampled = spectrum.resampled(standard_observer.wavelength_nm).value
    xyz = resampled @ standard_observer.functions
    if not xyz.max() > 0:
        raise DataError(f"{spectrum.name}: expected a spectrum that can be seen, got a dark one")
    white_point = white_xyz(white, standard_observer)
    from_rgb = best_matrix(camera, standard_observer) @ (
        resampled @ camera.at(standard_observer.wavelength_nm)
    )
    scale = 1 / float((xyz / white_point).max())
    weights = np.linalg.lstsq(standard_observer.functions, resampled, rcond=None)[0]
    approximation = standard_observer.functions @ weights
    difference = resampled - approximation
    return ThreeChannels(
        name=spectrum.name,
        wavelength_nm=standard_observer.wavelength_nm,
        spectrum=resampled,
        approximation=approximation,
        missed=float(np.linalg.norm(difference) / np.linalg.norm(resampled)),
        xyz=scale * xyz,
        xyz_from_rgb=scale * from_rgb,
        delta_e=float(delta_e(lab(scale * xyz, white_point), lab(scale * from_rgb, white_point))),
    )


def best_matrix(camera: CameraResponse, standard_observer: Observer) -> FloatArray:
    """Return the matrix from R, G, B to X, Y, Z by least squares over wavelengths, shape (3, 3)."""
    fitted = np.linalg.lstsq(
        camera.at(standard_observer.wavelength_nm), standard_observer.functions, rcond=None
    )[0]
    return np.asarray(fitted.T)


def three_channels_table(
    results: Sequence[tuple[ThreeChannels, str]], camera: CameraResponse, white: str
) -> Table:
    """Return a table with a row for each material and the resolution of its spectrum."""
    return Table(
        head=("material", "spectrum of", "ΔE2000 from R, G, B", "residual of three functions / %"),
        rows=tuple(
            (result.name, grid, f"{result.delta_e:.2f}", f"{100 * result.missed:.0f}")
            for result, grid in results
        ),
        caption="Colour from the spectrum against colour from R, G, B by the best 3 × 3 matrix for "
        f"the curves of {camera.name} (least squares over all wavelengths); CIE 2015 2° observer, "
        f"CIELAB with white {white}, scaled so that the spectrum's colour just reaches the white "
        "in X, Y or Z. Residual: RMS of what the best weighted sum of the three colour-matching "
        "functions leaves of the spectrum. A spectrum of bands is taken as constant in each.",
    )
