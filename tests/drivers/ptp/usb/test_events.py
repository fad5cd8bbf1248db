"""Events on the interrupt endpoint, in whatever packets a camera sends them."""

import struct
from types import SimpleNamespace
from typing import Any

import pytest
import usb.core
from hypothesis import given, strategies as st

from labrig.drivers.ptp.containers import Container, Kind
from labrig.drivers.ptp.failures import MalformedError, StallError, UnpluggedError
from labrig.drivers.ptp.usb.link import UsbLink
from labrig.foundation.clock import VirtualClock
from labrig.foundation.errors import DeviceError

from ..eos.toy import ToyEos
from .wire import INTERRUPT_PACKET, Wire

TIMEOUT_S = 0.1


def event(code: int, *params: int, tid: int = 0xFFFFFFFF) -> bytes:
    payload = struct.pack(f"<{len(params)}I", *params)
    return struct.pack("<IHHI", 12 + len(payload), 4, code, tid) + payload


def packets(transfer: bytes) -> list[bytes]:
    step = INTERRUPT_PACKET
    return [transfer[at : at + step] for at in range(0, len(transfer), step)]


def link_on(wire: Wire) -> UsbLink:
    return UsbLink(usb.core.Device(1, wire), "usb://x", wire.clock)


@pytest.fixture
def wire() -> Wire:
    return Wire(ToyEos(), VirtualClock())


@given(
    st.lists(
        st.tuples(st.integers(0, 0xFFFF), st.lists(st.integers(0, 0xFFFFFFFF), max_size=5)),
        max_size=4,
    ),
    st.booleans(),
)
def test_events_arrive_whole_with_and_without_an_empty_packet_behind_them(
    events: list[tuple[int, list[int]]], ends_with_empty: bool
) -> None:
    wire = Wire(ToyEos(), VirtualClock())
    link = link_on(wire)
    for code, params in events:
        sent = event(code, *params)
        wire.interrupts.extend(packets(sent))
        if ends_with_empty and len(sent) % INTERRUPT_PACKET == 0:
            wire.interrupts.append(b"")
    for code, params in events:
        heard = link.event(TIMEOUT_S)
        assert heard is not None
        assert (heard.kind, heard.code, heard.params) == (Kind.EVENT, code, tuple(params))
    assert link.event(TIMEOUT_S) is None


def test_silence_lasts_as_long_as_was_asked(wire: Wire) -> None:
    link, before_s = link_on(wire), wire.clock.now()
    assert link.event(TIMEOUT_S) is None
    assert wire.clock.now() - before_s == pytest.approx(TIMEOUT_S, abs=0.01)


def test_an_event_that_comes_in_two_waits_is_one(wire: Wire) -> None:
    link = link_on(wire)
    first, *rest = packets(event(0x4002, 7))
    wire.interrupts.append(first)
    assert link.event(TIMEOUT_S) is None
    wire.interrupts.extend(rest)
    assert link.event(TIMEOUT_S) == Container(Kind.EVENT, 0x4002, 0xFFFFFFFF, b"\7\0\0\0")


@pytest.mark.parametrize(
    "junk", [bytes(16), event(0x4002, 7)[:4] + bytes(12), struct.pack("<IHHI", 12, 3, 0x2001, 7)]
)
def test_what_is_no_event_is_reported_and_forgotten(wire: Wire, junk: bytes) -> None:
    link = link_on(wire)
    wire.interrupts.extend(packets(junk))
    with pytest.raises(MalformedError, match=" ".join(f"{byte:02x}" for byte in junk[:8])):
        link.event(TIMEOUT_S)
    wire.interrupts.clear()
    wire.interrupts.extend(packets(event(0x400D)))
    assert link.event(TIMEOUT_S) is not None


def test_a_halted_endpoint_is_cleared(wire: Wire) -> None:
    link = link_on(wire)
    wire.interrupt_is_halted = True
    with pytest.raises(StallError):
        link.event(TIMEOUT_S)
    wire.interrupts.extend(packets(event(0x400D)))
    assert link.event(TIMEOUT_S) is not None


def test_unplugged(wire: Wire) -> None:
    link = link_on(wire)
    wire.unplugged = True
    with pytest.raises(UnpluggedError):
        link.event(TIMEOUT_S)


def test_a_camera_without_an_interrupt_endpoint_says_so(wire: Wire) -> None:
    def bulk_only(device: Any, ep: int, intf: int, alt: int, config: int) -> SimpleNamespace:
        return Wire.get_endpoint_descriptor(wire, device, 1 + ep % 2, intf, alt, config)

    wire.get_endpoint_descriptor = bulk_only  # type: ignore[method-assign]
    with pytest.raises(DeviceError, match="interrupt endpoint"):
        link_on(wire).event(TIMEOUT_S)


def test_an_event_that_is_never_ended_is_forgotten(wire: Wire) -> None:
    link = link_on(wire)
    wire.interrupts.append(packets(event(0x4002, 7))[0])
    assert [link.event(TIMEOUT_S), link.event(TIMEOUT_S)] == [None, None]
    wire.interrupts.extend(packets(event(0x4002, 8)))
    heard = link.event(TIMEOUT_S)
    assert heard is not None
    assert heard.params == (8,)


def test_nothing_is_believed_of_what_follows_no_event(wire: Wire) -> None:
    link = link_on(wire)
    wire.interrupts.extend(packets(b"\xee" * 2000 + event(0x4002, 7)))
    with pytest.raises(MalformedError, match="ee ee"):
        link.event(TIMEOUT_S)
    assert link.event(TIMEOUT_S) is None
    wire.interrupts.extend(packets(event(0x4002, 8)))
    assert link.event(TIMEOUT_S) is not None
