"""Calibrations of a bench as files, written by calibration protocols and read by later ones.

To add a kind, write its file's module with its `CalibrationKind` and list that in `KINDS`: rig
files then accept its key. Analyses find it in the field of the same name of
`labrig.analyse.part.Inputs`.
"""

from typing import Any

from labrig.calibration.blank_file import BLANK_KIND, BlankFile, read_blank_file, write_blank_file
from labrig.calibration.camera_file import (
    CAMERA_KIND,
    CameraFile,
    Linearity,
    Noise,
    read_camera_file,
    write_camera_file,
)
from labrig.calibration.fade_file import (
    FADE_KIND,
    Change,
    FadeFile,
    Warming,
    read_fade_file,
    write_fade_file,
)
from labrig.calibration.irradiance_file import (
    IRRADIANCE_KIND,
    IrradianceFile,
    read_irradiance_file,
    write_irradiance_file,
)
from labrig.calibration.kind import CalibrationKind
from labrig.calibration.lvf_file import (
    LVF_KIND,
    BandColumns,
    CurveColumns,
    LvfFile,
    WavelengthColumns,
    read_lvf_file,
    write_lvf_file,
)

#: Every kind, in the order of their keys in a rig file.
KINDS: tuple[CalibrationKind[Any], ...] = (
    CAMERA_KIND,
    LVF_KIND,
    IRRADIANCE_KIND,
    FADE_KIND,
    BLANK_KIND,
)

__all__ = [
    "BLANK_KIND",
    "CAMERA_KIND",
    "FADE_KIND",
    "IRRADIANCE_KIND",
    "KINDS",
    "LVF_KIND",
    "BandColumns",
    "BlankFile",
    "CalibrationKind",
    "CameraFile",
    "Change",
    "CurveColumns",
    "FadeFile",
    "IrradianceFile",
    "Linearity",
    "LvfFile",
    "Noise",
    "Warming",
    "WavelengthColumns",
    "read_blank_file",
    "read_camera_file",
    "read_fade_file",
    "read_irradiance_file",
    "read_lvf_file",
    "write_blank_file",
    "write_camera_file",
    "write_fade_file",
    "write_irradiance_file",
    "write_lvf_file",
]
