"""Calibrations of a bench as files: what its own protocols measure and later ones use."""

from labrig.calibration.blank_file import BlankFile, read_blank_file, write_blank_file
from labrig.calibration.camera_file import (
    CameraFile,
    Linearity,
    Noise,
    read_camera_file,
    write_camera_file,
)
from labrig.calibration.fade_file import (
    Change,
    FadeFile,
    Warming,
    read_fade_file,
    write_fade_file,
)
from labrig.calibration.irradiance_file import (
    IrradianceFile,
    read_irradiance_file,
    write_irradiance_file,
)
from labrig.calibration.lvf_file import LvfFile, read_lvf_file, write_lvf_file

__all__ = [
    "BlankFile",
    "CameraFile",
    "Change",
    "FadeFile",
    "IrradianceFile",
    "Linearity",
    "LvfFile",
    "Noise",
    "Warming",
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
