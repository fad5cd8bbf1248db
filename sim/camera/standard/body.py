"""The camera body behind the standard's own operations: properties, shutter, card and events."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

from labrig.foundation.clock import Clock

from ..body_settings import BodySettings
from ..faults import CameraFaults
from ..objects import CARD_ID, SECOND_CARD_ID, ObjectStore
from ..operations import Event
from ..photograph import Photograph, Sensor
from ..shutter import FOCUS_S, METERING_S, READOUT_S, Exposure, Shutter, Stage
from ..vocabulary import ObjectFormat, Operation, ResponseCode, StandardEvent
from .properties import SHUTTER_TIMES, StandardProperties

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
    release
        Code of the operation that releases the shutter.
    """

    files: tuple[ObjectFormat, ...] = (ObjectFormat.DNG,)
    end_reported: Literal["after", "before", "never"] = "after"
    has_second_card: bool = False
    shutter_times: Mapping[int, float] = field(default_factory=lambda: SHUTTER_TIMES)
    release: int = Operation.INITIATE_CAPTURE


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

    @property
    def release_code(self) -> int:
        """Code of the operation that releases the shutter."""
        return self._habits.release

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
