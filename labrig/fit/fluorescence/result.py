"""The result of an estimate of a re-radiation matrix."""

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import FloatArray
from labrig.material import ReradiationMatrix
from labrig.optics import Spectrum

Method = Literal["joint", "per-led"]


@dataclass(frozen=True)
class FluorophoreNumber:
    """Probability of some number of fluorophores.

    Attributes
    ----------
    fluorophores
        The number; 0 for a surface that only reflects.
    log_evidence
        Logarithm of the values' density, over the emissions and amplitudes that explain them best.
    probability
        Its probability among the numbers that were tried.
    """

    fluorophores: int
    log_evidence: float
    probability: float


@dataclass(frozen=True, eq=False)
class EstimatedFluorophore:
    """A dye.

    Attributes
    ----------
    emission
        Its emission with unit integral, in 1/nm, and σ.
    excitation
        Fraction of the light of each wavelength that it would emit over all of its emission, and σ.
    quantum_yield, quantum_yield_sigma
        Photons emitted for each photon that does not come back at its own wavelength, at the lit
        wavelength of the strongest excitation that the reflectance covers: as of the whole surface,
        whose other pigments absorb, too. NaN where there is no such wavelength.
    """

    emission: Spectrum
    excitation: Spectrum
    quantum_yield: float
    quantum_yield_sigma: float


@dataclass(frozen=True)
class ExtrapolatedExcitation:
    """Much of the re-radiation is excited by light that no exposure had.

    Attributes
    ----------
    input_nm
        Middles of the input bands that no light reached, in nm.
    share
        The part of the re-radiation that they excite under equal light in all bands.
    """

    input_nm: tuple[float, ...]
    share: float


@dataclass(frozen=True)
class UnknownBrightness:
    """The brightness of lights is not known: of what they excite, only the colour is.

    Attributes
    ----------
    lights
        Their names.
    """

    lights: tuple[str, ...]


@dataclass(frozen=True)
class UnexplainedValues:
    """The values differ from what any surface would show by more than their errors.

    Attributes
    ----------
    reduced_chi2
        χ² per degree of freedom.
    light, channel
        Light and number of the channel where they differ most.
    sigmas
        By how many σ they differ there.
    """

    reduced_chi2: float
    light: str
    channel: int
    sigmas: float


@dataclass(frozen=True)
class MoreThanWhite:
    """More light than from a perfect white comes back, by more than 3 σ.

    Attributes
    ----------
    input_nm
        Middle of the input band in nm where most comes back.
    fraction, sigma
        Fraction of its light that comes back, and σ.
    """

    input_nm: float
    fraction: float
    sigma: float


EstimateFact: TypeAlias = (
    ExtrapolatedExcitation | UnknownBrightness | UnexplainedValues | MoreThanWhite
)


@dataclass(frozen=True, eq=False)
class Surfaces:
    """Surfaces drawn at random, as probable as the values make them.

    Attributes
    ----------
    reflectance
        ρ, shape (d, o).
    reradiation
        Φ in 1/nm, shape (d, o, i).
    """

    reflectance: FloatArray
    reradiation: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class FluorescenceFit:
    """An estimated re-radiation matrix.

    Attributes
    ----------
    method
        "joint" or "per-led".
    matrix
        The matrix: the mean of `surfaces`, with their standard deviation, of the joint method. σ of
        an entry is not below 2 % of the largest one: real emissions have some light far from
        their maximum.
    is_extrapolated
        Whether no light reached an input band, so that its column is extrapolated from others and
        from what dyes usually do, shape (i,), bool.
    fluorophores
        The dyes by rising wavelength of their emission; of the most probable number of them.
    numbers
        The numbers of fluorophores that were tried; none per LED.
    predicted
        What the camera would see of the matrix, in the unit of the values, shape (m, k).
    pull
        Values minus `predicted` over their σ, which includes that of lights and curves, shape
        (m, k).
    reduced_chi2
        χ² per degree of freedom: about 1 where all σ hold; NaN without degrees of freedom.
    facts
        What is to be known before the matrix is used.
    surfaces
        Draws from the posterior density, whose spread is the uncertainty of all that follows; None
        per LED, where it is not known.
    """

    method: Method
    matrix: ReradiationMatrix
    is_extrapolated: NDArray[np.bool_]
    fluorophores: tuple[EstimatedFluorophore, ...]
    numbers: tuple[FluorophoreNumber, ...]
    predicted: FloatArray
    pull: FloatArray
    reduced_chi2: float
    facts: tuple[EstimateFact, ...]
    surfaces: Surfaces | None
