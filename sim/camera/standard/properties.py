"""Device properties of a camera that implements the PTP standard only: values, choices, setting.

Meanings of values: ISO 15740, clause 13.5.
"""

import struct
from collections.abc import Sequence
from dataclasses import dataclass

from .. import codes
from ..body_settings import BodySettings
from ..vocabulary import ResponseCode, StandardProperty

#: Units of a reported shutter time per second: 0.1 ms.
UNITS_PER_S = 10_000
AUTO_ISO = 0xFFFF
#: Manual, program, aperture and shutter priority; the standard has no bulb.
_PROGRAMS = {"M": 1, "P": 2, "Av": 3, "Tv": 4, "B": 0}
_MANUAL_FOCUS, _AUTOFOCUS = 1, 2
_FLASH_OFF = 2
_SINGLE, _BURST = 1, 2
_RAW = 4

_TYPES = {"B": 0x0002, "H": 0x0004, "I": 0x0006}
_READ_ONLY, _READ_WRITE = 0, 1
_NO_FORM, _RANGE, _ENUMERATION = 0, 1, 2

#: A lens of f/1.8 to f/22 in thirds of a stop, as hundredths of what its ring says.
F_NUMBERS = (
    *(180, 200, 220, 250, 280, 320, 350, 400, 450, 500, 560, 630, 710, 800),
    *(900, 1000, 1100, 1300, 1400, 1600, 1800, 2000, 2200),
)
#: 32 s to 0.1 ms; this shutter keeps to what it tells.
SHUTTER_TIMES = {
    units: units / UNITS_PER_S
    for units in (
        round(codes.exposure_s(tv_code) * UNITS_PER_S)
        for tv_code in codes.TV_CODES
        if tv_code != codes.TV_BULB
    )
}


@dataclass
class _Property:
    """One property: its size as a letter of `struct`, its value, its choices."""

    letter: str
    value: int
    choices: Sequence[int] = ()

    def pack(self, *values: int) -> bytes:
        return struct.pack(f"<{len(values)}{self.letter}", *values)

    def describe(self, code: int) -> bytes:
        access = _READ_WRITE if self.choices else _READ_ONLY
        head = struct.pack("<HHB", code, _TYPES[self.letter], access)
        return head + self.pack(self.value, self.value) + self._form()

    def _form(self) -> bytes:
        if isinstance(self.choices, range):
            bounds = self.pack(self.choices[0], self.choices[-1], self.choices.step)
            return bytes((_RANGE,)) + bounds
        if not self.choices:
            return bytes((_NO_FORM,))
        count = struct.pack("<H", len(self.choices))
        return bytes((_ENUMERATION,)) + count + self.pack(*self.choices)


class StandardProperties:
    """Present values of the properties.

    Parameters
    ----------
    settings
        Manual settings of the body.
    shutter_times
        Actual time in seconds by reported time, in 0.1 ms.
    """

    def __init__(self, settings: BodySettings, shutter_times: dict[int, float]) -> None:
        self._shutter_times = shutter_times
        code = StandardProperty
        focus = _AUTOFOCUS if settings.autofocus else _MANUAL_FOCUS
        iso = AUTO_ISO if settings.iso == "auto" else settings.iso
        first_time = min(shutter_times, key=lambda units: abs(units - UNITS_PER_S / 60))
        self._properties: dict[int, _Property] = {
            code.BATTERY_LEVEL: _Property("B", 100),
            code.COMPRESSION_SETTING: _Property("B", _RAW),
            code.F_NUMBER: _Property("H", 560, F_NUMBERS),
            code.FOCUS_MODE: _Property("H", focus),
            code.FLASH_MODE: _Property("H", _FLASH_OFF),
            code.EXPOSURE_TIME: _Property("I", first_time, tuple(shutter_times)),
            code.EXPOSURE_PROGRAM_MODE: _Property("H", _PROGRAMS[settings.exposure_mode]),
            code.EXPOSURE_INDEX: _Property("H", iso, (*codes.ISO_LABELS, AUTO_ISO)),
            code.CAPTURE_DELAY: _Property("I", 0, range(0, 10_001, 1000)),
            code.STILL_CAPTURE_MODE: _Property("H", _SINGLE, (_SINGLE, _BURST)),
            code.BURST_NUMBER: _Property("H", 1, range(1, 10)),
        }

    @property
    def known(self) -> tuple[int, ...]:
        """Codes of the existing properties."""
        return tuple(self._properties)

    @property
    def exposure_s(self) -> float:
        """Actual shutter time in seconds."""
        return self._shutter_times[self._properties[StandardProperty.EXPOSURE_TIME].value]

    @property
    def iso(self) -> int:
        """Sensitivity; if it is automatic, the camera's choice."""
        iso = self._properties[StandardProperty.EXPOSURE_INDEX].value
        return codes.AUTO_AT_M if iso == AUTO_ISO else iso

    @property
    def f_number(self) -> float:
        """Actual relative aperture."""
        return codes.true_f_number(self._properties[StandardProperty.F_NUMBER].value / 100)

    @property
    def delay_s(self) -> float:
        """Delay of the self-timer in seconds."""
        return self._properties[StandardProperty.CAPTURE_DELAY].value / 1000

    def description(self, code: int) -> bytes | None:
        """Return the DevicePropDesc dataset of a property."""
        prop = self._properties.get(code)
        return None if prop is None else prop.describe(code)

    def value(self, code: int) -> bytes | None:
        """Return the bytes of a property's value."""
        prop = self._properties.get(code)
        return None if prop is None else prop.pack(prop.value)

    def set(self, code: int, data: bytes) -> ResponseCode:
        """Change a property on behalf of the host."""
        prop = self._properties.get(code)
        if prop is None:
            return ResponseCode.DEVICE_PROP_NOT_SUPPORTED
        if not prop.choices:
            return ResponseCode.ACCESS_DENIED
        if len(data) != struct.calcsize(prop.letter):
            return ResponseCode.INVALID_DEVICE_PROP_FORMAT
        value = int.from_bytes(data, "little")
        if value not in prop.choices:
            return ResponseCode.INVALID_DEVICE_PROP_VALUE
        prop.value = value
        return ResponseCode.OK
