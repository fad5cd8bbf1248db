"""Published results for comparison.

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


#: Colour differences by the number of states (caption of fig. 8).
DELTA_E = {1: DeltaE(13.16, 7.24, 19.75), 2: DeltaE(5.46, 1.23, 10.64)}
#: Residuals by the number of states over those of one state, median of the materials (sec. 4.4).
RESIDUALS = {2: 0.08, 3: 0.04}
#: Residuals of the last time sample by the number of states over those of one state (sec. 4.4).
LAST_RESIDUALS = {2: 0.18, 3: 0.03}


#: Width of the steps between neighbouring bands.
STEP_NM = 1e-6


def emission(material: Material) -> Spectrum | None:
    """Return the emission spectrum of a material; None if its file has none.

    The spectrum is the measured one or, without it, the radiation of all states at r = 1,
    Σ_i Λ_i k_r,i, constant within each band.
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
    """Return the resolution of `emission` as text: `31 wavelengths`, `8 bands`."""
    if material.spectrum is not None:
        return f"{len(material.spectrum.wavelength_nm)} wavelengths"
    return "–" if material.bands_nm is None else f"{len(material.bands_nm) - 1} bands"
