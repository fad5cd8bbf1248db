"""Result of a reflectance run: albedo and total radiance factor of every patch."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from labrig.calibration import REFLECTANCE_KIND, PatchReflectance, ReflectanceFile
from labrig.foundation.arrays import FloatArray
from labrig.foundation.notebook_views import CsvTable
from labrig.results.budget import HEADLINE_NM, Budget, named
from labrig.results.measured import Measured
from labrig.results.run_result import RunResult


@dataclass(frozen=True, eq=False)
class MeasuredReflectance:
    """Light that a patch sends back at n wavelengths.

    Attributes
    ----------
    wavelength_nm
        Wavelengths in nm, shape (n,).
    albedo, albedo_sigma
        Albedo R and σ, shape (n,).
    radiance_factor, radiance_factor_sigma
        All light that comes back under the lamp over that of a diffuse white, and σ, shape (n,).
    glow
        Part of `radiance_factor` that is the glow at lamp off, shape (n,).
    luminescence
        Luminescence under the lamp over the glow just after lamp off, with σ: 1 without prompt
        fluorescence; NaN where nothing glows.
    thrown_back
        Part of the light that the filter on the sample throws back onto it, with σ.
    misfit
        Root of χ² per degree of freedom of the albedo's fit to all channels.
    common_sigma
        Relative σ that all numbers have in common.
    """

    wavelength_nm: FloatArray
    albedo: FloatArray
    albedo_sigma: FloatArray
    radiance_factor: FloatArray
    radiance_factor_sigma: FloatArray
    glow: FloatArray
    luminescence: Measured
    thrown_back: Measured
    misfit: float
    common_sigma: float

    @property
    def excess(self) -> FloatArray:
        """Radiance factor minus albedo: prompt fluorescence and steady glow, shape (n,)."""
        return self.radiance_factor - self.albedo

    def for_file(self) -> PatchReflectance:
        """Return the numbers in the form of a reflectance file."""
        return PatchReflectance(
            wavelength_nm=tuple(self.wavelength_nm.tolist()),
            albedo=tuple(self.albedo.tolist()),
            albedo_sigma=tuple(self.albedo_sigma.tolist()),
            radiance_factor=tuple(self.radiance_factor.tolist()),
            radiance_factor_sigma=tuple(self.radiance_factor_sigma.tolist()),
            common_sigma=self.common_sigma,
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class ReflectanceResult(RunResult):
    """Albedo and total radiance factor.

    Attributes
    ----------
    lamp
        Name of the lamp to which the radiance factors belong.
    patches
        Reflectance of each patch by its name; that of the only one under "".
    drift
        Relative change of the card's light from before the sample to after it, in white and in
        narrow light.
    calibration
        Numbers of all patches for later runs; the file `reflectance.yaml`.

    Examples
    --------
    >>> result = labrig.read_result(run)  # doctest: +SKIP
    >>> for patch in result.patches.values():
    ...     print(dict(zip(patch.wavelength_nm, patch.albedo)), patch.luminescence.value)
    """

    kind: ClassVar[str] = "reflectance"

    lamp: str
    patches: Mapping[str, MeasuredReflectance]
    drift: tuple[float, float]
    calibration: ReflectanceFile

    def budgets(self) -> dict[str, Budget]:
        """Return the budgets of the albedo nearest to some wavelengths."""
        budgets = {}
        for name, patch in self.patches.items():
            for near_nm in HEADLINE_NM:
                at = int(np.argmin(np.abs(patch.wavelength_nm - near_nm)))
                albedo = Measured(float(patch.albedo[at]), float(patch.albedo_sigma[at]))
                budgets[named(name, f"albedo at {patch.wavelength_nm[at]:.0f} nm")] = Budget.of(
                    albedo, patch.common_sigma * albedo.value
                )
        return budgets

    def provides(self) -> Mapping[str, Any]:
        """Return the numbers of all patches."""
        return {REFLECTANCE_KIND.name: self.calibration}

    def write_files(self, folder: Path) -> None:
        """Write `reflectance.yaml`."""
        REFLECTANCE_KIND.write(folder, self.calibration)

    def csv_tables(self) -> dict[str, CsvTable]:
        """Return the table `reflectance.csv`."""
        head = (
            *("patch", "wavelength_nm", "albedo", "albedo_sigma"),
            *("radiance_factor", "radiance_factor_sigma"),
        )
        rows = (
            (name, *(f"{number:.6g}" for number in row))
            for name, patch in self.patches.items()
            for row in zip(
                patch.wavelength_nm,
                patch.albedo,
                patch.albedo_sigma,
                patch.radiance_factor,
                patch.radiance_factor_sigma,
                strict=True,
            )
        )
        return {"reflectance.csv": CsvTable(head, rows)}
