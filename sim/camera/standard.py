"""The simulated camera as one that implements the PTP standard only: body and operations.

Meanings of values: ISO 15740, clause 13.5.
"""

import math
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

from labrig.foundation.clock import Clock

from . import codes, datasets
from .body_settings import BodySettings, CameraFaults
from .object_operations import ObjectOperations
from .objects import CARD_ID, SECOND_CARD_ID, ObjectStore
from .photograph import Photograph, Sensor
from .responder import SESSION_OPERATIONS, Event, Handler, Response, only_code
from .shutter import FOCUS_S, METERING_S, READOUT_S, Exposure, Shutter, Stage
from .vocabulary import ObjectFormat, Operation, ResponseCode, StandardEvent, StandardProperty

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


#: Time between two files of a photograph, and before the report of its end.
NEXT_FILE_S = 0.05
_ANY = 0


@dataclass(frozen=True)
class StandardHabits:
    """Peculiarities of makers, within the standard or not quite.

    Attributes
    ----------
    files
        Files that are written of each photograph, in this order.
    end_reported
        Time of CaptureComplete: after the files, before them, or never.
    has_second_card
        Whether everything is written once more, on a second card.
    shutter_times
        Actual time in seconds by reported time, in 0.1 ms.
    """

    files: tuple[ObjectFormat, ...] = (ObjectFormat.DNG,)
    end_reported: Literal["after", "before", "never"] = "after"
    has_second_card: bool = False
    shutter_times: Mapping[int, float] = field(default_factory=lambda: SHUTTER_TIMES)


class _Developed(Photograph):
    """Developed picture of a photograph, useless for measurements."""

    @cached_property
    def raw(self) -> bytes:
        return b"\xff\xd8" + f"taken at {self.start_s:.6f} s".encode() + b"\xff\xd9"


class StandardBody:
    """State of the camera that outlives a session.

    Parameters
    ----------
    clock
        The room's clock; later events are computed when they are asked for.
    sensor
        Sensor that makes the photographs.
    shutter
        Button and shutter.
    faults
        Faults of the camera, of which `busy_releases`, the spans and `lost_event` are the body's.
    settings
        Manual settings of the body.
    habits
        Peculiarities of the maker.
    """

    def __init__(
        self,
        clock: Clock,
        sensor: Sensor,
        shutter: Shutter,
        faults: CameraFaults,
        settings: BodySettings,
        habits: StandardHabits,
    ) -> None:
        self._clock = clock
        self._sensor = sensor
        self._shutter = shutter
        self._faults = faults
        self._busy_releases = faults.busy_releases
        self._event_to_lose = faults.lost_event
        self._focus_s = FOCUS_S if settings.autofocus else METERING_S
        self._habits = habits
        self._events: list[tuple[float, Event]] = []
        self.properties = StandardProperties(settings, dict(habits.shutter_times))
        cards = (CARD_ID, SECOND_CARD_ID) if habits.has_second_card else (CARD_ID,)
        self.objects = ObjectStore(clock, folder="100LABRG", prefix="DSC", cards=cards)

    @property
    def is_exposing(self) -> bool:
        """Whether the shutter is open."""
        return self._shutter.is_open

    @property
    def formats(self) -> tuple[ObjectFormat, ...]:
        """Formats of the files that are written of a photograph."""
        return self._habits.files

    def forget_host(self) -> None:
        """End the session: later events are lost."""
        self._events.clear()

    def initiate_capture(self, storage_id: int = _ANY, object_format: int = _ANY) -> ResponseCode:
        """Do InitiateCapture."""
        if storage_id not in (_ANY, *self.objects.cards):
            return ResponseCode.STORE_NOT_AVAILABLE
        if object_format not in (_ANY, *self._habits.files):
            return ResponseCode.INVALID_OBJECT_FORMAT_CODE
        now_s = self._clock.now()
        if self._busy_releases:
            self._busy_releases -= 1
            return ResponseCode.DEVICE_BUSY
        if not self._shutter.is_ready or self._faults.is_busy(now_s):
            return ResponseCode.DEVICE_BUSY
        if not self.objects.free_shots or self._faults.is_full(now_s):
            return ResponseCode.STORE_FULL
        timer_s, exposure_s = self.properties.delay_s, self.properties.exposure_s
        exposure = self._shutter.press_full(self._focus_s, timer_s, exposure_s)
        self._shutter.let_go(Stage.HALF | Stage.FULL)
        self._file(exposure, exposure_s)
        return ResponseCode.OK

    def event_due_s(self) -> float:
        """Return the time of the next event."""
        return self._events[0][0] if self._events else math.inf

    def take_event(self) -> Event:
        """Return the next event."""
        return self._events.pop(0)[1]

    def _file(self, exposure: Exposure, exposure_s: float) -> None:
        """Keep the photograph, and report it when it is there."""
        properties = self.properties
        exposed = (self._sensor, exposure.start_s, exposure_s, properties.iso, properties.f_number)
        files: dict[ObjectFormat, Photograph] = {
            ObjectFormat.DNG: Photograph(*exposed),
            ObjectFormat.JPEG: _Developed(*exposed),
        }
        ready_s = exposure.end_s + READOUT_S
        if self._habits.end_reported == "before":
            self._post(exposure.end_s, Event(StandardEvent.CAPTURE_COMPLETE))
        self.objects.begin_photograph()
        for card in self.objects.cards:
            for object_format in self._habits.files:
                photograph = files[object_format]
                stored = self.objects.add(card, ready_s, photograph, object_format)
                if self._event_to_lose:
                    self._event_to_lose = False
                else:
                    self._post(ready_s, Event(StandardEvent.OBJECT_ADDED, (stored.handle,)))
                ready_s += NEXT_FILE_S
        if self._habits.end_reported == "after":
            self._post(ready_s, Event(StandardEvent.CAPTURE_COMPLETE))

    def _post(self, due_s: float, event: Event) -> None:
        self._events.append((due_s, event))
        self._events.sort(key=lambda entry: entry[0])


_MODEL = "simulated PTP camera"
_NO_EXTENSION = 0


class StandardOperations:
    """The operations inside a session, for one camera body.

    Parameters
    ----------
    body
        Body on which the operations act.
    serial
        Serial number of the camera.
    """

    def __init__(self, body: StandardBody, serial: str) -> None:
        self._body = body
        self._serial = serial
        self.model = _MODEL
        self.table: dict[int, Handler] = {
            **ObjectOperations(body.objects).table,
            Operation.INITIATE_CAPTURE: Handler(only_code(body.initiate_capture), 0, 2),
            Operation.GET_DEVICE_PROP_DESC: Handler(self._prop_desc, 1, 1),
            Operation.GET_DEVICE_PROP_VALUE: Handler(self._prop_value, 1, 1),
            Operation.SET_DEVICE_PROP_VALUE: Handler(
                only_code(body.properties.set), 1, 1, takes_data=True
            ),
        }

    @property
    def is_exposing(self) -> bool:
        """Whether the shutter is open."""
        return self._body.is_exposing

    def device_info(self) -> Response:
        """Return DeviceInfo."""
        info = datasets.DeviceInfo(
            manufacturer="labrig",
            model=_MODEL,
            device_version="1.0",
            serial=self._serial,
            operations=tuple(sorted({*SESSION_OPERATIONS, *self.table})),
            events=tuple(StandardEvent),
            properties=self._body.properties.known,
            capture_formats=self._body.formats,
            image_formats=tuple(ObjectFormat),
            vendor_extension=_NO_EXTENSION,
        )
        return Response(ResponseCode.OK, data=info.encode())

    def is_too_busy_for(self, opcode: int) -> bool:
        """Return whether this operation has to wait for the end of an exposure."""
        return self._body.is_exposing and opcode != Operation.GET_DEVICE_INFO

    def forget_host(self) -> None:
        """End the session."""
        self._body.forget_host()

    def event_due_s(self) -> float:
        """Return the time of the next event."""
        return self._body.event_due_s()

    def take_event(self) -> Event:
        """Return the event that is due; each is reported once."""
        return self._body.take_event()

    def _prop_desc(self, code: int) -> Response:
        return _data_response(self._body.properties.description(code))

    def _prop_value(self, code: int) -> Response:
        return _data_response(self._body.properties.value(code))


def _data_response(data: bytes | None) -> Response:
    if data is None:
        return Response(ResponseCode.DEVICE_PROP_NOT_SUPPORTED)
    return Response(ResponseCode.OK, data=data)
