"""Spectral light on places of a scene, in the bands and the white of a design.

A design knows three channels or some bands; the scene has spectra. Parameters of a design become
spectra that do under the scene's own light what the design's do in its bands.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from labrig.design.bands import (
    INVISIBLE,
    RGB_TO_Y,
    Conversion,
    DesignBands,
    smooth_reflectance,
    smooth_spectrum,
    spectral_bands,
)
from labrig.design.light import LightProgramme
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.optics import photopic_efficacy

#: Negative channel of a light, over its luminance, that three channels leave out.
LEFT_OUT = 0.02
#: Largest albedo of a surface in a scene: light has to be lost at every bounce.
MAX_ALBEDO = 0.99
#: Lights under which excitation and reflection are to be those of the design.
MAX_LIGHTS = 40


@dataclass(frozen=True, eq=False)
class SceneSpectra:
    """Spectral irradiance on places of a scene, constant from one time to the next.

    Attributes
    ----------
    begin_s
        Rising times in s from which each light is on, shape (n,).
    irradiance
        Irradiance in W m⁻² nm⁻¹, shape (places, n, bands of the scene).
    edges_nm
        Edges of the scene's bands in nm.
    bands
        Bands of the design.
    white_cd_per_m2
        Luminance of the white, which is 1, 1, 1 in linear sRGB.
    """

    begin_s: FloatArray
    irradiance: FloatArray
    edges_nm: FloatArray
    bands: DesignBands
    white_cd_per_m2: float

    @cached_property
    def unit_w_per_m2_nm(self) -> float:
        """Spectral irradiance, weighted as an eye sees it, under which a card is the white."""
        return np.pi * self.white_cd_per_m2 / float(photopic_efficacy(555.0))

    @cached_property
    def to_rgb(self) -> FloatArray:
        """Linear sRGB of light by the scene's bands, shape (3, bands of the scene)."""
        return _rgb_of_bands(tuple(self.edges_nm.tolist()))

    @cached_property
    def programme(self) -> LightProgramme:
        """The light in the bands and the unit of the design."""
        return LightProgramme.checked(self.begin_s, self.in_bands(self.irradiance))

    def in_bands(self, irradiance: FloatArray) -> FloatArray:
        """Return irradiance (…, bands of the scene) in the bands of the design (…, bands)."""
        light = irradiance / self.unit_w_per_m2_nm
        if self.bands.edges_nm is not None:
            return np.asarray(light @ self._conversion.of_light / self._parts)
        return np.maximum(light @ self.to_rgb.T, 0.0)

    @property
    def fits_three_channels(self) -> bool:
        """Whether all light has a colour within linear sRGB, so that it may excite by that."""
        rgb = self.irradiance @ self.to_rgb.T
        seen, power = rgb @ RGB_TO_Y, self.irradiance @ np.diff(self.edges_nm)
        return bool((seen >= INVISIBLE * power).all() and (rgb.min(-1) >= -LEFT_OUT * seen).all())

    def rgb(self, radiance: NDArray[np.floating[Any]]) -> FloatArray:
        """Return linear sRGB over the white of radiance in W m⁻² sr⁻¹ nm⁻¹ (…, scene's bands)."""
        return np.asarray(np.pi / self.unit_w_per_m2_nm * (radiance @ self.to_rgb.T))

    def excitation(self, k_e: FloatArray) -> FloatArray:
        """Return excitation rates (bands,) of the design in 1/s per W m⁻² (bands of the scene,)."""
        if self.bands.edges_nm is None:
            lights = self._lights
            spread = smooth_spectrum(self._rgb_of(lights) @ k_e, lights)
        else:
            spread = self._conversion.excitation(k_e)
        return np.asarray(spread / self.unit_w_per_m2_nm / np.diff(self.edges_nm))

    def emission(self, emitted: FloatArray) -> FloatArray:
        """Return Λ (bands,) of the design in W s m⁻² sr⁻¹ nm⁻¹ (bands of the scene,)."""
        return self.unit_w_per_m2_nm * self._conversion.emission(emitted)

    def albedo(self, albedo: FloatArray) -> FloatArray:
        """Return the albedo (bands,) of the design in the bands of the scene, at most 0.99."""
        if self.bands.edges_nm is None:
            lights = self._lights
            seen = np.concatenate([self.to_rgb * light for light in lights])
            wanted = (albedo * self._rgb_of(lights)).ravel()
            return smooth_reflectance(wanted, seen, MAX_ALBEDO)
        covered = self._conversion.of_light.sum(axis=1) > 0
        within = self._conversion.light(albedo)
        middle = (self.edges_nm[1:] + self.edges_nm[:-1]) / 2
        beyond = np.interp(middle, middle[covered], within[covered])
        return np.asarray(np.minimum(np.where(covered, within, beyond), MAX_ALBEDO))

    @cached_property
    def _conversion(self) -> Conversion:
        return Conversion.to(self.bands, self.edges_nm)

    @cached_property
    def _parts(self) -> FloatArray:
        """Number of bands of the scene in each of the design's."""
        return np.asarray(self._conversion.of_light.sum(axis=0))

    def _rgb_of(self, lights: FloatArray) -> FloatArray:
        return np.maximum(lights @ self.to_rgb.T, 0.0)

    @cached_property
    def _lights(self) -> FloatArray:
        """Different lights, each of luminance 1, shape (m, bands of the scene)."""
        flat = self.irradiance.reshape(-1, self.irradiance.shape[-1])
        flat = flat[flat.any(axis=1)]
        unit = flat / (flat @ self.to_rgb.T @ RGB_TO_Y)[:, np.newaxis]
        unit = np.unique(unit.round(9), axis=0)
        return np.asarray(unit[:: -(-len(unit) // MAX_LIGHTS) or 1])


@lru_cache(maxsize=16)
def _rgb_of_bands(edges_nm: tuple[float, ...]) -> FloatArray:
    return spectral_bands(edges_nm).to_rgb


def checked_edges(bands: DesignBands, edges_nm: FloatArray) -> None:
    """Refuse bands of a design that do not consist of whole bands of a scene."""
    if bands.edges_nm is None:
        return
    for edge in bands.edges_nm.tolist():
        if not np.isclose(edges_nm, edge, rtol=0, atol=1e-6).any():
            known = ", ".join(f"{each:g}" for each in edges_nm.tolist())
            raise UsageError(
                f"expected edges of bands_nm that are edges of the scene's bands ({known}), got "
                f"{edge:g}"
            )
