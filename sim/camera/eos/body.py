"""The camera body behind the EOS operations: properties, button, events and files together."""

import math
import struct
from dataclasses import dataclass, replace
from functools import partial

from labrig.foundation.clock import Clock

from .. import codes
from ..body_settings import BodySettings
from ..faults import CameraFaults
from ..objects import CARD_ID, SHOT_BYTES, ObjectStore
from ..photograph import Photograph, Sensor
from ..shutter import FOCUS_S, METERING_S, READOUT_S, Exposure, Shutter, Stage
from ..vocabulary import EosEvent, EosProperty, ResponseCode
from .events import EventQueue, object_added, record, transfer_request
from .properties import SELF_TIMER_S, Destination, Drive, PropertyBank
from .viewfinder import Viewfinder

#: Time from a new value of a property to its event.
PROPERTY_DELAY_S = 0.03
#: More free photographs than the camera can show.
_MAX_SHOTS = 9999
_IN_MEMORY = 0
_FOCUS_OFF = 1


@dataclass(frozen=True)
class _Settings:
    """Settings of an exposure when the button went down."""

    exposure_s: float
    iso: int
    f_number: float
    destination: Destination


class EosBody:
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
    """

    def __init__(
        self,
        clock: Clock,
        sensor: Sensor,
        shutter: Shutter,
        faults: CameraFaults,
        settings: BodySettings,
    ) -> None:
        self._clock = clock
        self._sensor = sensor
        self._shutter = shutter
        self._faults = faults
        self._busy_releases = faults.busy_releases
        self._event_to_lose = faults.lost_event
        self._focus_s = FOCUS_S if settings.autofocus else METERING_S
        self._host_shots = 0
        self._is_remote = False
        self.objects = ObjectStore(clock, folder="100CANON", prefix="IMG")
        self.events = EventQueue(clock)
        self.viewfinder = Viewfinder(clock, sensor)
        self._properties = PropertyBank(self.objects.free_shots, settings)
        self._pressed_with = self._settings()

    @property
    def is_exposing(self) -> bool:
        """Whether the shutter is open."""
        return self._shutter.is_open

    @property
    def bulb_is_open(self) -> bool:
        """Whether the present exposure waits for the command to end it."""
        return self._shutter.is_endless

    def forget_host(self) -> None:
        """End the session: the button comes up, events and files for the host are lost."""
        self._end_bulb()
        self._shutter.let_go(Stage.HALF | Stage.FULL)
        self.events.silence()
        self.objects.forget_memory()
        self._properties.put(EosProperty.EVF_OUTPUT, 0)
        self.viewfinder.send_to(0)
        self._is_remote = False
        self._host_shots = 0
        self._count_shots(0.0)

    def set_remote_mode(self, mode: int) -> ResponseCode:
        """Do SetRemoteMode."""
        self._is_remote = mode != 0
        return ResponseCode.OK

    def set_event_mode(self, mode: int) -> ResponseCode:
        """Do SetEventMode; a host that starts to listen gets every property once."""
        if mode == 0:
            self.events.silence()
        else:
            self.events.listen()
            self.events.post(self._clock.now(), self._properties.all_records)
        return ResponseCode.OK

    def set_property(self, data: bytes) -> ResponseCode:
        """Do SetDevicePropValueEx: length, property, value."""
        if len(data) < 12 or int.from_bytes(data[:4], "little") != len(data):
            return ResponseCode.INVALID_DEVICE_PROP_FORMAT
        if not self._is_remote:
            return ResponseCode.GENERAL_ERROR
        code = int.from_bytes(data[4:8], "little")
        answer = self._properties.set(code, data[8:])
        if answer is ResponseCode.OK:
            self._report(code, PROPERTY_DELAY_S)
            if code == EosProperty.CAPTURE_DESTINATION:
                self._count_shots(PROPERTY_DELAY_S)
            elif code == EosProperty.EVF_OUTPUT:
                self.viewfinder.send_to(self._properties.number(EosProperty.EVF_OUTPUT))
        return answer

    def request_property(self, code: int) -> ResponseCode:
        """Do RequestDevicePropValue: the value comes as an event."""
        if code not in self._properties:
            return ResponseCode.DEVICE_PROP_NOT_SUPPORTED
        self._report(code, 0.0)
        return ResponseCode.OK

    def announce_host_capacity(self, clusters: int, bytes_each: int, _reset: int) -> ResponseCode:
        """Do PCHDDCapacity: room on the host's disk, without which it gets no photograph."""
        self._host_shots = min(clusters * bytes_each // SHOT_BYTES, _MAX_SHOTS)
        self._count_shots(0.0)
        return ResponseCode.OK

    def release_on(self, stages: int, focus: int = 0) -> ResponseCode:
        """Do RemoteReleaseOn: 1 half, 2 full, 3 both; a `focus` of 1 leaves the lens alone."""
        if stages not in (1, 2, 3):
            return ResponseCode.INVALID_PARAMETER
        settling_s = METERING_S if focus == _FOCUS_OFF else self._focus_s
        if stages == Stage.HALF:
            if not self._is_remote:
                return ResponseCode.GENERAL_ERROR
            self._shutter.press_half(settling_s)
            return ResponseCode.OK
        return self._full_press(settling_s)

    def release_off(self, stages: int) -> ResponseCode:
        """Do RemoteReleaseOff: release the same stages."""
        if stages not in (1, 2, 3):
            return ResponseCode.INVALID_PARAMETER
        self._shutter.let_go(Stage(stages))
        if Stage.FULL in Stage(stages):
            self._end_bulb()
        return ResponseCode.OK

    def release_once(self) -> ResponseCode:
        """Do RemoteRelease, the older way: focus, expose, release."""
        answer = self._full_press(self._focus_s)
        if answer is ResponseCode.OK:
            self._shutter.let_go(Stage.HALF | Stage.FULL)
        return answer

    def bulb_start(self) -> ResponseCode:
        """Do BulbStart: only if the shutter is set to bulb."""
        if math.isfinite(self._settings().exposure_s):
            return ResponseCode.GENERAL_ERROR
        answer = self._full_press(METERING_S)
        if answer is ResponseCode.OK:
            self._shutter.let_go(Stage.FULL)
        return answer

    def bulb_end(self) -> ResponseCode:
        """Do BulbEnd."""
        return ResponseCode.OK if self._end_bulb() else ResponseCode.GENERAL_ERROR

    def _settings(self) -> _Settings:
        number = self._properties.number
        return _Settings(
            exposure_s=codes.exposure_s(number(EosProperty.TV)),
            iso=codes.iso(number(EosProperty.ISO)),
            f_number=codes.f_number(number(EosProperty.AV)),
            destination=Destination(number(EosProperty.CAPTURE_DESTINATION)),
        )

    def _full_press(self, settling_s: float) -> ResponseCode:
        if not self._is_remote:
            return ResponseCode.GENERAL_ERROR
        if self._busy_releases:
            self._busy_releases -= 1
            return ResponseCode.DEVICE_BUSY
        now_s = self._clock.now()
        if not self._shutter.is_ready or self._faults.is_busy(now_s):
            return ResponseCode.DEVICE_BUSY
        no_room = self._properties.number(EosProperty.AVAILABLE_SHOTS) == 0
        if no_room or self._faults.is_full(now_s):
            return ResponseCode.STORE_FULL
        settings = self._settings()
        timer_s = SELF_TIMER_S[Drive(self._properties.number(EosProperty.DRIVE_MODE))]
        exposure = self._shutter.press_full(settling_s, timer_s, settings.exposure_s)
        self._report_status(exposure.start_s, 1)
        self._pressed_with = settings
        if not exposure.is_endless:
            self._file(exposure, settings)
        return ResponseCode.OK

    def _end_bulb(self) -> Exposure | None:
        exposure = self._shutter.end_bulb()
        if exposure:
            taken_s = exposure.end_s - exposure.start_s
            self._file(exposure, replace(self._pressed_with, exposure_s=taken_s))
        return exposure

    def _file(self, exposure: Exposure, settings: _Settings) -> None:
        """Keep the photograph, and report it when it is there."""
        photograph = Photograph(
            self._sensor, exposure.start_s, settings.exposure_s, settings.iso, settings.f_number
        )
        ready_s = exposure.end_s + READOUT_S
        self.objects.begin_photograph()
        if settings.destination is Destination.HOST:
            stored = self.objects.add(_IN_MEMORY, ready_s, photograph)
            if self._event_to_lose:
                self._event_to_lose = False
            else:
                self.events.post(ready_s, partial(transfer_request, stored))
        else:
            stored = self.objects.add(CARD_ID, ready_s, photograph)
            self.events.post(ready_s, partial(object_added, stored, self.objects))
            self._count_shots(ready_s - self._clock.now())
        self._report_status(ready_s, 0)

    def _count_shots(self, delay_s: float) -> None:
        destination = self._properties.number(EosProperty.CAPTURE_DESTINATION)
        on_host = destination == Destination.HOST
        shots = self._host_shots if on_host else self.objects.free_shots
        self._properties.put(EosProperty.AVAILABLE_SHOTS, shots)
        self._report(EosProperty.AVAILABLE_SHOTS, delay_s)

    def _report(self, code: int, delay_s: float) -> None:
        due_s = self._clock.now() + delay_s
        self.events.post(due_s, partial(self._properties.value_record, code))

    def _report_status(self, at_s: float, status: int) -> None:
        payload = struct.pack("<I", status)
        encode = partial(record, EosEvent.CAMERA_STATUS_CHANGED, payload)
        self.events.post(at_s, encode)
