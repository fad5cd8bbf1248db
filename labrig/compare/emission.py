"""The spectrum that a material emits."""

import numpy as np

from labrig.material import Material
from labrig.optics import Spectrum

#: Width of the steps between neighbouring bands.
STEP_NM = 1e-6


def emission(material: Material) -> Spectrum | None:
    """On the finest grid its file has; None if it says nothing of it.

    That is the spectrum, or else what all states together radiate at r = 1, Σ_i Λ_i k_r,i, taken
    as constant within each band.
    """
    if material.spectrum is not None:
        return Spectrum(
            material.name,
            np.array(material.spectrum.wavelength_nm),
            np.array(material.spectrum.value),
        )
    radiated = [
        state.k_r_per_s * np.array(state.reradiation)
        for state in material.states
        if state.reradiation is not None
    ]
    if material.bands_nm is None or not radiated:
        return None
    edges = np.array(material.bands_nm)
    ends_nm = np.stack([edges[:-1] + STEP_NM, edges[1:] - STEP_NM], axis=1).ravel()
    return Spectrum(material.name, ends_nm, np.repeat(np.sum(radiated, axis=0), 2))


def emission_grid(material: Material) -> str:
    """In words what `emission` rests on: `31 wavelengths`, `8 bands`."""
    if material.spectrum is not None:
        return f"{len(material.spectrum.wavelength_nm)} wavelengths"
    return "–" if material.bands_nm is None else f"{len(material.bands_nm) - 1} bands"
