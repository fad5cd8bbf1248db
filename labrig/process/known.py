"""What is known of a bench before a stage is processed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from labrig.acquire import RigFile
from labrig.errors import UsageError
from labrig.fit import DecayFit
from labrig.material import Material

if TYPE_CHECKING:
    from labrig.calibration.blank_file import BlankFile
    from labrig.calibration.camera_file import CameraFile
    from labrig.calibration.fade_file import FadeFile
    from labrig.calibration.irradiance_file import IrradianceFile
    from labrig.calibration.lvf_file import LvfFile
    from labrig.process.emission_spectrum import EmissionSpectrum

FileT = TypeVar("FileT")


@dataclass(frozen=True)
class Known:
    """Calibrations and earlier results; None where nothing is known.

    Attributes
    ----------
    camera, blank, fade, lvf, irradiance
        From a rig file's `optics:`, or measured earlier in the same run.
    spectrum
        Of the sample.
    decays
        By patch.
    material
        As excitation, decay and spectrum together say.
    """

    camera: CameraFile | None = None
    blank: BlankFile | None = None
    fade: FadeFile | None = None
    lvf: LvfFile | None = None
    irradiance: IrradianceFile | None = None
    spectrum: EmissionSpectrum | None = None
    decays: dict[str, DecayFit] | None = None
    material: Material | None = None

    @classmethod
    def of(cls, rig: RigFile) -> Known:
        """Read the files that the rig file names.

        Raises
        ------
        UsageError
            One is missing or malformed.
        """
        optics = rig.optics
        if not any((optics.camera_file, optics.blank, optics.fade, optics.lvf, optics.irradiance)):
            return cls()
        from labrig import calibration as files

        return cls(
            camera=_read(optics.camera_file, "camera.yaml", files.read_camera_file),
            blank=_read(optics.blank, "blank.yaml", files.read_blank_file),
            fade=_read(optics.fade, "fade.yaml", files.read_fade_file),
            lvf=_read(optics.lvf, "lvf.yaml", files.read_lvf_file),
            irradiance=_read(optics.irradiance, "irradiance.yaml", files.read_irradiance_file),
        )


def _read(named: str | None, name: str, read: Callable[[Path], FileT]) -> FileT | None:
    """The file itself, or that of a run folder's result."""
    if named is None:
        return None
    path = Path(named)
    if not path.is_dir():
        return read(path)
    found = path / "result" / name
    if not found.is_file():
        raise UsageError(f"{path}: expected a run with result/{name}, got none; process it first")
    return read(found)
