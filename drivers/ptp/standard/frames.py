"""The frames of a camera without a maker's extension: from its events, off its card."""

from dataclasses import dataclass

from labrig.foundation.clock import Clock
from labrig.foundation.errors import DeviceError

from ..codes import INVALID_OBJECT_HANDLE, Standard, StandardEvent
from ..device_info import DeviceInfo
from ..failures import RefusedError
from ..object_transfer import LONG_TIMEOUTS, ObjectTransfer
from ..session import Session
from .object_info import FOLDER, ObjectInfo, parse_object_info

#: Interval between two checks for Ctrl-C.
LISTEN_S = 0.1
#: Time of silence after which a camera has nothing left to report.
SILENCE_S = 0.1
#: Time from one file of a capture to its next, and to CaptureComplete.
NEXT_FILE_S = 3.0
#: Number of events, more than one capture reports.
MAX_EVENTS = 64


@dataclass(frozen=True)
class _Stored:
    """A file in the camera."""

    handle: int
    info: ObjectInfo


class StandardFrames:
    """Bookkeeping of the frame that is due, so that none is ever taken for another.

    A camera reports ObjectAdded for every file of a capture (RAW, JPEG, a copy on a second card, a
    new folder) and CaptureComplete before, between or after them, or never. Files that were taken
    by hand are left alone.

    Parameters
    ----------
    session
        Session that reports and transfers the files.
    clock
        Clock of the waiting for frames.
    info
        Abilities that the camera reports.
    timeout_s
        Seconds from the end of an exposure until its frame must have been reported.
    """

    def __init__(self, session: Session, clock: Clock, info: DeviceInfo, timeout_s: float) -> None:
        self._session = session
        self._clock = clock
        self._timeout_s = timeout_s
        part = Standard.GetPartialObject
        partial_operation = part if part in info.operations else None
        self._objects = ObjectTransfer(session, clock, Standard.GetObject, partial_operation)
        self._can_delete = Standard.DeleteObject in info.operations
        self._tells_end = StandardEvent.CaptureComplete in info.events
        self._due_after_s: float | None = None
        self._is_ended = True
        self._is_full = False
        self._added: list[_Stored] = []
        self._delivered: _Stored | None = None
        self._last: ObjectInfo | None = None

    def expect(self, exposure_end_s: float) -> None:
        """Note that an exposure has begun, or may have, and ends at this clock time at latest."""
        self._due_after_s = exposure_end_s
        self._is_ended = self._is_full = False

    def expect_none(self) -> None:
        """Note that no exposure is under way."""
        self._due_after_s = None
        self._is_ended = True

    def fetch(self) -> tuple[bytes, str]:
        """Return the bytes of the frame that is due and its suffix, such as `.nef`.

        Raises
        ------
        DeviceError
            No frame came, none that is a RAW file, or not as many bytes as announced.
        """
        frame = self._wait()
        if frame is None:
            self._due_after_s = None
            raise self._no_frame()
        data = self._objects.fetch(frame.handle, frame.info.name, frame.info.size_bytes)
        self._due_after_s = None
        self._added.remove(frame)
        self._delivered, self._last = frame, frame.info
        return data, frame.info.suffix

    def discard_abandoned(self) -> None:
        """Wait for an abandoned frame that is due, and delete all frames from the card.

        The last one delivered is among them: a caller that goes on has it on disk by now.

        Raises
        ------
        DeviceError
            The camera does not answer.
        """
        if self._due_after_s is not None:
            self._clock.sleep_until(self._due_after_s)
            self._wait()
        if not self._is_ended and self._tells_end:
            self._listen_for_end()
        if self._delivered is not None:
            self._added.append(self._delivered)
            self._delivered = None
        self.discard_reported()
        self._due_after_s = None

    def discard_reported(self) -> None:
        """Delete the abandoned files that were reported until now from the card.

        Raises
        ------
        DeviceError
            The camera does not answer.
        """
        for _ in range(MAX_EVENTS):
            if self._listen(SILENCE_S) is None:
                break
        while self._added:
            self._delete(self._added.pop())

    def _wait(self) -> _Stored | None:
        """Return the frame that is due; None if there is none, only others, or no room for one."""
        latest_s = (self._due_after_s or self._clock.now()) + self._timeout_s
        deadline_s = latest_s
        while not self._is_full and (remaining_s := deadline_s - self._clock.now()) > 0:
            heard = self._listen(min(LISTEN_S, remaining_s))
            for stored in self._added:
                if stored.info.is_raw and not self._is_copy(stored.info):
                    return stored
            if self._added and heard == StandardEvent.CaptureComplete:
                return None
            if self._added and heard is not None:
                deadline_s = min(latest_s, self._clock.now() + NEXT_FILE_S)
        return None

    def _listen_for_end(self) -> None:
        deadline_s = self._clock.now() + NEXT_FILE_S
        while not self._is_ended and (remaining_s := deadline_s - self._clock.now()) > 0:
            self._listen(min(LISTEN_S, remaining_s))
        self._tells_end = self._is_ended

    def _listen(self, timeout_s: float) -> int | None:
        """Take in one event; return its code, None if there was none."""
        event = self._session.event(timeout_s)
        self._clock.sleep(0.0)
        if event is None:
            return None
        match event.code:
            case StandardEvent.ObjectAdded if event.params:
                self._inspect(event.params[0])
            case StandardEvent.CaptureComplete:
                self._is_ended = True
            case StandardEvent.StoreFull:
                self._is_full = True
        return event.code

    def _inspect(self, handle: int) -> None:
        try:
            reply = self._session.transact(Standard.GetObjectInfo, handle, timeouts=LONG_TIMEOUTS)
        except RefusedError as refusal:
            if refusal.code != INVALID_OBJECT_HANDLE:
                raise
            return  # it was deleted in the camera
        info = parse_object_info(reply.data)
        is_new = handle not in {stored.handle for stored in self._added}
        if is_new and info.object_format != FOLDER and self._is_ours(info):
            self._added.append(_Stored(handle, info))

    def _is_ours(self, info: ObjectInfo) -> bool:
        """Return whether a file can be of the capture that is due, or a further one of the last."""
        is_due = self._due_after_s is not None
        return is_due or (self._last is not None and info.stem == self._last.stem)

    def _is_copy(self, info: ObjectInfo) -> bool:
        """Return whether a file is the last frame once more, on another card."""
        if self._last is None or not info.captured:
            return False
        is_same = (info.name, info.captured) == (self._last.name, self._last.captured)
        return is_same and info.storage != self._last.storage

    def _delete(self, stored: _Stored) -> None:
        if not self._can_delete:
            return
        try:
            self._session.transact(Standard.DeleteObject, stored.handle, 0, timeouts=LONG_TIMEOUTS)
        except RefusedError:
            return  # a card that fills up ends a run later, and says so; no reason to end it now

    def _no_frame(self) -> DeviceError:
        if self._is_full:
            return DeviceError(
                "expected a frame, the camera reports that its card is full (StoreFull 0x400A): "
                "format its card or put in a larger one"
            )
        if self._added:
            delivered = ", ".join(str(stored.info) for stored in self._added)
            return DeviceError(
                f"expected a RAW file from the camera, it took {delivered}: set its image quality "
                "to RAW alone"
            )
        return DeviceError(
            f"expected a frame within {self._timeout_s:g} s of the exposure's end, the camera "
            "reported none (no ObjectAdded 0x4002): set it to manual focus, its self-timer off"
        )
