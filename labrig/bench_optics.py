"""What a rig file's `optics:` names: measured curves, and calibrations of the bench."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from labrig import resources
from labrig.acquire import RigFile
from labrig.calibration import CalibrationKind, LvfFile
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

FileT = TypeVar("FileT")

_SUFFIX = ".csv"


def camera_curves(
    rig: RigFile, instead: str | None = None, lvf: LvfFile | None = None
) -> CameraResponse:
    """The camera's curves: those a person wants `instead`, else as the calibration of a filter
    found them, else the rig's.

    Of a filter and a camera it is their product that a calibration knows best: whoever reads light
    through the filter takes both from it. And it has measured this body, not another of its model.

    Raises
    ------
    UsageError
        Nobody names any, or there are none of that name.
    """
    if instead is None and lvf is not None and lvf.camera is not None:
        found = lvf.camera.response()
        return replace(found, name=f"{found.name}, as the filter's calibration found them")
    return read_camera(instead or _named(rig.optics.camera, "camera"))


def calibration(rig: RigFile, kind: CalibrationKind[FileT]) -> FileT | None:
    """What the rig file names as a calibration of that kind; None if it names none.

    Raises
    ------
    UsageError
        It is missing or malformed.
    """
    named = rig.optics.named(kind)
    return None if named is None else kind.read_named(Path(named))


def lamp_spectrum(rig: RigFile) -> Spectrum:
    """The usual lamp's spectrum, relative."""
    return read_spectrum(_path(_named(rig.optics.lamp, "lamp")))


def card_reflectance(rig: RigFile) -> Transmittance:
    """The grey card's reflectance."""
    return read_transmittance(_path(_named(rig.optics.grey_card, "grey_card")))


def filter_transmittances(rig: RigFile, names: Sequence[str]) -> list[Transmittance]:
    """Of colour filters, in that order.

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


def _named(value: str | None, key: str) -> str:
    if value is None:
        raise UsageError(
            f"the rig file does not say which {key.replace('_', ' ')} it has; name its curve under "
            f"'optics:', such as '{key}: ./my-{key.replace('_', '-')}.csv'"
        )
    return value


def _path(named: str) -> Path:
    """A file as given, or the shipped one of that name."""
    path = Path(named)
    if path.suffix or len(path.parts) > 1:
        return path
    return resources.folder("config/optics") / f"{named}{_SUFFIX}"
