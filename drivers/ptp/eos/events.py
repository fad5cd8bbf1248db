"""Records of EOS GetEvent: u32 size of everything, u32 code, payload; size 8, code 0 ends them.

Offsets of the payloads: the constants that libgphoto2 found in traffic of real cameras.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass

from ..failures import MalformedError

OBJECT_ADDED, OBJECT_ADDED_64 = 0xC181, 0xC1A7
TRANSFER_REQUESTED, TRANSFER_REQUESTED_64 = 0xC186, 0xC1A9
VALUE_CHANGED = 0xC189
CHOICES_CHANGED = 0xC18A

_RECORD_HEADER_BYTES = 8
#: The only kind of list that has been understood: one u32 a choice.
_LIST_OF_CHOICES = 3
_FOLDER_FORMAT = 0x3001


@dataclass(frozen=True)
class ValueChanged:
    """Event that a property has this value now."""

    prop: int
    value: bytes


@dataclass(frozen=True)
class ChoicesChanged:
    """Event that a property can be set to these codes now."""

    prop: int
    codes: tuple[int, ...]


@dataclass(frozen=True)
class ObjectOffered:
    """Event that a file in the camera is to be fetched.

    Attributes
    ----------
    handle
        Handle of the file in the camera.
    object_format
        PTP object format code.
    size_bytes
        Announced size of the file, in bytes.
    name
        File name that the camera gave.
    """

    handle: int
    object_format: int
    size_bytes: int
    name: str


@dataclass(frozen=True)
class Other:
    """Record that this driver does not use."""

    code: int
    payload: bytes


Event = ValueChanged | ChoicesChanged | ObjectOffered | Other


@dataclass(frozen=True)
class _ObjectLayout:
    """Offsets in a record's payload (its own offset less the 8 bytes of header)."""

    object_format: int
    size: int
    name: int


_OBJECTS = {
    OBJECT_ADDED: _ObjectLayout(object_format=0x08, size=0x14, name=0x20),
    OBJECT_ADDED_64: _ObjectLayout(object_format=0x08, size=0x14, name=0x24),
    TRANSFER_REQUESTED: _ObjectLayout(object_format=0x04, size=0x0C, name=0x14),
    TRANSFER_REQUESTED_64: _ObjectLayout(object_format=0x04, size=0x0C, name=0x14),
}


def parse_events(data: bytes) -> tuple[Event, ...]:
    """Return the events in the data phase of GetEvent, in order.

    Raises
    ------
    MalformedError
        A record is cut short or runs over its end.
    """
    return tuple(_event(code, payload) for code, payload in _records(data))


def _records(data: bytes) -> Iterator[tuple[int, bytes]]:
    position = 0
    while position < len(data):
        if len(data) - position < _RECORD_HEADER_BYTES:
            raise MalformedError(
                f"the camera's event list is cut short: expected {_RECORD_HEADER_BYTES} bytes from "
                f"byte {position} of {len(data)} on",
                data[position:],
            )
        size, code = struct.unpack_from("<II", data, position)
        if not _RECORD_HEADER_BYTES <= size <= len(data) - position:
            raise MalformedError(
                f"expected an event record of 8 to {len(data) - position} bytes, the camera "
                f"announces {size} (code 0x{code:X})",
                data[position:],
            )
        if (size, code) == (_RECORD_HEADER_BYTES, 0):
            return
        yield code, data[position + _RECORD_HEADER_BYTES : position + size]
        position += size


def _event(code: int, payload: bytes) -> Event:
    if code == VALUE_CHANGED:
        return ValueChanged(_u32(payload, 0, code), payload[4:])
    if code == CHOICES_CHANGED:
        prop, kind, count = (_u32(payload, at, code) for at in (0, 4, 8))
        if kind != _LIST_OF_CHOICES:
            return Other(code, payload)
        if len(payload) < 12 + 4 * count:
            raise _too_short(code, payload)
        return ChoicesChanged(prop, struct.unpack_from(f"<{count}I", payload, 12))
    if (layout := _OBJECTS.get(code)) is not None:
        object_format = _u32(payload, layout.object_format, code) & 0xFFFF
        size_bytes = _u32(payload, layout.size, code)
        if object_format == _FOLDER_FORMAT:
            return Other(code, payload)
        name = payload[layout.name :].partition(b"\0")[0].decode("ascii", errors="replace")
        return ObjectOffered(_u32(payload, 0, code), object_format, size_bytes, name)
    return Other(code, payload)


def _u32(payload: bytes, at: int, code: int) -> int:
    if len(payload) < at + 4:
        raise _too_short(code, payload)
    return int.from_bytes(payload[at : at + 4], "little")


def _too_short(code: int, payload: bytes) -> MalformedError:
    return MalformedError(
        f"the camera's event 0x{code:X} is too short for what it says: expected more", payload
    )
