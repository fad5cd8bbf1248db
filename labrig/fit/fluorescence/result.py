"""The result of an estimate of a re-radiation matrix."""

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.material import ReradiationMatrix, appearance
from labrig.optics import (
    CIE_1931,
    Spectrum,
    band_integrals,
    edges_from_centres,
    hat_functions,
    lab,
    observer,
    quadrature,
)

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


@dataclass(frozen=True, eq=False)
class PredictedColour:
    """Colour of an estimated surface under a light, for the CIE 1931 2° observer.

    Attributes
    ----------
    light
        Name of the light.
    xyz, xyz_covariance
        X, Y, Z, where a perfect white under the light has Y = 1, (3,), and their covariance (3, 3).
    lab, lab_covariance
        CIELAB with the perfect white under the light, (3,), and its covariance (3, 3).
    """

    light: str
    xyz: FloatArray
    xyz_covariance: FloatArray
    lab: FloatArray
    lab_covariance: FloatArray

    @property
    def lab_sigma(self) -> FloatArray:
        """One standard deviation of L*, a*, b*, shape (3,)."""
        return np.sqrt(np.diag(self.lab_covariance))


def predicted_colour(fit: FluorescenceFit, light: Spectrum) -> PredictedColour:
    """Return the colour of an estimated surface under a light.

    Parameters
    ----------
    fit
        An estimate with its uncertainty.
    light
        Irradiance per nm, in any unit.

    Returns
    -------
    PredictedColour
        The colour of the matrix, as `labrig.material.appearance` has it, and the covariance of the
        drawn surfaces' colours: the σ of the matrix' entries alone would give a wrong one, since
        their errors are anything but independent.

    Raises
    ------
    UsageError
        The estimate has no uncertainty.
    DataError
        No eye sees the light.

    Examples
    --------
    >>> import numpy as np
    >>> import labrig
    >>> from labrig.fit.fluorescence import (
    ...     Exposure, JointEstimator, fluorescence_system, predicted_colour
    ... )
    >>> from labrig.optics import read_light
    >>> lights = [Exposure(read_light(f"{nm}nm")) for nm in (420, 450, 480, 520, 560, 600, 640)]
    >>> system = fluorescence_system(lights, labrig.read_camera("canon_eos_5d_mark_ii"))
    >>> value = system.values(np.full(41, 0.3), np.zeros((41, 49)))
    >>> fit = JointEstimator(system).fit("grey", value, (0.001 * value) ** 2 + 1e-12)
    >>> colour = predicted_colour(fit, read_light("A"))
    >>> bool(abs(colour.lab[0] - 61.65) < 1 and 0 < colour.lab_sigma[0] < 1)
    True
    """
    if fit.surfaces is None:
        raise UsageError(
            f"expected an estimate with its uncertainty, got one by '{fit.method}'; use 'joint'"
        )
    matrix = fit.matrix
    found = appearance(matrix, light)
    eye = observer(CIE_1931)
    nodes, weights = quadrature(
        *eye.wavelength_nm[[0, -1]], eye.wavelength_nm, light.wavelength_nm, matrix.output_nm
    )
    power = weights * light.at(nodes)
    functions = np.array([np.interp(nodes, eye.wavelength_nm, f) for f in eye.functions.T])
    hats = hat_functions(matrix.output_nm, np.clip(nodes, *matrix.output_nm[[0, -1]]))
    white_y = float((functions @ power)[1])
    absorbed = light.in_bands(edges_from_centres(matrix.input_nm)) * matrix.input_width_nm
    by_band = band_integrals(eye.wavelength_nm, eye.functions, matrix.output_edges_nm)
    xyz = fit.surfaces.reflectance @ ((functions * power) @ hats).T
    xyz += (fit.surfaces.reradiation @ absorbed) @ by_band
    xyz /= white_y
    labs = lab(xyz, found.white)
    return PredictedColour(
        light.name,
        found.xyz,
        np.cov(xyz, rowvar=False),
        found.lab,
        np.cov(labs, rowvar=False),
    )
