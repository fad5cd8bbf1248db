"""Glow that excites the material that emits it."""

import numpy as np
from numpy.typing import ArrayLike


def self_excitation(k_e_per_s: ArrayLike, reradiation: ArrayLike, albedo: ArrayLike) -> float:
    """Return how much glow comes of a glow in a closed room of one material, at most.

    In weak light a state emits Λ κ in the end, as radiance of a Lambertian surface. All of it comes
    back to the walls of such a room, again and again as they reflect it: 1/(1 − albedo) times in
    all. From 1 on the room would glow ever more.

    Parameters
    ----------
    k_e_per_s
        Excitation rates in 1/s for an irradiance of 1 in each band, shape (states, bands[,
        samples]).
    reradiation
        Λ of each state as radiance times s in the same unit, shape (states, bands[, samples]).
    albedo
        Albedo in the bands, from 0 to below 1, shape (bands,) or (bands, samples).

    Returns
    -------
    float
        The largest eigenvalue, in modulus, of the excitation of each state by the glow of each; of
        samples, that of the worst.

    Examples
    --------
    >>> from labrig.material import self_excitation
    >>> round(self_excitation([[0.0, 0.02]], [[3.0, 4.0]], [0.5, 0.5]), 3)
    0.503
    """
    k_e, emitted, reflected = (
        np.asarray(each, dtype=np.float64) for each in (k_e_per_s, reradiation, albedo)
    )
    if k_e.ndim == 2:
        k_e = k_e[..., np.newaxis]
    if emitted.ndim == 2:
        emitted = emitted[..., np.newaxis]
    if reflected.ndim == 1:
        reflected = reflected[:, np.newaxis]
    # Excitation of state i by the glow of state j, for each sample.
    among = np.pi * np.einsum("ibs,jbs->sij", k_e / (1 - reflected), emitted)
    return float(np.abs(np.linalg.eigvals(among)).max())
