"""Roles: what a protocol may ask of a device; a driver fills one of them.

All that labrig knows of a role stands in its module: what its devices can do, what protocols tell
them, the stand-in of a plan, the exercise of a rig check, whether it gives light. To add one,
write its module and list it in `ROLES`, and what protocols and drivers need of it in `__all__`.
"""

from typing import Any

from labrig.acquire.roles.camera import CAMERA, Camera, Shoot
from labrig.acquire.roles.changer import CHANGER, Changer
from labrig.acquire.roles.lamp import LAMP, LAMP_OFF, LAMP_ON, Lamp, Switch
from labrig.acquire.roles.leds import LEDS, LEDS_OFF, LedBank, LedSwitch
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
from labrig.acquire.roles.spectrometer import SPECTROMETER, Spectrometer
from labrig.acquire.roles.swings import (
    DOOR,
    DOOR_CLOSE,
    DOOR_OPEN,
    SHIELD,
    SHIELD_COVER,
    SHIELD_UNCOVER,
    Door,
    LampShield,
    Shield,
    TrapDoor,
)
from labrig.acquire.roles.thermometer import THERMOMETER, Thermometer
from labrig.acquire.roles.viewfinder import VIEWFINDER, LiveView

#: Every role by its key in the rig file. The order is that in which devices are made safe, as far
#: as it matters: lights go out before anything moves.
ROLES: dict[str, Role[Any]] = {
    role.key: role
    for role in (
        LAMP,
        LEDS,
        SHIELD,
        DOOR,
        CHANGER,
        CAMERA,
        VIEWFINDER,
        SPECTROMETER,
        THERMOMETER,
    )
}

#: Those that give light: somebody has to know if one of them may be on.
LIGHTS = frozenset(key for key, role in ROLES.items() if role.state is not None)

__all__ = [
    "CAMERA",
    "CHANGER",
    "DARK",
    "DOOR",
    "DOOR_CLOSE",
    "DOOR_OPEN",
    "LAMP",
    "LAMP_OFF",
    "LAMP_ON",
    "LEDS",
    "LEDS_OFF",
    "LIGHTS",
    "ROLES",
    "SHIELD",
    "SHIELD_COVER",
    "SHIELD_UNCOVER",
    "SPECTROMETER",
    "THERMOMETER",
    "VIEWFINDER",
    "Camera",
    "Changer",
    "Checkable",
    "Device",
    "DeviceAction",
    "Door",
    "ExerciseContext",
    "Exercised",
    "FrameReader",
    "Guarded",
    "KeptAwake",
    "Lamp",
    "LampShield",
    "LedBank",
    "LedSwitch",
    "Light",
    "LiveView",
    "Measured",
    "PlannedDevice",
    "Role",
    "Shield",
    "Shoot",
    "Spectrometer",
    "Suggestion",
    "Switch",
    "Thermometer",
    "TrapDoor",
]
