"""Bands in which light, excitation and re-radiation of a design are given.

Light is measured in units of one white: a perfect diffuser under D65 of irradiance 1 has the colour
(1, 1, 1) in linear sRGB, and the radiance E/π in every band. Three bands are the channels of linear
sRGB, as in section 6 of Nalbach et al.; spectral bands hold means over wavelengths.
"""

import itertools
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from labrig.design.smooth_spectrum import PRIMARIES_NM, primary_spectra
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.optics import CIE_1931, Spectrum, band_integrals, band_means, illuminant, observer

#: CIE XYZ to linear sRGB, IEC 61966-2-1.
XYZ_TO_RGB = np.array(
    [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]]
)
#: Luminance of linear sRGB.
RGB_TO_Y = np.array([0.2126, 0.7152, 0.0722])
#: Mean ȳ of a light below which no eye sees it: ȳ is 4e-5 at 380 nm.
INVISIBLE = 1e-3
#: Negative channel of a light of luminance 1 that is rounding.
ROUNDED = 1e-3


@dataclass(frozen=True, eq=False)
class DesignBands:
    """Bands of a design.

    Attributes
    ----------
    edges_nm
        Edges of the bands in nm, shape (bands + 1,); None of three channels.
    to_rgb
        Linear sRGB of light by its bands, shape (3, bands).
    energy
        Energy of the unit of light in every band, in a common unit, shape (bands,).
    """

    edges_nm: FloatArray | None
    to_rgb: FloatArray
    energy: FloatArray

    @property
    def count(self) -> int:
        """Number of bands."""
        return int(self.to_rgb.shape[1])

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the bands, such as `R` or `400–450 nm`."""
        if self.edges_nm is None:
            return ("R", "G", "B")
        edges = self.edges_nm.tolist()
        return tuple(f"{a:g}–{b:g} nm" for a, b in itertools.pairwise(edges))

    def light(self, spectrum: Spectrum, strength: float = 1.0) -> FloatArray:
        """Return the irradiance of a light in the bands.

        Parameters
        ----------
        spectrum
            Relative power of the light per nm.
        strength
            Luminance of a white under it, that of the white of linear sRGB being 1; of a light that
            no eye sees, its energy over that of D65 of strength 1.

        Returns
        -------
        ndarray
            Irradiance, shape (bands,).

        Raises
        ------
        UsageError
            The light has no colour that three channels could hold.
        """
        eye = observer(CIE_1931)
        xyz = spectrum.at(eye.wavelength_nm) @ eye.functions
        ends = spectrum.wavelength_nm[[0, -1]]
        power = float(band_integrals(spectrum.wavelength_nm, spectrum.value, ends)[0])
        is_seen = xyz[1] > INVISIBLE * power
        if self.edges_nm is None:
            rgb = XYZ_TO_RGB @ (xyz / xyz[1]) if is_seen else np.zeros(3)
            if not is_seen or rgb.min() < -ROUNDED:
                raise UsageError(
                    f"expected a light whose colour is within linear sRGB for three bands, got "
                    f"'{spectrum.name}'; give its irradiance in R, G, B, or take spectral bands"
                )
            return strength * np.maximum(rgb, 0.0)
        unit = xyz[1] if is_seen else power / _d65_power()
        means = band_means(spectrum.wavelength_nm, spectrum.value, self.edges_nm)
        return strength * means / unit


def three_bands() -> DesignBands:
    """Return the channels of linear sRGB.

    Returns
    -------
    DesignBands
        Three bands; their energies are those of the smoothest spectra of the primaries.

    Examples
    --------
    >>> from labrig.design import three_bands
    >>> three_bands().names
    ('R', 'G', 'B')
    """
    energy = np.array([np.trapezoid(each, PRIMARIES_NM) for each in primary_spectra()])
    return DesignBands(None, np.eye(3), energy)


def spectral_bands(edges_nm: ArrayLike) -> DesignBands:
    """Return bands of wavelengths.

    Parameters
    ----------
    edges_nm
        Rising edges of the bands in nm, shape (bands + 1,).

    Returns
    -------
    DesignBands
        The bands; a white under D65 of strength 1 is (1, 1, 1) as far as they cover the visible.

    Raises
    ------
    UsageError
        The edges do not rise, or lie outside of 250 nm to 1000 nm.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.design import spectral_bands
    >>> from labrig.optics import read_light
    >>> bands = spectral_bands(np.arange(380.0, 740.0, 10.0))
    >>> (bands.to_rgb @ bands.light(read_light("D65"))).round(2).tolist()
    [1.0, 1.0, 1.0]
    """
    edges = np.asarray(edges_nm, dtype=np.float64)
    if edges.ndim != 1 or len(edges) < 2 or not (np.diff(edges) > 0).all():
        raise UsageError(f"expected two or more rising edges in nm, got {edges.tolist()}")
    if not (edges[0] >= 250 and edges[-1] <= 1000):
        raise UsageError(
            f"expected bands from 250 nm to 1000 nm, got {edges[0]:g} nm to {edges[-1]:g} nm"
        )
    eye = observer(CIE_1931)
    matched = band_integrals(eye.wavelength_nm, eye.functions, edges)
    return DesignBands(edges, XYZ_TO_RGB @ matched.T, np.diff(edges))


@cache
def _d65_power() -> float:
    """Return the power of D65 over the luminance of a white under it."""
    eye, light = observer(CIE_1931), illuminant("D65")
    luminance = light.at(eye.wavelength_nm) @ eye.functions[:, 1]
    return float(np.trapezoid(light.value, light.wavelength_nm) / luminance)
