"""Re-radiation of one patch under LEDs, and what several methods say of the same sample."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from labrig.foundation.arrays import BoolArray, FloatArray
from labrig.foundation.notebook_views import NotebookViews
from labrig.material import ReradiationMatrix, ReradiationMixture
from labrig.results.measured import Measured

#: All LEDs together, the thesis's method of one LED by itself.
EstimateMethod = Literal["joint", "per-led"]
#: The same, and a spectrometer that reads each column of the matrix.
MeasuringMethod = Literal["joint", "per-led", "direct"]


@dataclass(frozen=True, eq=False)
class ReradiatedSpectrum:
    """Re-radiated light, as part of the light that falls in.

    Attributes
    ----------
    output_nm
        Middles of the bands of the returning light in nm, shape (o,).
    value, sigma
        Re-radiation in 1/nm of output and its σ, shape (o,); NaN where it is not measured, and no σ
        where the method has none.
    """

    output_nm: FloatArray
    value: FloatArray
    sigma: FloatArray | None


@dataclass(frozen=True, eq=False)
class ReradiationUnderLight:
    """Re-radiation of a sample under one narrow-band light, by each method.

    Attributes
    ----------
    light, peak_nm
        Name of the light, and its peak in nm.
    joint, per_led
        Re-radiation by all LEDs together, and by one LED by itself.
    direct
        Re-radiation as a spectrometer read it; None without a direct measurement.
    """

    light: str
    peak_nm: float
    joint: ReradiatedSpectrum
    per_led: ReradiatedSpectrum
    direct: ReradiatedSpectrum | None


@dataclass(frozen=True)
class MethodDifference:
    """Colour difference between the matrices of two methods under a light.

    Attributes
    ----------
    first, second
        The methods.
    light
        Name of the light; its perfect white is the white.
    delta_e
        ΔE2000. What a direct measurement does not reach is taken from the other method.
    """

    first: MeasuringMethod
    second: MeasuringMethod
    light: str
    delta_e: float


@dataclass(frozen=True, eq=False)
class MixtureOfMatrix:
    """Mixture of normal densities that stands for the measured part of a matrix.

    Attributes
    ----------
    scale
        Integral of the re-radiation over input and output in nm.
    weights, mean_nm, covariance_nm2
        Weights, means [input, output] in nm and covariances in nm², shapes (K,), (K, 2), (K, 2, 2).
    measured_nm
        Ends in nm of the incident light to which it was fitted. What it says beyond is the tail of
        its densities, and was not measured.
    threshold
        Least value per band that counted as re-radiation.
    kept_entries, entries
        Number of entries above the threshold, and of all measured ones.
    masked_mse
        Mean squared error per band.
    band_nm
        Width of the output bands in nm.
    """

    scale: float
    weights: FloatArray
    mean_nm: FloatArray
    covariance_nm2: FloatArray
    measured_nm: tuple[float, float]
    threshold: float
    kept_entries: int
    entries: int
    masked_mse: float
    band_nm: float

    @property
    def mixture(self) -> ReradiationMixture:
        """The densities, to draw from or to evaluate."""
        return ReradiationMixture(self.scale, self.weights, self.mean_nm, self.covariance_nm2)

    def to_dict(self) -> dict[str, Any]:
        """Return the content of `mixture.json`, with the keys of `labrig fit mixture`."""
        return {
            "scale": self.scale * self.band_nm,
            "band_nm": self.band_nm,
            "unit": "1/nm",
            "components": [
                {
                    "weight": float(weight),
                    "mean": np.asarray(mean).tolist(),
                    "covariance": np.asarray(covariance).tolist(),
                }
                for weight, mean, covariance in zip(
                    self.weights, self.mean_nm, self.covariance_nm2, strict=True
                )
            ],
            "scaling": "integral",
            "measured_input_nm": list(self.measured_nm),
            "threshold": self.threshold,
            "kept_entries": self.kept_entries,
            "entries": self.entries,
            "masked_mse": self.masked_mse,
        }


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
class FluorescentPatch(NotebookViews):
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
        Signal under the first LED at the end of the run over that at its start.
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
