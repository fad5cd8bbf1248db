"""Calibrations of a bench as files, written by calibration protocols and read by later ones.

To add a kind, write its file's module with its `CalibrationKind` and register that by an entry
point in `labrig.calibrations`: rig files then have its key, and analyses find it by
`Inputs.calibration`.
"""

from labrig.calibration.blank_file import BLANK_KIND, BlankFile
from labrig.calibration.camera_file import (
    CAMERA_KIND,
    CameraFile,
    Linearity,
    Noise,
    Settings,
    relative_sensitivity,
)
from labrig.calibration.fade_file import (
    FADE_KIND,
    Change,
    FadeFile,
    Warming,
)
from labrig.calibration.irradiance_file import (
    IRRADIANCE_KIND,
    CardLight,
    IrradianceFile,
)
from labrig.calibration.kept import (
    KeptCalibration,
    keep_calibration,
    kept_calibrations,
)
from labrig.calibration.kind import CalibrationKind, kinds
from labrig.calibration.leds_file import (
    LEDS_KIND,
    UV_NM,
    CalibratedLed,
    LedsFile,
    LedSource,
    UvScale,
)
from labrig.calibration.lvf_file import (
    LVF_KIND,
    BandColumns,
    CurveColumns,
    LvfFile,
    WavelengthColumns,
)
from labrig.calibration.reference_file import (
    REFERENCE_KIND,
    CardPicture,
    ReferenceFile,
)
from labrig.calibration.reflectance_file import (
    REFLECTANCE_KIND,
    PatchReflectance,
    ReflectanceFile,
)

__all__ = [
    "BLANK_KIND",
    "CAMERA_KIND",
    "FADE_KIND",
    "IRRADIANCE_KIND",
    "LEDS_KIND",
    "LVF_KIND",
    "REFERENCE_KIND",
    "REFLECTANCE_KIND",
    "UV_NM",
    "BandColumns",
    "BlankFile",
    "CalibratedLed",
    "CalibrationKind",
    "CameraFile",
    "CardLight",
    "CardPicture",
    "Change",
    "CurveColumns",
    "FadeFile",
    "IrradianceFile",
    "KeptCalibration",
    "LedSource",
    "LedsFile",
    "Linearity",
    "LvfFile",
    "Noise",
    "PatchReflectance",
    "ReferenceFile",
    "ReflectanceFile",
    "Settings",
    "UvScale",
    "Warming",
    "WavelengthColumns",
    "keep_calibration",
    "kept_calibrations",
    "kinds",
    "relative_sensitivity",
]
