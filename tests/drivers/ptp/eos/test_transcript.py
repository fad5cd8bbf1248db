"""The bytes on the wire from plugging in to taking leave, written by hand from the protocol.

`>` is what the driver must write, to the byte; `<` what the camera then sends; `#` a remark.
Texts in quotes stand for PTP strings (u8 letters, UTF-16, closing zero).
"""

import pytest

from labrig.acquire.values import CameraCapabilities, ExposureSettings
from labrig.drivers.ptp import PtpCamera
from labrig.foundation.clock import VirtualClock

from ..usb.wire import TRANSACTION_S, OneDevice, Wire
from .transcript import CONNECT, Transcript

#: After `capabilities()`; Tv is the only setting that is not in force already.
CONFIGURE = """
> 0c000000 0100 1691 0e000000
< 0c000000 0300 0120 0e000000
> 0c000000 0100 1691 0f000000
< 14000000 0200 1691 0f000000 08000000 00000000
< 0c000000 0300 0120 0f000000
> 0c000000 0100 1091 10000000
> 18000000 0200 1091 10000000 0c000000 02d10000 68000000
< 0c000000 0300 0120 10000000
# not taken at once: asked again
> 0c000000 0100 1691 11000000
< 14000000 0200 1691 11000000 08000000 00000000
< 0c000000 0300 0120 11000000
> 0c000000 0100 1691 12000000
< 24000000 0200 1691 12000000 10000000 89c10000 02d10000 68000000 08000000 00000000
< 0c000000 0300 0120 12000000
> 0c000000 0100 1691 13000000
< 14000000 0200 1691 13000000 08000000 00000000
< 0c000000 0300 0120 13000000
"""

ARM = """
> 0c000000 0100 1691 14000000
< 14000000 0200 1691 14000000 08000000 00000000
< 0c000000 0300 0120 14000000
# RemoteReleaseOn half
> 14000000 0100 2891 15000000 01000000 00000000
< 0c000000 0300 0120 15000000
"""


def shoot(frame: bytes) -> str:
    size = len(frame).to_bytes(4, "little").hex()
    container = (12 + len(frame)).to_bytes(4, "little").hex()
    return f"""
# RemoteReleaseOn full; RemoteReleaseOff full
> 14000000 0100 2891 16000000 02000000 00000000
< 0c000000 0300 0120 16000000
> 10000000 0100 2991 17000000 02000000
< 0c000000 0300 0120 17000000
# nothing yet; then RequestObjectTransfer of 91000001, format B103, IMG_0001.CR2
> 0c000000 0100 1691 18000000
< 14000000 0200 1691 18000000 08000000 00000000
< 0c000000 0300 0120 18000000
> 0c000000 0100 1691 19000000
< 45000000 0200 1691 19000000
  31000000 86c10000 01000091 03b10000 00000000 {size} 00000000
  494d475f303030312e43523200 0000000000000000
  08000000 00000000
< 0c000000 0300 0120 19000000
# GetPartialObject from 0; TransferComplete; RemoteReleaseOff half
> 18000000 0100 0791 1a000000 01000091 00000000 {size}
< {container} 0200 0791 1a000000 {frame.hex()}
< 0c000000 0300 0120 1a000000
> 10000000 0100 1791 1b000000 01000091
< 0c000000 0300 0120 1b000000
> 10000000 0100 2991 1c000000 01000000
< 0c000000 0300 0120 1c000000
"""


LEAVE = """
> 10000000 0100 1591 1d000000 00000000
< 0c000000 0300 0120 1d000000
> 10000000 0100 1491 1e000000 00000000
< 0c000000 0300 0120 1e000000
> 0c000000 0100 0310 1f000000
< 0c000000 0300 0120 1f000000
"""


FRAMES = {
    "less than a packet": b"RAW" * 33,
    "two containers of whole packets, payload ragged": bytes(range(250)) * 2,
    "container of exactly three packets": b"\x5a" * (3 * 512 - 12),
    "payload of exactly two packets": b"\xa5" * 1024,
}


@pytest.mark.parametrize("frame", FRAMES.values(), ids=FRAMES.keys())
@pytest.mark.parametrize("empty_packets", [True, False], ids=["ended", "not ended"])
def test_from_plug_to_leave(frame: bytes, empty_packets: bool) -> None:
    transcript = Transcript(CONNECT + CONFIGURE + ARM + shoot(frame) + LEAVE)
    wire = Wire(transcript, VirtualClock())
    wire.sends_empty_packets = empty_packets
    settings = PtpCamera.Settings.model_validate({"shutter_lag": "62.5 ms"})
    camera = PtpCamera("usb://04a9:3199", settings, OneDevice(wire))
    assert camera.identity() == "Canon EOS X, serial 123, firmware 2.1.2"

    assert camera.capabilities() == CameraCapabilities(
        (1 / 128, 1 / 64),
        (100, 200),
        (4.0, 5.6),
        overhead_s=2.0,
        settling_s=0.02,
        frame_bytes=30_000_000,
    )
    assert camera.configure(ExposureSettings(1 / 60, 100, 4.0)) == ExposureSettings(
        1 / 64, 100, 4.0
    )
    camera.arm()
    before_s = wire.clock.now()
    photograph = camera.shoot()

    assert photograph.data == frame
    assert photograph.suffix == ".cr2"
    assert photograph.settings == ExposureSettings(1 / 64, 100, 4.0)
    # the command and its answer take one bus transaction each
    assert photograph.start_s == pytest.approx(before_s + TRANSACTION_S + 0.0625)
    assert photograph.end_s == pytest.approx(photograph.start_s + 1 / 64)

    camera.disconnect()
    assert not transcript.steps
    assert not any(wire.to_host)
    assert not wire.claimed
