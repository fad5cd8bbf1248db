"""What is known of a bench before a part is processed."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Self

from labrig.acquire import RigFile
from labrig.bench_optics import read_calibration
from labrig.calibration import (
    BlankFile,
    CameraFile,
    FadeFile,
    IrradianceFile,
    LvfFile,
    read_blank_file,
    read_camera_file,
    read_fade_file,
    read_irradiance_file,
    read_lvf_file,
)
from labrig.material import Material
from labrig.results import FittedDecay, RunResult
from labrig.results.emission_spectrum import EmissionSpectrum


@dataclass(frozen=True)
class Inputs:
    """Calibrations and earlier results; None or empty where nothing is known.

    Attributes
    ----------
    camera, blank, fade, lvf, irradiance
        From a rig file's `optics:`, or measured earlier in the same run.
    spectra
        By patch; under "" of the only one.
    decays
        By patch.
    materials
        As excitation, decay and spectrum together say, by patch; under "" the only one.
    """

    camera: CameraFile | None = None
    blank: BlankFile | None = None
    fade: FadeFile | None = None
    lvf: LvfFile | None = None
    irradiance: IrradianceFile | None = None
    spectra: Mapping[str, EmissionSpectrum] = field(default_factory=dict)
    decays: Mapping[str, FittedDecay] = field(default_factory=dict)
    materials: Mapping[str, Material] = field(default_factory=dict)

    @classmethod
    def of(cls, rig: RigFile) -> Self:
        """Read the files that the rig file names.

        Raises
        ------
        UsageError
            One is missing or malformed.
        """
        optics = rig.optics
        return cls(
            camera=read_calibration(optics.camera_file, "camera.yaml", read_camera_file),
            blank=read_calibration(optics.blank, "blank.yaml", read_blank_file),
            fade=read_calibration(optics.fade, "fade.yaml", read_fade_file),
            lvf=read_calibration(optics.lvf, "lvf.yaml", read_lvf_file),
            irradiance=read_calibration(optics.irradiance, "irradiance.yaml", read_irradiance_file),
        )

    def with_those_of(self, result: RunResult) -> Self:
        """These, and what a result provides; of mappings by patch, the other patches stay."""
        provided: dict[str, Any] = {
            name: {**getattr(self, name), **value} if isinstance(value, Mapping) else value
            for name, value in result.provides().items()
        }
        return replace(self, **provided)
