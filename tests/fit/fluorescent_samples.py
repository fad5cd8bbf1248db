"""Fluorescent surfaces and lights for tests: shapes that no fit assumes."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import skewnorm

from labrig.fit.fluorescence import Exposure, FluorescenceSystem, fluorescence_system
from labrig.foundation.arrays import FloatArray
from labrig.material import ReradiationMatrix
from labrig.optics import Spectrum, read_camera

INPUT_NM = np.arange(300.0, 781.0, 20.0)
OUTPUT_NM = np.arange(380.0, 781.0, 20.0)
CENTRES_NM = (390.0, 420.0, 450.0, 475.0, 500.0, 525.0, 555.0, 590.0, 630.0)
#: Fewer lights, for tests of many surfaces.
FEW_NM = (405.0, 450.0, 490.0, 530.0, 575.0, 620.0)
CAMERA = "canon_eos_5d_mark_ii"
NOISE = 0.002


@dataclass(frozen=True)
class Dye:
    """Strength, wavelength of strongest excitation, and that of strongest emission in nm."""

    strength: float
    excited_nm: float
    emitted_nm: float

    def reradiation(self) -> FloatArray:
        """Steep towards the other spectrum, with a tail away from it, in 1/nm."""
        excitation = skewnorm.pdf(INPUT_NM, -4, self.excited_nm + 25, 70)
        emission = skewnorm.pdf(OUTPUT_NM, 3, self.emitted_nm - 15, 40)
        step = OUTPUT_NM[1] - OUTPUT_NM[0]
        values = np.outer(emission / (emission.sum() * step), excitation / excitation.max())
        shift = np.maximum(OUTPUT_NM[:, np.newaxis] - INPUT_NM, 0.0)
        return np.asarray(self.strength * values * (1 - np.exp(-shift / 12)))


def led(centre_nm: float) -> Spectrum:
    """An LED with a tail towards long wavelengths."""
    grid = np.arange(centre_nm - 40, centre_nm + 80)
    return Spectrum(f"{centre_nm:g} nm", grid, skewnorm.pdf(grid, 1.5, centre_nm - 5, 11))


def lights(centres_nm: Sequence[float] = CENTRES_NM) -> list[Exposure]:
    """LEDs that are known exactly."""
    return [Exposure(led(centre)) for centre in centres_nm]


def system_of(exposures: Sequence[Exposure]) -> FluorescenceSystem:
    """A system with few and wide bands."""
    return fluorescence_system(exposures, read_camera(CAMERA), None, INPUT_NM, OUTPUT_NM)


def smooth_reflectance(rng: np.random.Generator) -> FloatArray:
    """A reflectance of a few steps, from 0.03 to 0.97."""
    steps = sum(
        rng.normal(0, 0.8) * np.tanh((OUTPUT_NM - rng.uniform(400, 680)) / rng.uniform(15, 50))
        for _ in range(4)
    )
    return np.asarray(0.5 + 0.47 * np.tanh(steps + rng.normal(0, 0.5)))


def surface(reflectance: FloatArray, *dyes: Dye, name: str = "surface") -> ReradiationMatrix:
    """A surface with some dyes."""
    reradiation = np.zeros((len(OUTPUT_NM), len(INPUT_NM)))
    for dye in dyes:
        reradiation += dye.reradiation()
    return ReradiationMatrix(name, INPUT_NM, OUTPUT_NM, reflectance, reradiation)


def photographed(
    system: FluorescenceSystem,
    matrix: ReradiationMatrix,
    rng: np.random.Generator,
    noise: float = NOISE,
) -> tuple[FloatArray, FloatArray]:
    """Values and variances of a surface, per brightness 1."""
    exact = system.values(matrix.reflectance, matrix.reradiation)
    sigma = noise * np.hypot(exact, 0.3 * exact.max(axis=1, keepdims=True))
    return exact + sigma * rng.standard_normal(exact.shape), sigma**2
