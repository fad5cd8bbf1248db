from .blank_file import (
    BLANK_KIND as BLANK_KIND,
    BlankFile as BlankFile,
)
from .camera_file import (
    CAMERA_KIND as CAMERA_KIND,
    TYPICAL_FLICKER as TYPICAL_FLICKER,
    TYPICAL_SHUTTER_S as TYPICAL_SHUTTER_S,
    CameraFile as CameraFile,
    Linearity as Linearity,
    Noise as Noise,
    Settings as Settings,
    flicker_of as flicker_of,
    relative_sensitivity as relative_sensitivity,
    shutter_sigma as shutter_sigma,
)
from .fade_file import (
    FADE_KIND as FADE_KIND,
    Change as Change,
    FadeFile as FadeFile,
    Warming as Warming,
)
from .irradiance_file import (
    IRRADIANCE_KIND as IRRADIANCE_KIND,
    CardLight as CardLight,
    IrradianceFile as IrradianceFile,
)
from .kept import (
    KeptCalibration as KeptCalibration,
    keep_calibration as keep_calibration,
    kept_calibrations as kept_calibrations,
)
from .kind import (
    CalibrationKind as CalibrationKind,
    kinds as kinds,
)
from .leds_file import (
    LEDS_KIND as LEDS_KIND,
    UV_NM as UV_NM,
    CalibratedLed as CalibratedLed,
    LedsFile as LedsFile,
    LedSource as LedSource,
    UvScale as UvScale,
)
from .lvf_file import (
    LVF_KIND as LVF_KIND,
    BandColumns as BandColumns,
    CurveColumns as CurveColumns,
    LvfFile as LvfFile,
    WavelengthColumns as WavelengthColumns,
)
from .reference_file import (
    REFERENCE_KIND as REFERENCE_KIND,
    CardPicture as CardPicture,
    ReferenceFile as ReferenceFile,
)
from .reflectance_file import (
    REFLECTANCE_KIND as REFLECTANCE_KIND,
    PatchReflectance as PatchReflectance,
    ReflectanceFile as ReflectanceFile,
)
