"""Measurements of fluorescent samples that never were, with known truth.

Shapes, noise and spill are those found in matrices of a Labsphere BFC-450: skewed bands, each dye
with one emission spectrum whatever excites it (Kasha's rule); noise with a factor of the input band
times one of the output band, most of it common to a column; and light that passes both
monochromators beside the diagonal.
"""

from dataclasses import dataclass

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.material import ReradiationMatrix

INPUT_NM = np.arange(300.0, 781.0, 10.0)
OUTPUT_NM = np.arange(380.0, 781.0, 10.0)
BELOW_DIAGONAL = OUTPUT_NM[:, np.newaxis] == INPUT_NM - 10
ABOVE_DIAGONAL = OUTPUT_NM[:, np.newaxis] == INPUT_NM + 10
STOKES = OUTPUT_NM[:, np.newaxis] > INPUT_NM
#: Part of the noise's variance that all entries of a column have in common.
COMMON_NOISE = 0.75
#: Change of the common noise along a column, over its level.
DRIFT = 0.2
#: Part of the reflectance that a dye takes away where it absorbs most.
DEPTH = 0.8
#: Scatter of one wavelength's spill about the law.
SPILL_SCATTER = 0.15


@dataclass(frozen=True)
class Dye:
    """One dye: peaks of excitation and emission in nm, and the part re-radiated at the peak."""

    excitation_nm: float
    emission_nm: float
    strength: float = 0.4
    width_nm: float = 30.0

    def absorbed(self, wavelength_nm: FloatArray) -> FloatArray:
        """Light that the dye takes in, 1 at the peak."""
        return skewed(wavelength_nm, self.excitation_nm, self.width_nm, -0.4)

    def bands(self) -> FloatArray:
        """Fractions of the light of each input band in each output band, shape (41, 49)."""
        emission = skewed(OUTPUT_NM, self.emission_nm, self.width_nm, 0.4)
        shares = np.outer(emission / emission.sum(), self.absorbed(INPUT_NM))
        return np.where(STOKES, self.strength * shares, 0.0)


@dataclass(frozen=True, eq=False)
class Measurement:
    """A matrix as measured, and what is not known of a real one.

    Attributes
    ----------
    measured
        With noise and spill, without σ.
    truth
        The sample.
    sigma
        One standard deviation of the noise of each entry, as fraction per band, shape (41, 49).
    """

    measured: ReradiationMatrix
    truth: ReradiationMatrix
    sigma: FloatArray


def skewed(wavelength_nm: FloatArray, peak_nm: float, width_nm: float, skew: float) -> FloatArray:
    """Return a log-normal band of height 1; with a positive skew its tail is at long waves."""
    inside = 1 + skew * (wavelength_nm - peak_nm) / width_nm
    logarithm = np.log(np.maximum(inside, 1e-9)) / skew
    return np.asarray(np.exp(-(logarithm**2) / 2))


def reflectance(rng: np.random.Generator) -> FloatArray:
    """Return a dark level and one to three smooth steps up or down, within 0.02 to 0.92."""
    curve = np.zeros(len(OUTPUT_NM))
    for _ in range(rng.integers(1, 4)):
        step = np.tanh((OUTPUT_NM - rng.uniform(400, 700)) / rng.uniform(15, 60))
        curve += rng.choice([-1, 1]) * step
    low, high = np.sort(rng.uniform(0.02, 0.92, 2))
    return np.asarray(low + (high - low) * (curve - curve.min()) / np.ptp(curve))


def noise_sigma(rng: np.random.Generator) -> FloatArray:
    """Return σ of each entry of an instrument, shape (41, 49).

    Columns differ by 30 % beside the fall to long wavelengths, the one of 300 nm is twice as noisy;
    rows are noisiest at both ends.
    """
    column = np.interp(INPUT_NM, [300, 310, 580, 680, 780], np.array([2.4, 1.2, 1.2, 0.6, 0.4]))
    column = 1e-3 * column * np.exp(0.3 * rng.standard_normal(len(INPUT_NM)))
    row = np.interp(OUTPUT_NM, [380, 440, 600, 680, 780], [1.5, 0.85, 0.8, 1.25, 2.1])
    return np.outer(row, column)


def noise(rng: np.random.Generator, sigma: FloatArray, common: float = COMMON_NOISE) -> FloatArray:
    """Return normal noise, a part of whose variance is common to each column but for a drift."""
    place = np.linspace(-np.sqrt(3), np.sqrt(3), sigma.shape[0])[:, np.newaxis]
    level, slope = rng.standard_normal((2, sigma.shape[1]))
    together = (level + DRIFT * slope * place) / np.hypot(1, DRIFT * place)
    alone = rng.standard_normal(sigma.shape)
    return np.asarray(sigma * (np.sqrt(common) * together + np.sqrt(1 - common) * alone))


def spill(rng: np.random.Generator, curve: FloatArray, level: float = 0.007) -> FloatArray:
    """Return what the monochromators pass beside the diagonal, as fractions per band."""
    slope, mean = 0.065 * np.diff(curve), level * (curve[1:] + curve[:-1]) / 2
    gains = 1 + SPILL_SCATTER * rng.standard_normal((2, len(slope)))
    values = np.zeros(BELOW_DIAGONAL.shape)
    lower = np.arange(len(slope))
    values[lower, lower + 9] = gains[0] * (slope + mean)
    values[lower + 1, lower + 8] = -gains[1] * (0.5 * slope + 0.63 * mean)
    return values


def measurement(
    seed: int,
    *dyes: Dye,
    common: float = COMMON_NOISE,
    sigma: FloatArray | None = None,
    spill_level: float = 0.007,
) -> Measurement:
    """Return a sample with these dyes, and without dyes a ceramic tile, as an instrument sees it.

    Parameters
    ----------
    seed
        Of reflectance, noise and spill.
    dyes
        What re-radiates.
    common
        Part of the noise's variance that is common to a column.
    sigma
        Noise of the instrument; without it each seed has its own.
    spill_level
        Spill below the diagonal, as part of the reflectance.
    """
    rng = np.random.default_rng(seed)
    curve = reflectance(rng)
    for dye in dyes:
        curve = curve * (1 - DEPTH * dye.absorbed(OUTPUT_NM))
    values = np.sum([dye.bands() for dye in dyes], axis=0) if dyes else np.zeros(STOKES.shape)
    values[np.arange(41), np.arange(8, 49)] = curve
    sigma = noise_sigma(rng) if sigma is None else sigma
    measured = values + spill(rng, curve, spill_level) + noise(rng, sigma, common)
    name = f"sample {seed}"
    return Measurement(
        ReradiationMatrix.from_bands(name, INPUT_NM, OUTPUT_NM, measured),
        ReradiationMatrix.from_bands(name, INPUT_NM, OUTPUT_NM, values),
        sigma,
    )


#: One dye and two as on real samples: a yellow textile's, and a brightener with an orange.
YELLOW = Dye(460.0, 510.0)
BRIGHTENER = Dye(370.0, 440.0, 0.5)
ORANGE = Dye(520.0, 600.0, 0.3)
