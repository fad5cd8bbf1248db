"""Canon's vendor operations and properties for remote control of an EOS, as far as used here.

Source: the EOS part of libgphoto2's ptp.h and its DeviceInfo dumps of real cameras; vendor
extension 0xB. None of it is documented by Canon: everything is read back.
"""

import struct
from collections.abc import Collection
from enum import IntEnum

from .codes import BULB_TV, F_NUMBERS, ISOS, shutter_time_s


class Eos(IntEnum):
    """Codes of Canon's operations."""

    GetObject = 0x9104
    GetPartialObject = 0x9107
    RemoteRelease = 0x910F
    SetDevicePropValueEx = 0x9110
    SetRemoteMode = 0x9114
    SetEventMode = 0x9115
    GetEvent = 0x9116
    TransferComplete = 0x9117
    PCHDDCapacity = 0x911A
    KeepDeviceOn = 0x911D
    BulbStart = 0x9125
    BulbEnd = 0x9126
    RequestDevicePropValue = 0x9127
    RemoteReleaseOn = 0x9128
    RemoteReleaseOff = 0x9129
    GetViewFinderData = 0x9153


class Property(IntEnum):
    """Codes of Canon's properties, with the words that messages use."""

    aperture = 0xD101
    shutter_time = 0xD102
    iso = 0xD103
    exposure_mode = 0xD105
    drive_mode = 0xD106
    focus_mode = 0xD108
    auto_power_off = 0xD114
    shots_left = 0xD11B
    destination = 0xD11C
    image_format = 0xD120
    custom_functions = 0xD1A0
    viewfinder_output = 0xD1B0
    viewfinder_mode = 0xD1B1


_NEEDED = (
    Eos.SetDevicePropValueEx,
    Eos.SetRemoteMode,
    Eos.SetEventMode,
    Eos.GetEvent,
    Eos.TransferComplete,
)

#: Exposure modes, as the dial stands: M, and the B that larger bodies have.
MANUAL_EXPOSURE, BULB_EXPOSURE = 3, 4
SINGLE_SHOT = 0
TO_HOST = 4
VIEWFINDER_OFF = 0
VIEWFINDER_TO_PC = 2
#: One file of 16 bytes' description: kind 6 (RAW), size 0 (large), compression 4 (RAW).
RAW_ONLY = struct.pack("<5I", 1, 0x10, 6, 0, 4)

#: Free clusters, their bytes, and "reset": the room that the camera may believe in on the PC.
HOST_ROOM = (0x0FFFFFFF, 0x1000, 1)
#: The camera counts its belief down; tell it again when it reports fewer shots than this.
FEW_SHOTS = 100


def lacking_operations(operations: Collection[int]) -> list[str]:
    """Return the operations that a camera lacks for being released by labrig."""
    lacking = [f"0x{op:X}" for op in _NEEDED if op not in operations]
    two_stages = Eos.RemoteReleaseOn in operations and Eos.RemoteReleaseOff in operations
    if not two_stages and Eos.RemoteRelease not in operations:
        lacking.append("0x9128 with 0x9129, or 0x910F")
    return lacking


def number(value: int) -> bytes:
    """Return the bytes of a property's value."""
    return struct.pack("<I", value)


def property_dataset(prop: int, value: bytes) -> bytes:
    """Return the data phase of SetDevicePropValueEx: u32 size of all, u32 property, value."""
    return struct.pack("<II", 8 + len(value), prop) + value


def value_text(prop: int, value: bytes) -> str:
    """Return a property's value as a person can look it up: `0x68 (1/64 s)`."""
    if not 0 < len(value) <= 4:
        return value.hex(" ") or "nothing"
    code = int.from_bytes(value, "little")
    meaning = ""
    if prop == Property.shutter_time and (exposure_s := shutter_time_s(code)) is not None:
        meaning = f" ({exposure_s:g} s)" if exposure_s >= 0.3 else f" (1/{1 / exposure_s:.0f} s)"
    elif prop == Property.shutter_time and code == BULB_TV:
        meaning = " (bulb)"
    elif prop == Property.aperture and code in F_NUMBERS:
        meaning = f" (f/{F_NUMBERS[code]:g})"
    elif prop == Property.iso and code in ISOS:
        meaning = f" (ISO {ISOS[code]})"
    return f"0x{code:X}{meaning}"
