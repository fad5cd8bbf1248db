"""How much light of each band a material would give back of what it absorbs."""

import numpy as np

from labrig.foundation.arrays import FloatArray


def emitted_over_absorbed(
    k_e: FloatArray, reradiation: FloatArray, albedo: FloatArray, energy: FloatArray
) -> FloatArray:
    """Return what weak light of each band makes emit over what is absorbed of it, shape (bands,).

    A state that is empty captures at the rate κ, and in the end gives back π Λ κ, over all bands.

    Parameters
    ----------
    k_e, reradiation
        Excitation rates and Λ, shape (states, bands).
    albedo
        Albedo, shape (bands,).
    energy
        Energy of the unit of light in every band, shape (bands,).
    """
    emitted = np.pi * (reradiation @ energy) @ k_e
    absorbed = (1 - albedo) * energy
    ratio = np.full_like(emitted, np.inf)
    np.divide(emitted, absorbed, out=ratio, where=absorbed > 0)
    return np.where(emitted > 0, ratio, 0.0)
