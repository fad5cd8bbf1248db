"""The viewfinder's bytes on the wire, written by hand, and what is made of bad ones."""

import struct
from contextlib import suppress

import pytest
from hypothesis import given, strategies as st

from labrig.acquire import LiveView
from labrig.drivers.ptp import PtpCamera
from labrig.drivers.ptp.eos.viewfinder import READY_TIMEOUT_S, jpeg_in
from labrig.foundation.clock import VirtualClock
from labrig.foundation.errors import DeviceError

from ..usb.wire import OneDevice, Wire
from .bench import SHORT, bench
from .toy import OPERATIONS, ToyEos
from .transcript import CONNECT, Transcript

LIVE = (*OPERATIONS, 0x9153)
PICTURE = b"\xff\xd8\xaa\xbb\xff\xd9"

#: The camera also knows 0x9153, and tells EVF output (off) and EVF mode (forbidden in its menu).
LIVE_CONNECT = (
    CONNECT.replace("8d000000 0200 0110", "8f000000 0200 0110")
    .replace("0c000000 0110 0210", "0d000000 5391 0110 0210")
    .replace(
        "e0000000 0200 1691 04000000\n",
        "00010000 0200 1691 04000000\n"
        "  10000000 89c10000 b0d10000 00000000\n"
        "  10000000 89c10000 b1d10000 00000000\n",
    )
)

FIRST_PICTURE = """
# SetDevicePropValueEx: EVF mode 1, which allows live view; read back
> 0c000000 0100 1091 0e000000
> 18000000 0200 1091 0e000000 0c000000 b1d10000 01000000
< 0c000000 0300 0120 0e000000
> 0c000000 0100 1691 0f000000
< 24000000 0200 1691 0f000000 10000000 89c10000 b1d10000 01000000 08000000 00000000
< 0c000000 0300 0120 0f000000
> 0c000000 0100 1691 10000000
< 14000000 0200 1691 10000000 08000000 00000000
< 0c000000 0300 0120 10000000
# SetDevicePropValueEx: EVF output 2, the PC; read back
> 0c000000 0100 1091 11000000
> 18000000 0200 1091 11000000 0c000000 b0d10000 02000000
< 0c000000 0300 0120 11000000
> 0c000000 0100 1691 12000000
< 24000000 0200 1691 12000000 10000000 89c10000 b0d10000 02000000 08000000 00000000
< 0c000000 0300 0120 12000000
> 0c000000 0100 1691 13000000
< 14000000 0200 1691 13000000 08000000 00000000
< 0c000000 0300 0120 13000000
# GetViewFinderData: not ready, then busy; events are fetched in between
> 10000000 0100 5391 14000000 00002000
< 0c000000 0300 02a1 14000000
> 0c000000 0100 1691 15000000
< 14000000 0200 1691 15000000 08000000 00000000
< 0c000000 0300 0120 15000000
> 10000000 0100 5391 16000000 00002000
< 0c000000 0300 1920 16000000
> 0c000000 0100 1691 17000000
< 14000000 0200 1691 17000000 08000000 00000000
< 0c000000 0300 0120 17000000
# the zoom in a record of kind 4, then the JPEG in one of kind 1
> 10000000 0100 5391 18000000 00002000
< 26000000 0200 5391 18000000 0c000000 04000000 01000000 0e000000 01000000 ffd8aabbffd9
< 0c000000 0300 0120 18000000
> 0c000000 0100 1691 19000000
< 14000000 0200 1691 19000000 08000000 00000000
< 0c000000 0300 0120 19000000
"""

SECOND_PICTURE = """
> 10000000 0100 5391 1a000000 00002000
< 1a000000 0200 5391 1a000000 0e000000 01000000 ffd8aabbffd9
< 0c000000 0300 0120 1a000000
> 0c000000 0100 1691 1b000000
< 14000000 0200 1691 1b000000 08000000 00000000
< 0c000000 0300 0120 1b000000
"""


def test_from_first_look_to_second() -> None:
    transcript = Transcript(LIVE_CONNECT + FIRST_PICTURE + SECOND_PICTURE)
    wire = Wire(transcript, VirtualClock())
    camera = PtpCamera("usb://04a9:3199", PtpCamera.Settings(), OneDevice(wire))
    assert isinstance(camera, LiveView)
    assert camera.preview() == PICTURE
    assert camera.preview() == PICTURE
    assert not transcript.steps


class LiveToy(ToyEos):
    """Also answers GetViewFinderData, with whatever it is told to."""

    answer: tuple[int, bytes | None] = (0x2001, struct.pack("<II", 8 + len(PICTURE), 1) + PICTURE)

    def _do(
        self, wire: Wire, key: tuple[int, ...], incoming: bytes
    ) -> tuple[int, tuple[int, ...], bytes | None]:
        if key[0] == 0x9153:
            assert self.values[0xD1B0] == b"\x02\0\0\0"
            code, data = self.answer
            return code, (), data
        return super()._do(wire, key, incoming)


def test_safe_is_off_and_so_is_the_moment_before_a_photograph() -> None:
    b = bench(LiveToy(LIVE))
    camera = b.connect()
    assert camera.preview() == PICTURE
    camera.make_safe()
    assert b.toy.values[0xD1B0] == bytes(4)
    assert camera.preview() == PICTURE
    assert b.toy.values[0xD1B0] != bytes(4)
    camera.configure(SHORT)
    camera.arm()
    assert b.toy.values[0xD1B0] == bytes(4)
    camera.shoot()


def test_a_camera_that_never_gets_ready_is_given_up() -> None:
    toy = LiveToy(LIVE)
    toy.answer = (0xA102, None)
    b = bench(toy)
    camera = b.connect()
    before_s = b.wire.clock.now()
    with pytest.raises(DeviceError, match=r"within 5 s.*0xA102"):
        camera.preview()
    assert b.wire.clock.now() - before_s == pytest.approx(READY_TIMEOUT_S, abs=0.3)
    camera.make_safe()
    assert toy.values[0xD1B0] == bytes(4)


def test_a_refusal_is_reported_at_once() -> None:
    toy = LiveToy(LIVE)
    toy.answer = (0x2005, None)
    with pytest.raises(DeviceError, match="0x2005"):
        bench(toy).connect().preview()


def test_a_camera_without_live_view_says_so() -> None:
    b = bench()
    camera = b.connect()
    with pytest.raises(DeviceError, match="live view"):
        camera.preview()
    camera.configure(SHORT)
    camera.shoot()


def record(kind: int, data: bytes) -> bytes:
    return struct.pack("<II", 8 + len(data), kind) + data


class TestRecords:
    @pytest.mark.parametrize("kind", [1, 9, 11])
    def test_a_jpeg_of_any_kind_anywhere(self, kind: int) -> None:
        data = record(4, b"\1\0\0\0") + record(3, b"") + record(kind, PICTURE) + record(5, b"x")
        assert jpeg_in(data) == PICTURE

    def test_a_record_that_counts_more_than_was_sent(self) -> None:
        assert jpeg_in(struct.pack("<II", 5000, 1) + PICTURE) == PICTURE

    @pytest.mark.parametrize(
        "data",
        [b"", b"\x08", PICTURE, bytes(64), record(4, PICTURE), record(1, b"GIF"), record(2, b"")],
    )
    def test_no_jpeg_is_reported(self, data: bytes) -> None:
        with pytest.raises(DeviceError, match="expected a JPEG"):
            jpeg_in(data)

    @given(st.binary(max_size=200))
    def test_anything_is_a_jpeg_or_a_device_error(self, data: bytes) -> None:
        with suppress(DeviceError):
            assert jpeg_in(data).startswith(b"\xff\xd8")
