"""Light, rates and reflectances of a design in bands of wavelengths.

Three channels stand for the smoothest non-negative spectra: a light of one linear sRGB is the sum
of the smoothest spectra of the primaries, and Λ, k_e and albedo are the smoothest that do the same
under it.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import lsq_linear

from labrig.design.bands import DesignBands, spectral_bands
from labrig.design.smooth_spectrum import PRIMARIES_NM, primary_spectra, smooth_spectrum
from labrig.foundation.arrays import FloatArray
from labrig.optics import band_means

#: Lights under which a reflectance is to look as its three channels.
MOST_LIGHTS = 40
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
            lit = lit[:: math.ceil(len(lit) / MOST_LIGHTS) or 1]
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
