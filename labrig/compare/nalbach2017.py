"""What Nalbach et al. found, to stand beside one's own figures.

Nalbach, Seidel, Ritschel: *Practical Capture and Reproduction of Phosphorescent Appearance*.
"""

from typing import NamedTuple

import numpy as np

from labrig.material import Material
from labrig.optics import Spectrum

#: The materials of Table 1, shipped under these names.
TABLE_1 = (
    "blue-paint",
    "green-paint",
    "orange-paint",
    "pink-paint",
    "purple-paint",
    "red-paint",
    "white-paint",
    "yellow-paint",
    "bottle",
    "gloves",
    "stickers",
)


class DeltaE(NamedTuple):
    """CIEDE2000 over all materials and times."""

    mean: float
    least: float
    most: float


#: By the number of states (caption of fig. 8).
DELTA_E = {1: DeltaE(13.16, 7.24, 19.75), 2: DeltaE(5.46, 1.23, 10.64)}
#: Error with so many states over that with one, median of the materials (sec. 4.4).
RESIDUALS = {2: 0.08, 3: 0.04}
#: The same of the last time sample.
LAST_RESIDUALS = {2: 0.18, 3: 0.03}


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
