"""The queue behind GetEvent: records that become due, and the interrupt that announces them."""

import math
import struct
from collections.abc import Callable
from dataclasses import dataclass

from labrig.foundation.clock import Clock

from ..objects import ObjectStore, StoredObject
from ..vocabulary import EosEvent, ObjectFormat

_END = struct.pack("<II", 8, 0)


def record(code: EosEvent, payload: bytes) -> bytes:
    """Return one record of GetEvent's answer."""
    return struct.pack("<II", 8 + len(payload), code) + payload


def _file_name(name: str) -> bytes:
    """Return the name, zero-terminated and padded to whole words."""
    return name.encode("ascii") + b"\0" * (4 - len(name) % 4)


def transfer_request(stored: StoredObject) -> bytes:
    """Return RequestObjectTransfer: the photograph waits in the camera's memory."""
    size = len(stored.photograph.raw)
    head = struct.pack("<IIIII", stored.handle, ObjectFormat.DNG, 0, size, 0)
    return record(EosEvent.REQUEST_OBJECT_TRANSFER, head + _file_name(stored.name))


def object_added(stored: StoredObject, store: ObjectStore) -> bytes:
    """Return ObjectAddedEx: the photograph is on the card."""
    size = len(stored.photograph.raw)
    head = struct.pack("<IIIII", stored.handle, stored.storage_id, ObjectFormat.DNG, 0, 0)
    tail = struct.pack("<III", size, store.parent(stored), 0)
    return record(EosEvent.OBJECT_ADDED_EX, head + tail + _file_name(stored.name))


@dataclass(frozen=True)
class _Event:
    due_s: float
    encode: Callable[[], bytes]


class EventQueue:
    """Events in the order in which they fall due.

    A record is encoded when it is fetched, because that of a photograph needs its size and so
    the photograph itself.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._events: list[_Event] = []
        self._listening = False
        self._knocked = False

    def listen(self) -> None:
        """Start to report (SetEventMode 1); events before are lost."""
        if not self._listening:
            self._drop_due()
        self._listening = True
        self._knocked = False

    def silence(self) -> None:
        """Stop to report."""
        self._listening = False

    def post(self, due_s: float, encode: Callable[[], bytes]) -> None:
        """Report an event at `due_s`."""
        self._events.append(_Event(due_s, encode))
        self._events.sort(key=lambda event: event.due_s)

    def fetch(self) -> bytes:
        """Return all due records, as GetEvent answers; each is reported once."""
        if not self._listening:
            return _END
        self._knocked = False
        return b"".join(event.encode() for event in self._drop_due()) + _END

    def knock_due_s(self) -> float:
        """Return the time at which the interrupt endpoint will next announce records."""
        if not self._listening or self._knocked or not self._events:
            return math.inf
        return self._events[0].due_s

    def knock(self) -> None:
        """Note that the host was notified; once is enough until it fetches."""
        self._knocked = True

    def _drop_due(self) -> list[_Event]:
        now_s = self._clock.now()
        due = [event for event in self._events if event.due_s <= now_s]
        self._events = [event for event in self._events if event.due_s > now_s]
        return due
