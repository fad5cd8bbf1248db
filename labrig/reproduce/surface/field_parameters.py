"""Parameters of a material's states for a field of samples, of one material or of a texture."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from labrig.foundation.arrays import Float32Array, FloatArray
from labrig.foundation.errors import UsageError
from labrig.material import Material


@dataclass(frozen=True, eq=False)
class FieldParameters:
    """Rates and spectra of states: of one material, or of every sample.

    Attributes
    ----------
    k_r_per_s
        Re-radiation rates in 1/s, shape (states,) or (states, samples).
    k_e_per_s
        Excitation rates in 1/s per unit of irradiance, shape (states, bands) or (states, bands,
        samples).
    reradiation
        Re-radiation Λ, shape (states, bands) or (states, bands, samples).
    order
        Kinetic orders b ≥ 1, shape (states,).
    prompt
        Part η of the captures that find their trap filled and emit at once, 0 to 1: 0 is the law of
        Nalbach et al., 1 the balance of energy.
    """

    k_r_per_s: Float32Array
    k_e_per_s: Float32Array
    reradiation: Float32Array
    order: FloatArray
    prompt: float = 0.0

    @classmethod
    def checked(
        cls,
        k_r_per_s: ArrayLike,
        k_e_per_s: ArrayLike,
        reradiation: ArrayLike,
        order: ArrayLike = 1.0,
        prompt: float = 0.0,
    ) -> Self:
        """Return parameters whose shapes and ranges were checked.

        Raises
        ------
        UsageError
            Shapes disagree, or a value is negative or not finite.
        """
        k_r, k_e, emitted = (
            np.ascontiguousarray(each, dtype=np.float32)
            for each in (k_r_per_s, k_e_per_s, reradiation)
        )
        n_states = k_r.shape[0] if k_r.ndim else 0
        if not n_states or k_r.ndim > 2:
            raise UsageError(
                f"expected k_r of shape (states,) or (states, samples), got {k_r.shape}"
            )
        for name, each in (("k_e", k_e), ("re-radiation", emitted)):
            if each.ndim not in (2, 3) or each.shape[0] != n_states:
                raise UsageError(
                    f"expected {name} of shape ({n_states}, bands) or ({n_states}, bands, "
                    f"samples), got {each.shape}"
                )
        samples = _sizes(k_r, k_e, emitted)
        if len(samples) > 1:
            raise UsageError(
                f"expected textures of one size, got {', '.join(map(str, sorted(samples)))} samples"
            )
        for name, each in (("k_r", k_r), ("k_e", k_e), ("re-radiation", emitted)):
            if not (np.isfinite(each).all() and each.min(initial=0.0) >= 0):
                raise UsageError(f"expected {name} that are finite and ≥ 0; check the material")
        orders = np.broadcast_to(np.asarray(order, dtype=np.float64), n_states)
        if not (np.isfinite(orders).all() and orders.min() >= 1):
            raise UsageError(f"expected kinetic orders ≥ 1, got {orders.tolist()}")
        if k_r.ndim > 1 and (orders > 1).any():
            raise UsageError(
                "expected one k_r of a state whose order is above 1, got one of every sample; "
                "steps of an order are tabulated: give classes of samples a field each"
            )
        if not 0 <= prompt <= 1:
            raise UsageError(f"expected a prompt part from 0 to 1, got {prompt:g}")
        return cls(k_r, k_e, emitted, np.array(orders), prompt)

    @classmethod
    def of(cls, material: Material, prompt: float = 0.0) -> Self:
        """Return the parameters of a measured material.

        Parameters
        ----------
        material
            Material with re-radiation; without excitation rates light does not charge it.
        prompt
            Part η of captures that emit at once.

        Raises
        ------
        UsageError
            The material has no re-radiation in bands.
        """
        bands = 0 if material.bands_nm is None else len(material.bands_nm) - 1
        emitted = [state.reradiation for state in material.states if state.reradiation is not None]
        if not bands or len(emitted) < len(material.states):
            raise UsageError(
                f"{material.name}: expected the re-radiation Λ of all states, got that of "
                f"{len(emitted)} of {len(material.states)}; measure the emission spectrum (labrig "
                "run phosphor)"
            )
        dark = (0.0,) * bands
        k_e = [state.k_e_per_s or dark for state in material.states]
        return cls.checked(
            [state.k_r_per_s for state in material.states],
            k_e,
            emitted,
            [state.kinetic_order for state in material.states],
            prompt,
        )

    def at(self, texels: NDArray[np.int32]) -> Self:
        """Return the parameters of samples, each of which has those of a texel of these textures.

        Parameters
        ----------
        texels
            Number of the texel of each sample, shape (samples,).
        """
        k_r, k_e, emitted = (
            np.ascontiguousarray(each[..., texels]) if each.ndim > plain else each
            for each, plain in (
                (self.k_r_per_s, 1), (self.k_e_per_s, 2), (self.reradiation, 2)
            )
        )  # fmt: skip
        return replace(self, k_r_per_s=k_r, k_e_per_s=k_e, reradiation=emitted)

    @property
    def n_states(self) -> int:
        """Number of states."""
        return len(self.k_r_per_s)

    @property
    def n_bands(self) -> int:
        """Number of bands that excite."""
        return int(self.k_e_per_s.shape[1])

    @property
    def n_samples(self) -> int | None:
        """Number of samples of textures; None if all samples have the same parameters."""
        return next(iter(_sizes(self.k_r_per_s, self.k_e_per_s, self.reradiation)), None)


def _sizes(k_r: Float32Array, k_e: Float32Array, reradiation: Float32Array) -> set[int]:
    """Return the numbers of samples of what is a texture."""
    parameters = ((k_r, 1), (k_e, 2), (reradiation, 2))
    return {each.shape[-1] for each, plain in parameters if each.ndim > plain}
