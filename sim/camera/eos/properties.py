"""The EOS properties, custom functions among them: values, choices, records that report them."""

import struct
from enum import IntEnum

from .. import codes
from ..body_settings import BodySettings
from ..vocabulary import EosEvent, EosProperty, ResponseCode
from .events import record
from .viewfinder import TO_PC

#: Ids of custom functions.
_LONG_EXPOSURE_NOISE, _HIGHLIGHT_PRIORITY, _MIRROR_LOCK_UP = 0x201, 0x203, 0x60F

#: All functions of a 5D Mark II, group by group, in its order; the last has five values.
_GROUPS = {
    1: (0x101, 0x102, 0x103, 0x104, 0x105, 0x108, 0x10F),
    2: (_LONG_EXPOSURE_NOISE, 0x202, _HIGHLIGHT_PRIORITY, 0x204, 0x205),
    3: (0x505, 0x506, 0x50F, 0x510, 0x50E, _MIRROR_LOCK_UP, 0x508, 0x507),
    4: (0x701, 0x702, 0x704, 0x706, 0x80B, 0x80F, 0x70B),
}
_SEVERAL_VALUES = {0x507: (0, 0xFF, 0, 0xFF, 0)}


def custom_function_blocks(settings: BodySettings) -> tuple[bytes, ...]:
    """Return the values of the property: a 5D Mark II reports every group by itself."""
    switched_on = {
        _LONG_EXPOSURE_NOISE: settings.long_exposure_noise_reduction,
        _HIGHLIGHT_PRIORITY: settings.highlight_tone_priority,
        _MIRROR_LOCK_UP: settings.mirror_lock_up,
    }
    return tuple(
        _block(
            group,
            {
                function: _SEVERAL_VALUES.get(function, (int(switched_on.get(function, False)),))
                for function in functions
            },
        )
        for group, functions in _GROUPS.items()
    )


def _block(group: int, functions: dict[int, tuple[int, ...]]) -> bytes:
    numbers = [
        number
        for function, values in functions.items()
        for number in (function, len(values), *values)
    ]
    group_bytes = 4 * (2 + len(numbers))
    return struct.pack(
        f"<{5 + len(numbers)}I", 12 + group_bytes, 1, group, group_bytes, len(functions), *numbers
    )


_ONE_SHOT_FOCUS, _MANUAL_FOCUS = 0, 3
#: Codes of exposure modes are their places here.
_DIAL = ("P", "Tv", "Av", "M", "B")
#: Type of an availability list; the only one that is an enumeration.
_ENUMERATION = 3

#: One image, RAW, large, RAW compression: the only thing that this camera writes.
_RAW = struct.pack("<IIIII", 1, 0x10, 6, 0, 4)


class Destination(IntEnum):
    """Destinations of photographs."""

    CARD = 2
    HOST = 4


class Drive(IntEnum):
    """Drive modes."""

    SINGLE = 0x00
    SELF_TIMER_10_S = 0x10
    SELF_TIMER_2_S = 0x11


#: Delay of a drive mode after the button.
SELF_TIMER_S = {Drive.SINGLE: 0.0, Drive.SELF_TIMER_10_S: 10.0, Drive.SELF_TIMER_2_S: 2.0}


def _u32(*values: int) -> tuple[bytes, ...]:
    return tuple(struct.pack("<I", value) for value in values)


#: Properties that the host may set, and their choices. Mirror lock-up can only be off.
_CHOICES: dict[EosProperty, tuple[bytes, ...]] = {
    EosProperty.AV: _u32(*codes.AV_CODES),
    EosProperty.TV: _u32(*codes.TV_CODES),
    EosProperty.ISO: _u32(codes.ISO_AUTO, *codes.ISO_CODES),
    EosProperty.DRIVE_MODE: _u32(*Drive),
    EosProperty.CAPTURE_DESTINATION: _u32(*Destination),
    EosProperty.IMAGE_FORMAT: (_RAW,),
    EosProperty.MIRROR_UP: _u32(0),
    EosProperty.EVF_OUTPUT: _u32(0, TO_PC),
}


class PropertyBank:
    """Present values of the EOS properties.

    Dial, lens switch and menus cannot be set over the wire.

    Parameters
    ----------
    available_shots
        Number of available shots at the present destination.
    settings
        Manual settings of the body.
    """

    def __init__(self, available_shots: int, settings: BodySettings) -> None:
        focus = _ONE_SHOT_FOCUS if settings.autofocus else _MANUAL_FOCUS
        self._custom_functions = custom_function_blocks(settings)
        self._values: dict[int, bytes] = {
            EosProperty.AV: struct.pack("<I", 0x30),
            EosProperty.TV: struct.pack(
                "<I", codes.TV_BULB if settings.exposure_mode == "B" else 0x68
            ),
            EosProperty.ISO: struct.pack("<I", codes.iso_code(settings.iso)),
            EosProperty.AE_MODE: struct.pack("<I", _DIAL.index(settings.exposure_mode)),
            EosProperty.DRIVE_MODE: struct.pack("<I", Drive.SINGLE),
            EosProperty.FOCUS_MODE: struct.pack("<I", focus),
            EosProperty.AUTO_POWER_OFF: struct.pack("<I", round(settings.auto_power_off)),
            EosProperty.IMAGE_FORMAT: _RAW,
            EosProperty.CAPTURE_DESTINATION: struct.pack("<I", Destination.CARD),
            EosProperty.AVAILABLE_SHOTS: struct.pack("<I", available_shots),
            EosProperty.MIRROR_UP: struct.pack("<I", 0),
            EosProperty.EVF_OUTPUT: struct.pack("<I", 0),
        }

    def __contains__(self, code: int) -> bool:
        return code in self._values

    def number(self, code: EosProperty) -> int:
        """Return a property that is one number."""
        return int.from_bytes(self._values[code], "little")

    def put(self, code: EosProperty, value: int) -> None:
        """Change a number on behalf of the camera itself."""
        self._values[code] = struct.pack("<I", value)

    def set(self, code: int, value: bytes) -> ResponseCode:
        """Change a property on behalf of the host."""
        if code not in self._values:
            return ResponseCode.DEVICE_PROP_NOT_SUPPORTED
        if code not in _CHOICES:
            return ResponseCode.ACCESS_DENIED
        if value not in _CHOICES[EosProperty(code)]:
            return ResponseCode.INVALID_DEVICE_PROP_VALUE
        self._values[code] = value
        return ResponseCode.OK

    def value_record(self, code: int) -> bytes:
        """Return PropValueChanged with the present value."""
        return _value_record(code, self._values[code])

    def all_records(self) -> bytes:
        """Return the records of all values, then of all lists, for a host that begins to listen."""
        values = [self.value_record(code) for code in self._values]
        values += [
            _value_record(EosProperty.CUSTOM_FUNCTIONS, block) for block in self._custom_functions
        ]
        lists = [
            record(
                EosEvent.AVAIL_LIST_CHANGED,
                struct.pack("<III", code, _ENUMERATION, len(choices)) + b"".join(choices),
            )
            for code, choices in _CHOICES.items()
        ]
        return b"".join(values + lists)


def _value_record(code: int, value: bytes) -> bytes:
    return record(EosEvent.PROP_VALUE_CHANGED, struct.pack("<I", code) + value)
