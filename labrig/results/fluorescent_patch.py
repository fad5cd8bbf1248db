"""Re-radiation of one patch under LEDs."""

from dataclasses import dataclass

from labrig.foundation.arrays import BoolArray, FloatArray
from labrig.material import ReradiationMatrix
from labrig.results.measured import Measured
from labrig.results.reradiation_methods import (
    EstimateMethod,
    MethodDifference,
    MixtureOfMatrix,
    ReradiationUnderLight,
)


@dataclass(frozen=True, eq=False)
class MatrixOnBands:
    """A re-radiation matrix.

    Attributes
    ----------
    input_nm, output_nm
        Middles of the bands of incident (i,) and of returning light (o,) in nm.
    reflectance, reflectance_sigma
        Radiance factor without re-radiation and its σ, shape (o,).
    reradiation, reradiation_sigma
        Re-radiation in 1/nm of output and its σ, shape (o, i).
    """

    input_nm: FloatArray
    output_nm: FloatArray
    reflectance: FloatArray
    reflectance_sigma: FloatArray | None
    reradiation: FloatArray
    reradiation_sigma: FloatArray | None

    @classmethod
    def of(cls, matrix: ReradiationMatrix) -> "MatrixOnBands":
        """Return the numbers of a matrix."""
        return cls(
            matrix.input_nm,
            matrix.output_nm,
            matrix.reflectance,
            matrix.reflectance_sigma,
            matrix.reradiation,
            matrix.reradiation_sigma,
        )

    def named(self, name: str) -> ReradiationMatrix:
        """Return the matrix as a material's."""
        return ReradiationMatrix(
            name,
            self.input_nm,
            self.output_nm,
            self.reflectance,
            self.reradiation,
            reflectance_sigma=self.reflectance_sigma,
            reradiation_sigma=self.reradiation_sigma,
        )


@dataclass(frozen=True, eq=False)
class MeasuredDye:
    """A dye of a sample.

    Attributes
    ----------
    emission, emission_sigma
        Emission with unit integral in 1/nm and its σ, shape (o,); NaN: the method has no σ.
    excitation, excitation_sigma
        Fraction of the light of each input band that the dye would emit over all of its emission,
        and its σ, shape (i,); NaN: the method has no σ.
    quantum_yield
        Photons emitted per photon that does not come back at its own wavelength; NaN where no light
        tells it.
    """

    emission: FloatArray
    emission_sigma: FloatArray
    excitation: FloatArray
    excitation_sigma: FloatArray
    quantum_yield: Measured


@dataclass(frozen=True)
class ColourUnderLight:
    """Colour of a sample under a light, for the CIE 1931 2° observer.

    Attributes
    ----------
    light
        Name of the light.
    lab
        L*, a*, b* with a perfect white under the light.
    lab_sigma
        Their standard deviations; NaN: the method has none.
    depends_on_uv
        Whether the colour changes with the brightness of ultraviolet lights that is not known.
    """

    light: str
    lab: tuple[float, float, float]
    lab_sigma: tuple[float, float, float]
    depends_on_uv: bool


@dataclass(frozen=True, eq=False)
class FluorescentPatch:
    """A sample under every LED, and its matrix.

    Attributes
    ----------
    method
        Method of `matrix` and of all that follows from it: "joint", all LEDs together, with σ, or
        "per-led", the thesis's, each LED by itself, without.
    matrix, other
        Matrix by this method, and by the other one.
    is_extrapolated
        Whether no LED of known brightness reached an input band, shape (i,): there the numbers are
        extrapolated, and may be off by more than their σ.
    dyes
        The dyes by rising wavelength of their emission, of the most probable number of them; always
        one per LED.
    probability
        Probability of each number of dyes from 0 on; none per LED.
    value, sigma
        Values of each channel under each LED in DN/s, as if it shone evenly, and their σ, (m, k).
    predicted
        The same of the matrix, shape (m, k).
    pull
        `value` less `predicted` over their σ, with that of lights and curves, shape (m, k).
    reduced_chi2
        χ² per degree of freedom; NaN per LED, which has more parameters than values.
    colours
        Colours under some lights.
    bleaching
        Signal under the first LED at the end of the run over that at its begin.
    mixture
        Mixture of normal densities of the measured part of the matrix; None without a dye, or where
        the LEDs excited none.
    direct
        Matrix as a spectrometer measured it, NaN where it did not; None without it.
    under_lights
        Re-radiation by each method under each light: those of the direct measurement, else the
        LEDs.
    differences
        Colour differences between the methods.
    """

    method: EstimateMethod
    matrix: MatrixOnBands
    other: MatrixOnBands
    is_extrapolated: BoolArray
    dyes: tuple[MeasuredDye, ...]
    probability: tuple[float, ...]
    value: FloatArray
    sigma: FloatArray
    predicted: FloatArray
    pull: FloatArray
    reduced_chi2: float
    colours: tuple[ColourUnderLight, ...]
    bleaching: Measured | None
    mixture: MixtureOfMatrix | None
    direct: MatrixOnBands | None
    under_lights: tuple[ReradiationUnderLight, ...]
    differences: tuple[MethodDifference, ...]

    @property
    def joint(self) -> MatrixOnBands:
        """The matrix by all LEDs together."""
        return self.matrix if self.method == "joint" else self.other

    @property
    def per_led(self) -> MatrixOnBands:
        """The matrix by the thesis's method, each LED by itself."""
        return self.matrix if self.method == "per-led" else self.other
