"""The measured curves that a rig file's `optics:` names, where a calibration cannot do without."""

from collections.abc import Sequence
from pathlib import Path

from labrig import shipped
from labrig.acquire import RigFile
from labrig.analyse.choices import Choices
from labrig.calibration import LvfFile
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

_SUFFIX = ".csv"


def camera_curves(rig: RigFile, choices: Choices, lvf: LvfFile | None = None) -> CameraResponse:
    """Those a person wants, else as the calibration of a filter found them, else the rig's.

    Of a filter and a camera it is their product that a calibration knows best: whoever reads light
    through the filter takes both from it.
    """
    if choices.camera is None and lvf is not None and lvf.camera is not None:
        return lvf.camera.response()
    return read_camera(choices.camera or _named(rig.optics.camera, "camera"))


def lamp_spectrum(rig: RigFile) -> Spectrum:
    """Of the usual lamp, relative."""
    return read_spectrum(_path(_named(rig.optics.lamp, "lamp")))


def card_reflectance(rig: RigFile) -> Transmittance:
    """Of the grey card."""
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
    return shipped.folder("config/optics") / f"{named}{_SUFFIX}"
