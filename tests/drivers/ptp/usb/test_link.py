"""Containers on bulk endpoints and class requests, packet by packet."""

import struct
from collections import deque

import pytest
import usb.core

from labrig.drivers.ptp.containers import Container, Kind, command
from labrig.drivers.ptp.failures import MalformedError, NoAnswerError
from labrig.drivers.ptp.usb.link import UsbLink
from labrig.foundation.clock import VirtualClock
from labrig.foundation.errors import DeviceError

from .wire import PACKET, Wire

OK, BUSY, CANCELLED = 0x2001, 0x2019, 0x201F
CANCEL, RESET, STATUS = 0x64, 0x66, 0x67
TIMEOUT_S, MAX_BYTES = 0.5, 4096


class Scripted:
    """A device that notes what it hears, and says its statuses one after the other."""

    def __init__(self) -> None:
        self.heard: list[bytes] = []
        self.requests: list[tuple[int, bytes]] = []
        self.statuses: deque[bytes] = deque()

    def written(self, wire: Wire, data: bytes) -> None:
        self.heard.append(data)

    def control(self, wire: Wire, request: int, data: bytes) -> bytes:
        self.requests.append((request, data))
        if request != STATUS:
            return b""
        return self.statuses.popleft() if self.statuses else status(OK)


def status(code: int) -> bytes:
    return struct.pack("<HH", 4, code)


def container(kind: Kind, code: int, tid: int, payload: bytes = b"") -> bytes:
    return struct.pack("<IHHI", 12 + len(payload), kind, code, tid) + payload


@pytest.fixture
def device() -> Scripted:
    return Scripted()


@pytest.fixture
def wire(device: Scripted) -> Wire:
    return Wire(device, VirtualClock())


@pytest.fixture
def link(wire: Wire) -> UsbLink:
    return UsbLink(usb.core.Device(1, wire), "usb://x", wire.clock)


@pytest.mark.parametrize("size", [0, 8, PACKET - 12, PACKET, 3 * PACKET - 12])
def test_a_command_and_its_data_are_two_transfers(
    link: UsbLink, device: Scripted, size: int
) -> None:
    link.send(command(0x9110, 7, (1, 2)), bytes(size), "x")
    assert device.heard == [
        container(Kind.COMMAND, 0x9110, 7, struct.pack("<II", 1, 2)),
        container(Kind.DATA, 0x9110, 7, bytes(size)),
    ]


@pytest.mark.parametrize("size", [0, 8, PACKET - 12, PACKET, 3 * PACKET - 12])
@pytest.mark.parametrize("ends_with_empty", [True, False])
def test_data_then_the_response_of_whatever_size(
    link: UsbLink, wire: Wire, size: int, ends_with_empty: bool
) -> None:
    wire.sends_empty_packets = ends_with_empty
    wire.send(container(Kind.DATA, 0x9107, 7, b"d" * size))
    wire.send(container(Kind.RESPONSE, OK, 7))
    assert link.receive("x", TIMEOUT_S, MAX_BYTES).payload == b"d" * size
    assert link.receive("x", TIMEOUT_S, MAX_BYTES) == Container(Kind.RESPONSE, OK, 7)


def test_cancelling_names_the_transaction_and_waits_until_the_device_is_ready(
    link: UsbLink, wire: Wire, device: Scripted
) -> None:
    wire.send(container(Kind.DATA, 0x9107, 0x0A0B0C0D, bytes(5 * PACKET)))
    device.statuses += [status(BUSY), status(CANCELLED), status(OK)]
    link.cancel(0x0A0B0C0D)
    assert device.requests[0] == (CANCEL, bytes.fromhex("01 40 0d 0c 0b 0a"))
    assert [request for request, _ in device.requests[1:]] == [STATUS] * 3
    assert not wire.to_host, "what was still on its way is forgotten"


def test_a_reset_clears_halts_and_forgets_what_is_on_its_way(
    link: UsbLink, wire: Wire, device: Scripted
) -> None:
    wire.send(container(Kind.RESPONSE, OK, 7))
    wire.halted = True
    link.reset()
    assert device.requests == [(RESET, b""), (STATUS, b"")]
    assert (wire.halted, list(wire.to_host)) == (False, [])


def test_a_device_that_never_gets_ready_is_given_up(
    link: UsbLink, wire: Wire, device: Scripted
) -> None:
    device.statuses.extend([status(BUSY)] * 1000)
    with pytest.raises(DeviceError, match="stays at 0x2019 DeviceBusy: switch it off and on"):
        link.cancel(7)
    assert wire.clock.now() == pytest.approx(3.0, abs=0.5)


@pytest.mark.parametrize(
    ("transfer", "shown"),
    [
        (b"\xab\xcd", "'ab cd'"),
        (container(Kind.RESPONSE, OK, 7)[:11], "'0c 00 00 00 03 00 01 20 07 00 00'"),
        (struct.pack("<IHHI", 12, 9, OK, 7), "'0c 00 00 00 09 00 01 20 07 00 00 00'"),
        (struct.pack("<IHHI", 11, 3, OK, 7), "'0b 00 00 00 03 00 01 20 07 00 00 00'"),
        (container(Kind.RESPONSE, OK, 7, b"\x99"), "'0d 00 00 00 03 00 01 20 07 00 00 00 99'"),
        (container(Kind.RESPONSE, OK, 7, bytes(24)), "36 bytes '24 00 00 00 03 00 01 20"),
        (struct.pack("<IHHI", 1 << 30, 2, 0x9107, 7), "announces 1073741824, got '00 00 00 40 02"),
        (container(Kind.DATA, 0x9107, 7, b"ab") + b"c", "expected 14 bytes as announced, got '0e"),
        (container(Kind.DATA, 0x9107, 7, bytes(600))[:-1], "got 611 bytes '64 02 00 00 02 00 07"),
    ],
)
def test_what_is_no_container_is_shown(
    link: UsbLink, wire: Wire, transfer: bytes, shown: str
) -> None:
    wire.send(transfer)
    with pytest.raises(MalformedError) as caught:
        link.receive("x", TIMEOUT_S, MAX_BYTES)
    assert shown in str(caught.value)
    assert str(caught.value).isprintable()


def test_what_came_before_the_silence_is_shown(link: UsbLink, wire: Wire) -> None:
    wire.sends_empty_packets = False
    wire.send(container(Kind.DATA, 0x9107, 7, b"\xee" * 2000)[:PACKET])
    with pytest.raises(NoAnswerError, match="of 2012 bytes it sent 512 bytes 'dc 07 00 00"):
        link.receive("x", TIMEOUT_S, MAX_BYTES)


def test_a_device_that_does_not_stop_sending_is_given_up_with_what_it_sends(
    link: UsbLink, wire: Wire
) -> None:
    class Endless(deque[bytes]):
        def __bool__(self) -> bool:
            return True

        def popleft(self) -> bytes:
            return b"\x5a\xa5"

    wire.to_host = Endless()
    with pytest.raises(MalformedError, match="stop sending, got '5a a5': switch the"):
        link.cancel(7)


@pytest.mark.parametrize("answer", [b"", b"\x04\x00\x01"])
def test_a_status_that_is_none_is_shown(link: UsbLink, device: Scripted, answer: bytes) -> None:
    device.statuses.append(answer)
    with pytest.raises(MalformedError, match=answer.hex(" ") or "nothing"):
        link.cancel(7)
