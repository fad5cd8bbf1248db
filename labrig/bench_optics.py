"""Optical data named under `optics:` in a rig file: measured curves and calibrations."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel

from labrig import resources
from labrig.acquire import RigFile
from labrig.calibration import CalibrationKind, LvfFile, kinds
from labrig.errors import UsageError
from labrig.optics import (
    CameraResponse,
    Spectrum,
    Transmittance,
    read_camera,
    read_spectrum,
    read_transmittance,
)
from labrig.yaml_file import did_you_mean

FileT = TypeVar("FileT", bound=BaseModel)

_SUFFIX = ".csv"


def camera_curves(
    rig: RigFile, instead: str | None = None, lvf: LvfFile | None = None
) -> CameraResponse:
    """Read the camera's curves: those of `instead`, of a filter's calibration, or of the rig.

    The order is one of precedence. A filter's calibration determines the product of filter and
    camera, so light read through the filter takes both from it; it has also measured this body, not
    another one of its model.

    Raises
    ------
    UsageError
        No curves are named, or there are none of that name.
    """
    if instead is None and lvf is not None and lvf.camera is not None:
        calibrated = lvf.camera.response()
        return replace(
            calibrated, name=f"{calibrated.name}, as the filter's calibration found them"
        )
    return read_camera(instead or _named(rig.optics.camera, "camera"))


def calibration(rig: RigFile, kind: CalibrationKind[FileT]) -> FileT | None:
    """Read the calibration of that kind named in the rig file; None if none is named.

    Raises
    ------
    UsageError
        The file is missing or malformed.
    """
    named = rig.optics.named(kind)
    return None if named is None else kind.read(Path(named))


def lamp_spectrum(rig: RigFile) -> Spectrum:
    """Read the relative spectrum of the rig's lamp."""
    return read_spectrum(_path(_named(rig.optics.lamp, "lamp")))


def card_reflectance(rig: RigFile) -> Transmittance:
    """Read the reflectance of the rig's grey card."""
    return read_transmittance(_path(_named(rig.optics.grey_card, "grey_card")))


def filter_transmittances(rig: RigFile, names: Sequence[str]) -> list[Transmittance]:
    """Read the transmittances of colour filters, in the order of `names`.

    Raises
    ------
    UsageError
        There is no file of that name in the rig's folder.
    """
    files = rig.optics.filter_files()
    if unknown := [name for name in names if name not in files]:
        raise UsageError(
            f"{next(iter(files.values())).parent}: no file for the colour filter '{unknown[0]}'; "
            f"{did_you_mean(unknown[0], list(files))}"
        )
    return [read_transmittance(files[name]) for name in names]


def require_optics(rig: RigFile) -> None:
    """Read all that a rig file names under `optics:`, since a run needs it hours later only.

    Raises
    ------
    UsageError
        A file is missing or malformed, or there is none of that name.
    """
    if rig.optics.camera is not None:
        read_camera(rig.optics.camera)
    if rig.optics.lamp is not None:
        lamp_spectrum(rig)
    if rig.optics.grey_card is not None:
        card_reflectance(rig)
    if rig.optics.filters is not None:
        rig.optics.filter_files()
    for kind in kinds():
        calibration(rig, kind)


def _named(value: str | None, key: str) -> str:
    if value is None:
        raise UsageError(
            f"the rig file does not say which {key.replace('_', ' ')} it has; name its curve under "
            f"'optics:', such as '{key}: ./my-{key.replace('_', '-')}.csv'"
        )
    return value


def _path(named: str) -> Path:
    """Return a file as given, or the shipped one of that name."""
    path = Path(named)
    if path.suffix or len(path.parts) > 1:
        return path
    return resources.folder("config/optics") / f"{named}{_SUFFIX}"
