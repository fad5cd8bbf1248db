"""The reflectance file: albedo and total radiance factor of samples."""

from itertools import pairwise
from typing import Literal, Self

from pydantic import Field, model_validator

from labrig.calibration.kind import CalibrationKind
from labrig.foundation.models import FrozenModel, NotNegative, Positive

Numbers = tuple[NotNegative, ...]


class PatchReflectance(FrozenModel):
    """Albedo and total radiance factor of one sample, a number for each wavelength.

    Attributes
    ----------
    wavelength_nm
        Rising wavelengths in nm. Each number is the mean about its wavelength, half-way to its
        neighbours.
    albedo, albedo_sigma
        Fraction of the light that comes back at its own wavelength, relative to a diffuse white,
        and σ with what all numbers have in common.
    radiance_factor, radiance_factor_sigma
        All light that comes back under the lamp, with prompt fluorescence and steady glow, relative
        to a diffuse white beside it, and σ.
    common_sigma
        Relative standard uncertainty common to all numbers.
    """

    wavelength_nm: tuple[Positive, ...] = Field(min_length=2)
    albedo: Numbers
    albedo_sigma: Numbers
    radiance_factor: Numbers
    radiance_factor_sigma: Numbers
    common_sigma: NotNegative

    @model_validator(mode="after")
    def _one_number_each(self) -> Self:
        nm = self.wavelength_nm
        if any(right <= left for left, right in pairwise(nm)):
            raise ValueError(f"expected rising numbers in 'wavelength_nm', got {list(nm)}")
        columns = (
            self.albedo,
            self.albedo_sigma,
            self.radiance_factor,
            self.radiance_factor_sigma,
        )
        if any(len(column) != len(nm) for column in columns):
            raise ValueError(f"expected {len(nm)} numbers, one a wavelength, in every column")
        return self


class ReflectanceFile(FrozenModel):
    """Albedo and total radiance factor of each sample of a run.

    Attributes
    ----------
    lamp
        Name of the lamp's spectrum, to which the radiance factors belong.
    patches
        Numbers of each patch; those of the only one under "".
    source, run
        Origin of the numbers.

    Examples
    --------
    >>> from labrig.calibration import PatchReflectance, ReflectanceFile
    >>> grey = PatchReflectance(
    ...     wavelength_nm=(400, 700), albedo=(0.2, 0.2), albedo_sigma=(0.01, 0.01),
    ...     radiance_factor=(0.2, 0.2), radiance_factor_sigma=(0.01, 0.01), common_sigma=0.01,
    ... )
    >>> ReflectanceFile(lamp="halogen", patches={"": grey}).patches[""].albedo
    (0.2, 0.2)
    """

    kind: Literal["reflectance"] = "reflectance"
    lamp: str
    patches: dict[str, PatchReflectance] = Field(min_length=1)
    source: str = ""
    run: str | None = None


REFLECTANCE_KIND = CalibrationKind(
    name="reflectance",
    protocol="reflectance",
    optics_key="reflectance",
    file_name="reflectance.yaml",
    model=ReflectanceFile,
    of_bench=False,
)
