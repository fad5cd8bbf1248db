"""Roles: what protocols can demand of devices; every driver fills one of them.

The module of a role defines everything that depends on it: the methods of its devices, the
actions of protocols, the stand-in of a plan, the exercise of a rig check, whether it gives light.
To add a role, write its module and list it in `ROLES`, and the names that protocols and drivers
need in `__all__`.
"""

from typing import Any

from labrig.acquire.roles.board_device import BoardDevice
from labrig.acquire.roles.camera import CAMERA, Camera, TakeFrame
from labrig.acquire.roles.changer import CHANGER, Changer
from labrig.acquire.roles.door_and_shield import (
    DOOR,
    DOOR_CLOSE,
    DOOR_OPEN,
    SHIELD,
    SHIELD_COVER,
    SHIELD_UNCOVER,
    ServoSwing,
    Swing,
    SwingTo,
)
from labrig.acquire.roles.filter_wheel import (
    CAMERA_FILTER_WHEEL,
    FILTER_WHEEL,
    TurnCameraWheel,
    TurnWheel,
)
from labrig.acquire.roles.known_light import Illuminant, LedLight
from labrig.acquire.roles.lamp import LAMP, LAMP_OFF, LAMP_ON, Lamp, LampSwitch
from labrig.acquire.roles.light_bank import (
    ILLUMINANTS,
    ILLUMINANTS_OFF,
    LEDS,
    LEDS_OFF,
    IlluminantSwitch,
    LedSwitch,
    LightBank,
)
from labrig.acquire.roles.monochromator import (
    MONOCHROMATOR,
    Monochromator,
    MonochromatorBand,
    Tune,
)
from labrig.acquire.roles.places import Places
from labrig.acquire.roles.role import (
    DARK,
    Checkable,
    Device,
    DeviceAction,
    ExerciseContext,
    Exercised,
    FrameReader,
    Guarded,
    KeptAwake,
    Light,
    Measured,
    PlannedDevice,
    Role,
    Suggestion,
)
from labrig.acquire.roles.sample_changer import SAMPLE_CHANGER, BringSample, SampleChanger
from labrig.acquire.roles.spectrometer import (
    SPECTROMETER,
    ReadSpectrum,
    Spectrometer,
    require_integration,
)
from labrig.acquire.roles.thermometer import THERMOMETER, Thermometer
from labrig.acquire.roles.viewfinder import VIEWFINDER, LiveView

#: Roles by their keys in the rig file, in the order in which devices are made safe: lights go out
#: before anything moves.
ROLES: dict[str, Role[Any]] = {
    role.key: role
    for role in (
        LAMP,
        LEDS,
        ILLUMINANTS,
        SHIELD,
        DOOR,
        FILTER_WHEEL,
        CAMERA_FILTER_WHEEL,
        MONOCHROMATOR,
        CHANGER,
        SAMPLE_CHANGER,
        CAMERA,
        VIEWFINDER,
        SPECTROMETER,
        THERMOMETER,
    )
}

#: Keys of the roles that give light.
LIGHTS = frozenset(key for key, role in ROLES.items() if role.state is not None)

__all__ = [
    "CAMERA",
    "CAMERA_FILTER_WHEEL",
    "CHANGER",
    "DARK",
    "DOOR",
    "DOOR_CLOSE",
    "DOOR_OPEN",
    "FILTER_WHEEL",
    "ILLUMINANTS",
    "ILLUMINANTS_OFF",
    "LAMP",
    "LAMP_OFF",
    "LAMP_ON",
    "LEDS",
    "LEDS_OFF",
    "LIGHTS",
    "MONOCHROMATOR",
    "ROLES",
    "SAMPLE_CHANGER",
    "SHIELD",
    "SHIELD_COVER",
    "SHIELD_UNCOVER",
    "SPECTROMETER",
    "THERMOMETER",
    "VIEWFINDER",
    "BoardDevice",
    "BringSample",
    "Camera",
    "Changer",
    "Checkable",
    "Device",
    "DeviceAction",
    "ExerciseContext",
    "Exercised",
    "FrameReader",
    "Guarded",
    "Illuminant",
    "IlluminantSwitch",
    "KeptAwake",
    "Lamp",
    "LampSwitch",
    "LedLight",
    "LedSwitch",
    "Light",
    "LightBank",
    "LiveView",
    "Measured",
    "Monochromator",
    "MonochromatorBand",
    "Places",
    "PlannedDevice",
    "ReadSpectrum",
    "Role",
    "SampleChanger",
    "ServoSwing",
    "Spectrometer",
    "Suggestion",
    "Swing",
    "SwingTo",
    "TakeFrame",
    "Thermometer",
    "Tune",
    "TurnCameraWheel",
    "TurnWheel",
    "require_integration",
]
