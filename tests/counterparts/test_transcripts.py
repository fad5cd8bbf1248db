"""Recorded sessions of libgphoto2 with cameras: each side of this house meets the other's half.

Made anew by `python -m tests.counterparts.record`.
"""

import struct
from collections import deque
from collections.abc import Iterator
from pathlib import Path

import pytest

from labrig.drivers.ptp.codes import StandardEvent
from labrig.drivers.ptp.device_info import parse_device_info
from labrig.drivers.ptp.eos.events import Event, ObjectOffered, parse_events
from labrig.drivers.ptp.standard.object_info import parse_object_info
from labrig.foundation.clock import VirtualClock
from labrig.sim.camera.ptpip.packets import Packet
from labrig.sim.camera.ptpip.transactions import Transactions

from . import transcript
from .record import PICTURE_BYTES, SESSIONS, body_of
from .served import EPOCH_S, STANDARD, Film, camera_on
from .transcript import CAMERA, COMMAND, HOST, Line

OPERATION_REQUEST, RESPONSE, EVENT, DATA, END_DATA = 6, 7, 8, 10, 12
GET_DEVICE_INFO, GET_OBJECT_INFO, GET_EVENT = 0x1001, 0x1008, 0x9116
#: Of what these carry every byte counts: the pictures.
OF_OBJECTS = {0x1009, 0x101B, 0x9104, 0x9107}
TAKES_A_PICTURE = {"capture_to_host", "capture_to_card", "bulb", "standard_capture"}

recorded = pytest.mark.parametrize("path", transcript.paths(), ids=lambda path: path.stem)


def transactions(lines: list[Line], sender: str) -> list[Line]:
    """What one side said on the command connection after the introduction."""
    return [
        line
        for line in lines
        if (line.sender, line.connection) == (sender, COMMAND) and line.kind >= OPERATION_REQUEST
    ]


def test_there_is_one_of_every_session() -> None:
    assert {path.stem for path in transcript.paths()} == set(SESSIONS)


@recorded
def test_the_simulated_camera_answers_the_recorded_host(path: Path) -> None:
    lines = transcript.read(path)
    clock = VirtualClock(EPOCH_S)
    film = Film(size=PICTURE_BYTES)
    responder = camera_on(clock, film, body_of(path.stem)).responder
    host = Transactions(responder)
    expected = deque(transactions(lines, CAMERA))
    opcode = 0
    for line in lines:
        clock.sleep_until(line.t_s)
        if line.sender == CAMERA and line.kind == EVENT:
            responder.take_event()
        if (line.sender, line.connection) != (HOST, COMMAND) or line.kind < OPERATION_REQUEST:
            continue
        if line.kind == OPERATION_REQUEST:
            _, opcode = struct.unpack_from("<IH", line.payload)
        for packet in host.take(Packet(line.kind, line.payload)):
            meant = expected.popleft()
            assert packet[4:8] == meant.packet[4:8], f"{opcode:04X} at {line.t_s} s"
            if meant.kind == RESPONSE or opcode in OF_OBJECTS:
                assert packet == meant.packet, f"{opcode:04X} at {line.t_s} s"
        host.answered()
    assert not expected
    assert len(film.taken) == (path.stem in TAKES_A_PICTURE)


def data_phases(lines: list[Line]) -> Iterator[tuple[int, bytes]]:
    """The operations of a session with what the camera sent in their data phases."""
    opcodes = {}
    for line in transactions(lines, HOST):
        if line.kind == OPERATION_REQUEST:
            _, opcode, transaction_id = struct.unpack_from("<IHI", line.payload)
            opcodes[transaction_id] = opcode
    data = b""
    for line in transactions(lines, CAMERA):
        if line.kind in (DATA, END_DATA):
            data += line.payload[4:]
        if line.kind == RESPONSE:
            (transaction_id,) = struct.unpack_from("<I", line.payload, 2)
            yield opcodes.pop(transaction_id), data
            data = b""
    assert not opcodes


@recorded
def test_our_readers_understand_what_libgphoto2_was_sent(path: Path) -> None:
    lines = transcript.read(path)
    body = body_of(path.stem)
    events: list[Event] = []
    sizes: set[int] = set()
    for opcode, data in data_phases(lines):
        if opcode == GET_EVENT:
            events += parse_events(data)
        if opcode == GET_DEVICE_INFO:
            info = parse_device_info(data)
            assert camera_on(VirtualClock(), Film(), body).responder.model in str(info)
        if opcode == GET_OBJECT_INFO:
            sizes.add(parse_object_info(data).size_bytes)
    reported = [struct.unpack_from("<H", line.payload)[0] for line in lines if line.kind == EVENT]
    pictures = 1 if path.stem in TAKES_A_PICTURE else 0
    if body == STANDARD:
        assert reported == [StandardEvent.ObjectAdded, StandardEvent.CaptureComplete] * pictures
        assert PICTURE_BYTES in sizes
    else:
        offered = [event for event in events if isinstance(event, ObjectOffered)]
        assert [event.size_bytes for event in offered] == [PICTURE_BYTES] * pictures
