"""Re-radiation for renderers that know three colours: a matrix of linear sRGB, and how far off.

A fluorescent surface turns light of one wavelength into that of others; three colours know neither
the ultraviolet, which they do not have, nor lines within a colour. What is left is a preview, whose
colour differences are stated with it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.optics import (
    CIE_1931,
    XYZ_TO_SRGB,
    Spectrum,
    delta_e,
    illuminant,
    is_narrow,
    lab,
    observer,
    white_xyz,
)
from labrig.reproduce.picture.display import tristimulus
from labrig.reproduce.surface.bands import Bands
from labrig.reproduce.surface.surface_material import SurfaceMaterial
from labrig.reproduce.transport.lamp import Lamp

#: Illuminants over which matrices are fitted, and the wavelengths in nm between their parts: light
#: in a scene has passed coloured walls, and three illuminants alone leave a matrix open.
ILLUMINANTS = ("D65", "A", "FL11")
PARTED_NM = (500.0, 580.0)
FITTED_OVER = (
    f"{', '.join(ILLUMINANTS)}, each whole and its parts below {PARTED_NM[0]:g} nm, up to "
    f"{PARTED_NM[1]:g} nm and beyond"
)
#: White, and luminance of the surface, where a lamp shows no white.
SCREEN, MIDDLE = "D65", 0.5


@dataclass(frozen=True, eq=False)
class RgbPreview:
    """Matrix of what a fluorescent surface does to light in linear sRGB, approximately.

    Attributes
    ----------
    matrix
        Matrix from the light that falls on it to the light that comes back, π L/E, in linear sRGB,
        shape (3, 3); row by row the red, green and blue that come back.
    delta_e
        ΔE2000 of it under each lamp of the scene, against all wavelengths; None where the lamp
        makes no colour.
    delta_e_of_colour
        The same of a single base colour, that under D65, as far as it is from 0 to 1.
    """

    matrix: FloatArray
    delta_e: Mapping[str, float | None]
    delta_e_of_colour: Mapping[str, float | None]

    @property
    def statement(self) -> str:
        """Return its kind and how far it is off, in one line for people."""
        told = ", ".join(
            f"{'–' if value is None else f'{value:.1f}'} under {lamp}"
            for lamp, value in self.delta_e.items()
        )
        return (
            "preview of re-radiation in linear sRGB, by least squares over "
            f"{FITTED_OVER}; ΔE2000 {told or 'not known without lamps'}"
        )

    def to_dict(self) -> dict[str, object]:
        """Return it for JSON."""
        return {
            "preview": self.statement,
            "linearSrgbFromLinearSrgb": np.round(self.matrix, 6).tolist(),
            "deltaE2000UnderLamps": _rounded(self.delta_e),
            "deltaE2000OfBaseColorUnderLamps": _rounded(self.delta_e_of_colour),
        }


def rgb_preview(material: SurfaceMaterial, bands: Bands, lamps: Sequence[Lamp]) -> RgbPreview:
    """Return the matrix of linear sRGB that is nearest to a fluorescent surface.

    It minimises the squared differences of linear sRGB over some illuminants, D65, A and FL11, and
    three parts of each; all have the luminance 1 as a whole.

    Parameters
    ----------
    material
        The surface.
    bands
        Bands of its matrix.
    lamps
        Lamps of the scene, under which it is judged against all wavelengths: with a perfect white
        under the lamp; where the lamp is narrow, with D65 and the surface's luminance at half of
        the white's.

    Returns
    -------
    RgbPreview
        The matrix and its colour differences.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.optics import illuminant
    >>> from labrig.material import read_any_material
    >>> from labrig.reproduce import Bands, Lamp, of_matrix, rgb_preview
    >>> bands = Bands.even()
    >>> textile = of_matrix(read_any_material("yellow-textile"), bands)
    >>> lamp = Lamp("window", "distant", bands.means(illuminant("D65")))
    >>> preview = rgb_preview(textile, bands, [lamp])
    >>> bool(preview.matrix[1, 2] > 0.2)  # blue comes back as green
    True
    >>> preview.delta_e["window"] < 2
    True
    """
    matrix = material.matrix.astype(np.float64)
    falls, comes = [], []
    for light in _fitted_over(bands):
        falls.append(_linear(light, bands))
        comes.append(_linear(matrix @ light, bands))
    fitted = np.linalg.lstsq(np.array(falls), np.array(comes), rcond=None)[0].T
    colour = np.diag(np.clip(_linear(matrix @ _whole(SCREEN, bands), bands), 0.0, 1.0))
    return RgbPreview(
        fitted,
        {lamp.name: _delta_e(fitted, matrix, lamp.light, bands) for lamp in lamps},
        {lamp.name: _delta_e(colour, matrix, lamp.light, bands) for lamp in lamps},
    )


def _rounded(differences: Mapping[str, float | None]) -> dict[str, float | None]:
    return {lamp: None if value is None else round(value, 2) for lamp, value in differences.items()}


def _whole(name: str, bands: Bands) -> FloatArray:
    """Return an illuminant in bands, of luminance 1 (bands,)."""
    light = bands.means(illuminant(name))
    return np.asarray(light / tristimulus(light, bands.edges_nm)[1])


def _fitted_over(bands: Bands) -> list[FloatArray]:
    part = np.digitize(bands.centre_nm, PARTED_NM)
    lights = []
    for whole in (_whole(name, bands) for name in ILLUMINANTS):
        lights += [whole, *(np.where(part == number, whole, 0.0) for number in range(3))]
    return lights


def _linear(light: FloatArray, bands: Bands) -> FloatArray:
    """Return linear sRGB of a light, not clipped (3,)."""
    return np.asarray(XYZ_TO_SRGB @ tristimulus(light, bands.edges_nm))


def _delta_e(
    reduced: FloatArray, matrix: FloatArray, light: FloatArray, bands: Bands
) -> float | None:
    """Return ΔE2000 of a reduced matrix under a light; None where no colour comes back."""
    seen = tristimulus(matrix @ light, bands.edges_nm)
    if not seen[1] > 0:
        return None
    approximate = np.linalg.solve(XYZ_TO_SRGB, reduced @ _linear(light, bands))
    if is_narrow(Spectrum("", bands.centre_nm, light)):
        white, scale = white_xyz(SCREEN, observer(CIE_1931)), MIDDLE / seen[1]
    else:
        white = tristimulus(light, bands.edges_nm)
        white, scale = white / white[1], 1 / white[1]
    colours = [lab(np.maximum(scale * xyz, 0.0), white) for xyz in (seen, approximate)]
    return float(delta_e(*colours))
