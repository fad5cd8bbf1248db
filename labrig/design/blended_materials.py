"""Materials between others: rates and strengths of light as logarithms, spectra by their shapes.

Strengths may differ by powers of ten, so that halfway between two is their geometric mean. A
spectrum has bands without light, whose logarithm there is none of: shapes are mixed as light is.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from labrig.design.result import Design
from labrig.design.scene_spectra import SceneSpectra
from labrig.foundation.arrays import FloatArray
from labrig.reproduce import ParameterTexture

#: Strength, as a part of the largest, below which light is none.
FAINTEST = 1e-9
#: Relative difference of albedos that is rounding.
ROUNDED = 1e-9


@dataclass(frozen=True, eq=False)
class BlendedMaterials:
    """Materials in the units of a scene that are blended.

    Attributes
    ----------
    k_r_per_s
        Re-radiation rates, shape (materials, states).
    k_e_per_s
        Excitation rates in 1/s per W m⁻², shape (materials, states, bands of the scene).
    reradiation
        Λ, shape (materials, states, bands of the scene).
    albedo
        Albedo of the last material, shape (bands of the scene,).
    albedo_factor
        Albedo of each material over that of the last, shape (materials,).
    widths_nm
        Widths of the bands, shape (bands of the scene,).
    """

    k_r_per_s: FloatArray
    k_e_per_s: FloatArray
    reradiation: FloatArray
    albedo: FloatArray
    albedo_factor: FloatArray
    widths_nm: FloatArray

    @classmethod
    def of(cls, designs: Sequence[Design], light: SceneSpectra) -> Self:
        """Return the materials of designs; albedos are those of the last times a factor."""
        last = designs[-1].albedo
        squared = float(last @ last)
        factor = [float(each.albedo @ last) / squared if squared > 0 else 1.0 for each in designs]
        return cls(
            np.array([design.k_r_per_s for design in designs]),
            np.array([[light.excitation(k_e) for k_e in each.k_e_per_s] for each in designs]),
            np.array([[light.emission(own) for own in each.reradiation] for each in designs]),
            light.albedo(last),
            np.array(factor),
            np.diff(light.edges_nm),
        )

    def texture(self, shares: FloatArray) -> ParameterTexture:
        """Return the parameters of texels.

        Parameters
        ----------
        shares
            Part of each material, in sum 1, shape (rows, columns, materials).
        """
        k_r = np.exp(shares @ np.log(self.k_r_per_s))
        k_e, emitted = _mixed(self.k_e_per_s, shares), _mixed(self.reradiation, shares)
        factor = shares @ self.albedo_factor
        # Between two materials that keep the energy there may be one that does not.
        allowed = max(1.0, float(self._excess(self.k_e_per_s, self.reradiation,
                                              self.albedo_factor).max()))  # fmt: skip
        excess = self._excess(k_e, emitted, factor) / allowed
        emitted /= np.maximum(excess, 1.0)[..., np.newaxis, np.newaxis]
        is_one = np.allclose(self.albedo_factor, 1.0, rtol=0, atol=ROUNDED)
        return ParameterTexture.checked(k_r, k_e, emitted, None if is_one else factor)

    def _excess(self, k_e: FloatArray, emitted: FloatArray, factor: FloatArray) -> FloatArray:
        """Return what is emitted over what is absorbed in the worst band, without states' bands."""
        energy = np.pi * emitted @ self.widths_nm
        given_back = np.einsum("...s,...sb->...b", energy, k_e)
        absorbed = 1 - factor[..., np.newaxis] * self.albedo
        return np.asarray((given_back / absorbed).max(axis=-1))


def _mixed(spectra: FloatArray, shares: FloatArray) -> FloatArray:
    """Return spectra (rows, columns, states, bands) between those of materials."""
    strength = spectra.sum(axis=-1)
    least = FAINTEST * strength.max(axis=0)
    is_dark = strength <= least
    shape = np.divide(spectra, strength[..., np.newaxis], out=np.zeros_like(spectra),
                      where=~is_dark[..., np.newaxis])  # fmt: skip
    blended = np.exp(shares @ np.log(np.maximum(strength, np.maximum(least, 1e-300))))
    mixed = np.einsum("rcm,msb->rcsb", shares, shape)
    total = mixed.sum(axis=-1, keepdims=True)
    unit = np.divide(mixed, total, out=np.zeros_like(mixed), where=total > 0)
    return np.asarray(blended[..., np.newaxis] * unit)
