"""Result of a fluorescence run: the re-radiation matrix of each sample, with its uncertainty."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import isnan
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np

from labrig.foundation.arrays import BoolArray, FloatArray
from labrig.foundation.notebook_views import CsvTable
from labrig.foundation.output_file import make_folder_in
from labrig.material import Provenance, write_fluorescent
from labrig.results.budget import Budget, named
from labrig.results.fluorescent_patch import FluorescentPatch
from labrig.results.run_result import RunResult
from labrig.results.text_files import write_json


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
        """True for broadband lamps, which have no wavelength of their own, shape (m,)."""
        return np.isin(self.leds, self.lamps)

    def provides(self) -> Mapping[str, Any]:
        """Return the re-radiation matrices by patch."""
        return {"matrices": {name: patch.matrix for name, patch in self.patches.items()}}

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

    def csv_tables(self) -> dict[str, CsvTable]:
        """Return the table of colours under lights, `colours.csv`."""
        head = ("patch", "light", "L", "a", "b", "L_sigma", "a_sigma", "b_sigma", "depends_on_uv")
        rows = (
            (
                name,
                colour.light,
                *(f"{number:.4f}" for number in colour.lab),
                *("" if isnan(sigma) else f"{sigma:.4f}" for sigma in colour.lab_sigma),
                str(colour.depends_on_uv).lower(),
            )
            for name, patch in self.patches.items()
            for colour in patch.colours
        )
        return {"colours.csv": CsvTable(head, rows)}

    def write_files(self, folder: Path) -> None:
        """Write a material file, its matrix and mixture for each sample."""
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
