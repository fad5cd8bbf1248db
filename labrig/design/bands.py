"""Bands in which light, excitation and re-radiation of a design are given.

Light is measured in units of one white: a perfect diffuser under D65 of irradiance 1 has the colour
(1, 1, 1) in linear sRGB, and the radiance E/π in every band. Three bands are the channels of linear
sRGB, as in section 6 of Nalbach et al.; spectral bands hold means over wavelengths.

Many spectra have one colour. Of those on a grid the one of least squared second differences is
taken (Smits, *An RGB-to-spectrum conversion for reflectances*, 1999, takes first differences of
reflectances). It is a choice, no measurement.

Three channels stand for the smoothest non-negative spectra: a light of one linear sRGB is the sum
of the smoothest spectra of the primaries, and Λ, k_e and albedo are the smoothest that do the same
under it.
"""

import itertools
import math
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import lsq_linear

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.foundation.nonnegative import nonnegative_least_squares
from labrig.optics import CIE_1931, Spectrum, band_integrals, band_means, illuminant, observer

#: Grid of the primaries' spectra, over which the observer sees.
PRIMARIES_NM = np.arange(390.0, 721.0, 5.0)
#: Weight of the colour over that of smoothness.
COLOUR_WEIGHT = 1e4

XYZ_OF_RGB = np.array(
    [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
)


def smooth_spectrum(rgb: FloatArray, colours_of_bands: FloatArray) -> FloatArray:
    """Return the smoothest non-negative spectrum of a colour.

    Parameters
    ----------
    rgb
        Colour in linear sRGB, shape (3,), or other sums over the bands, shape (n,); negative values
        are outside of sRGB, but may be seen.
    colours_of_bands
        Linear sRGB of light by its bands, shape (3, bands) or (n, bands).

    Returns
    -------
    ndarray
        Light in each band, ≥ 0, shape (bands,); of a colour that no light has, that of the nearest.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.design import smooth_spectrum, spectral_bands
    >>> bands = spectral_bands(np.linspace(400.0, 700.0, 13))
    >>> spectrum = smooth_spectrum(np.array([0.1, 0.6, 0.2]), bands.to_rgb)
    >>> (bands.to_rgb @ spectrum).round(3).tolist(), bool(spectrum.min() >= 0)
    ([0.1, 0.6, 0.2], True)
    """
    n = colours_of_bands.shape[1]
    scale = float(np.abs(rgb).max(initial=0.0))
    if scale == 0:
        return np.zeros(n)
    # Bands where the eye is blind end in darkness, or a spectrum would go on for ever.
    padded = np.eye(n + 2)[:, 1:-1]
    bends = np.diff(padded, 2, axis=0) if n > 1 else np.zeros((0, n))
    unit = np.linalg.norm(colours_of_bands)
    weight = COLOUR_WEIGHT / unit
    system = np.vstack([weight * colours_of_bands * n, bends])
    target = np.concatenate([weight * rgb * n / scale, np.zeros(len(bends))])
    return scale * nonnegative_least_squares(system, target)


@cache
def primary_spectra() -> tuple[FloatArray, ...]:
    """Return the smoothest spectra of red, green and blue of linear sRGB on `PRIMARIES_NM`."""
    eye = observer(CIE_1931)
    step = PRIMARIES_NM[1] - PRIMARIES_NM[0]
    functions = np.stack(
        [np.interp(PRIMARIES_NM, eye.wavelength_nm, each) for each in eye.functions.T]
    )
    colours = np.linalg.solve(XYZ_OF_RGB, functions * step)
    return tuple(smooth_spectrum(primary, colours) for primary in np.eye(3))


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


#: Lights under which a reflectance is to look as its three channels.
MAX_LIGHTS = 40
#: Weight of a reflectance's second differences over that of its colours.
SMOOTHNESS = 3e-2


@dataclass(frozen=True, eq=False)
class Conversion:
    """From the bands of a design to bands of wavelengths.

    Attributes
    ----------
    bands
        Bands of the design.
    edges_nm
        Edges of the bands of wavelengths in nm, shape (n + 1,).
    """

    bands: DesignBands
    edges_nm: FloatArray

    @classmethod
    def to(cls, bands: DesignBands, edges_nm: ArrayLike) -> "Conversion":
        """Return the conversion to bands with edges in nm."""
        return cls(bands, np.asarray(edges_nm, dtype=np.float64))

    @cached_property
    def of_light(self) -> FloatArray:
        """Light in bands of wavelengths by that of the design, shape (n, bands)."""
        if self.bands.edges_nm is None:
            spectra = np.stack(primary_spectra(), axis=1)
            return band_means(PRIMARIES_NM, spectra, self.edges_nm)
        low = np.maximum(self.edges_nm[:-1, np.newaxis], self.bands.edges_nm[:-1])
        high = np.minimum(self.edges_nm[1:, np.newaxis], self.bands.edges_nm[1:])
        return np.asarray(np.maximum(high - low, 0) / np.diff(self.edges_nm)[:, np.newaxis])

    @cached_property
    def to_rgb(self) -> FloatArray:
        """Linear sRGB of light by bands of wavelengths, shape (3, n)."""
        return spectral_bands(self.edges_nm).to_rgb

    def light(self, light: FloatArray) -> FloatArray:
        """Return irradiance or radiance (…, bands) in bands of wavelengths (…, n)."""
        return np.asarray(light @ self.of_light.T)

    def strongest_light(self, light: FloatArray) -> FloatArray:
        """Return the strongest of some irradiances (…, bands) in bands of wavelengths (n,)."""
        lights = self.light(light).reshape(-1, len(self.of_light))
        return np.asarray(lights[int(np.linalg.norm(lights, axis=1).argmax())])

    def emission(self, emitted: FloatArray) -> FloatArray:
        """Return Λ (bands,) in bands of wavelengths (n,)."""
        if self.bands.edges_nm is None:
            return smooth_spectrum(emitted, self.to_rgb)
        return self.light(emitted)

    def excitation(self, k_e: FloatArray) -> FloatArray:
        """Return excitation rates (bands,) in bands of wavelengths (n,), the same κ in sum."""
        if self.bands.edges_nm is None:
            return smooth_spectrum(k_e, self.of_light.T)
        widths = np.diff(self.bands.edges_nm)
        return np.asarray((k_e / widths) @ self.of_light.T * np.diff(self.edges_nm))

    def albedo(self, albedo: FloatArray, lights: FloatArray) -> FloatArray:
        """Return reflectances (bands,) in bands of wavelengths (n,), 0 to 1.

        Of three channels it is the smoothest that reflects the colours which the channels would,
        under all of the lights (m, bands) as nearly as one can.
        """
        if self.bands.edges_nm is None:
            lit = np.unique(lights[lights.any(axis=1)], axis=0)
            lit = lit[:: math.ceil(len(lit) / MAX_LIGHTS) or 1]
            lit = lit / lit.max(axis=1, keepdims=True, initial=1e-300)
            seen = np.concatenate([self.to_rgb * light for light in self.light(lit)])
            return smooth_reflectance((albedo * lit).ravel(), seen)
        covered = np.maximum(self.of_light.sum(axis=1), 1e-300)
        return np.asarray(np.minimum(self.light(albedo) / covered, 1.0))


def smooth_reflectance(wanted: FloatArray, seen: FloatArray, highest: float = 1.0) -> FloatArray:
    """Return the smooth reflectance from 0 on (n,) that is seen (m, n) as is wanted (m,)."""
    bends = SMOOTHNESS * np.diff(np.eye(seen.shape[1]), 2, axis=0)
    system, target = np.vstack([seen, bends]), np.concatenate([wanted, np.zeros(len(bends))])
    return np.asarray(lsq_linear(system, target, (0.0, highest)).x)
