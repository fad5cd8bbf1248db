"""What the samples do to light at once: reflect it, re-radiate it, and mirror a part of it.

A fluorescent sample's matrix is known on the bands of an instrument. Between their centres the room
takes it as bilinear, below the diagonal as 0.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RegularGridInterpolator

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.material import Material, ReradiationMatrix

from .lamp import CELL_NM, WAVELENGTH_NM
from .optics import emission

#: Reflectance of a sample whose material file has no albedo.
SAMPLE_REFLECTANCE = 0.5


class Surfaces:
    """The surfaces of all samples.

    Parameters
    ----------
    materials
        Material of every sample.
    gloss
        Fraction of the light that they mirror, in the middle of the lobe.
    prompt
        Fraction of the absorbed light that every phosphor re-radiates at once where it is excited
        best; empty: none does.
    """

    def __init__(
        self,
        materials: Sequence[Material | ReradiationMatrix],
        gloss: float,
        prompt: Sequence[float] = (),
    ) -> None:
        self._gloss = gloss
        self._reflectance = np.array([_reflectance(material) for material in materials])
        self._reradiation = {
            number: reradiation_on_grid(material)
            for number, material in enumerate(materials, start=1)
            if isinstance(material, ReradiationMatrix)
        }
        for number, fraction in enumerate(prompt, start=1):
            material = materials[number - 1]
            if fraction and isinstance(material, Material):
                absorbed = fraction * (1 - self._reflectance[number - 1])
                self._reradiation[number] = _prompt_on_grid(material, absorbed)

    def thrown_back(self, light: FloatArray, patch: NDArray[np.intp]) -> FloatArray:
        """Return the diffuse light that comes back, as from a white of reflectance 1.

        Parameters and shape are those of `reflected` and `reradiated`, whose sum it is.
        """
        return np.maximum(self.reflected(light, patch) + self.reradiated(light, patch), 0.0)

    def reflected(self, light: FloatArray, patch: NDArray[np.intp]) -> FloatArray:
        """Return the light that comes back at its own wavelength.

        Parameters
        ----------
        light
            Light on all cells, shape (wavelengths,), or on each, shape (cells, wavelengths).
        patch
            Sample of every cell, from 1 on; 0 is none, of which nothing comes back.

        Returns
        -------
        ndarray
            Shape (cells, wavelengths).
        """
        nothing = np.zeros((1, light.shape[-1]))
        reflectance: FloatArray = np.concatenate([nothing, self._reflectance])[patch]
        return reflectance * light

    def mirrored(self, light: FloatArray, patch: NDArray[np.intp]) -> FloatArray:
        """Return the light in the middle of the lobe of what is mirrored, like `reflected`."""
        glossy: FloatArray = np.where(patch > 0, self._gloss, 0.0)[:, np.newaxis]
        return glossy * light

    def reradiated(self, light: FloatArray, patch: NDArray[np.intp]) -> FloatArray:
        """Return the light that comes back at longer wavelengths, like `reflected`."""
        each = np.broadcast_to(light, (len(patch), light.shape[-1]))
        back = np.zeros_like(each)
        for number, matrix in self._reradiation.items():
            cells = patch == number
            back[cells] = each[cells] @ matrix.T
        return back


def reradiation_on_grid(matrix: ReradiationMatrix) -> FloatArray:
    """Return re-radiated light in each cell of the grid per light in each, (out, in)."""
    known = np.nan_to_num(np.where(matrix.is_stokes, matrix.reradiation, 0.0))
    between = RegularGridInterpolator(
        (matrix.output_nm, matrix.input_nm), known, bounds_error=False, fill_value=0.0
    )
    per_nm = between(tuple(np.meshgrid(WAVELENGTH_NM, WAVELENGTH_NM, indexing="ij")))
    is_stokes = WAVELENGTH_NM[:, np.newaxis] > WAVELENGTH_NM
    return np.asarray(np.where(is_stokes, CELL_NM * per_nm, 0.0))


def _prompt_on_grid(material: Material, absorbed: FloatArray) -> FloatArray:
    """Return prompt fluorescence in each cell of the grid per light in each, (out, in).

    Whatever excites it, it has the spectrum of the glow (Kasha); light within that spectrum excites
    as much less as there is less of it at longer wavelengths.

    Raises
    ------
    UsageError
        The file has no excitation rates.
    """
    rates = [state.k_e_per_s for state in material.states if state.k_e_per_s is not None]
    if material.bands_nm is None or not rates:
        raise UsageError(
            f"{material.name}: expected excitation rates of a sample with 'prompt', got none"
        )
    edges = np.array(material.bands_nm)
    excited = np.interp(WAVELENGTH_NM, (edges[1:] + edges[:-1]) / 2, np.sum(rates, axis=0))
    emitted = emission(material).sum(axis=0)
    emitted /= emitted.sum()
    absorbed = absorbed * excited / excited.max() * (1 - np.cumsum(emitted))
    return np.asarray(np.outer(emitted, absorbed))


def _reflectance(material: Material | ReradiationMatrix) -> FloatArray:
    if isinstance(material, Material):
        if material.albedo is None:
            return np.full_like(WAVELENGTH_NM, SAMPLE_REFLECTANCE)
        known = material.albedo
        return np.interp(WAVELENGTH_NM, known.wavelength_nm, known.value)
    measured = ~np.isnan(material.reflectance)
    if not measured.any():
        return np.zeros_like(WAVELENGTH_NM)
    curve = np.interp(WAVELENGTH_NM, material.output_nm[measured], material.reflectance[measured])
    return np.maximum(curve, 0.0)
