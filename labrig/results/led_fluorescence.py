"""Result of a fluorescence run: the re-radiation matrix of each sample, with its uncertainty."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import isnan
from pathlib import Path
from typing import ClassVar, Literal

import numpy as np

from labrig.foundation.arrays import BoolArray, FloatArray
from labrig.foundation.output_file import make_folder_in
from labrig.material import Provenance, ReradiationMatrix, write_fluorescent
from labrig.results.budget import Budget, named
from labrig.results.measured import Measured
from labrig.results.reradiation_methods import (
    EstimateMethod,
    MethodDifference,
    MixtureOfMatrix,
    ReradiationUnderLight,
)
from labrig.results.run_result import RunResult
from labrig.results.text_files import write_csv, write_json


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


@dataclass(frozen=True, eq=False, kw_only=True)
class LedFluorescenceResult(RunResult):
    """Re-radiation matrices of samples.

    Attributes
    ----------
    leds
        Names of the m lights that were used: LEDs, then lamps.
    led_peak_nm
        Their peaks in nm, shape (m,).
    channels
        Names of the k channels.
    brightness
        Brightness of each LED by the card, shape (m,).
    is_brightness_known
        Whether it is known: the camera sees the LED, or a calibration tells it, shape (m,).
    uv_scale
        "measured" if the brightness of every LED below 400 nm is known, "unknown" if not, "none"
        without such an LED.
    patches
        The samples by name.
    lamps
        Names of those lights that are broadband lamps.
    geometry
        Angles of LEDs and camera, and polarisers, such as `45°/0°`; empty if the rig file does not
        tell. The reflectance is the radiance factor of that geometry.

    Examples
    --------
    >>> result = labrig.read_result(run)  # doctest: +SKIP
    >>> for name, patch in result.patches.items():
    ...     print(name, patch.matrix.named(name).reradiated_fraction.max())
    """

    kind: ClassVar[str] = "led_fluorescence"

    leds: tuple[str, ...]
    led_peak_nm: FloatArray
    channels: tuple[str, ...]
    brightness: FloatArray
    is_brightness_known: BoolArray
    uv_scale: Literal["measured", "unknown", "none"]
    patches: Mapping[str, FluorescentPatch]
    run: str
    geometry: str = ""
    lamps: tuple[str, ...] = ()

    @property
    def is_lamp(self) -> BoolArray:
        """Whether a light is a broadband lamp, which has no wavelength of its own, shape (m,)."""
        return np.isin(self.leds, self.lamps)

    def budgets(self) -> dict[str, Budget]:
        """Return the budgets of quantum yields and of the colour under the first light.

        Their σ is that of the joint fit, with lights and curves in it; the other method has none.
        """
        budgets: dict[str, Budget] = {}
        for name, patch in self.patches.items():
            values = {
                f"quantum yield of dye {number}": (dye.quantum_yield.value, dye.quantum_yield.sigma)
                for number, dye in enumerate(patch.dyes, start=1)
            }
            for colour in patch.colours[:1]:
                axes = zip(("L*", "a*", "b*"), colour.lab, colour.lab_sigma, strict=True)
                values |= {f"{axis} under {colour.light}": (at, sigma) for axis, at, sigma in axes}
            budgets |= {
                named(name, quantity): Budget(value, undivided=None if isnan(sigma) else sigma)
                for quantity, (value, sigma) in values.items()
                if not isnan(value)
            }
        return budgets

    def write_files(self, folder: Path) -> None:
        """Write a material file, its matrix and mixture for each sample, and a table of colours."""
        for name, patch in self.patches.items():
            place = make_folder_in(folder, name) if len(self.patches) > 1 else folder
            note = f"method: {patch.method}; ultraviolet scale: {self.uv_scale}"
            if self.geometry:
                note += f"; radiance factors at {self.geometry}"
            origin = Provenance(
                source="photographs under LEDs, with labrig", run=self.run, note=note
            )
            write_fluorescent(place / "material.yaml", patch.matrix.named(name), origin)
            if patch.mixture is not None:
                write_json(place / "mixture.json", patch.mixture.to_dict())
        write_csv(
            folder / "colours.csv",
            ("patch", "light", "L", "a", "b", "L_sigma", "a_sigma", "b_sigma", "depends_on_uv"),
            (
                (
                    name,
                    colour.light,
                    *(f"{number:.4f}" for number in colour.lab),
                    *("" if isnan(sigma) else f"{sigma:.4f}" for sigma in colour.lab_sigma),
                    str(colour.depends_on_uv).lower(),
                )
                for name, patch in self.patches.items()
                for colour in patch.colours
            ),
        )
