"""What the camera offers, takes and delivers."""

import errno
import math
from typing import Any

import pytest
import usb.core

from labrig.acquire import Camera
from labrig.acquire.values import CameraCapabilities, ExposureSettings
from labrig.drivers.ptp import PtpCamera
from labrig.foundation.errors import DeviceError

from ..usb.wire import TRANSACTION_S, Wire
from .bench import SHORT, Bench, bench, photograph
from .toy import (
    FULL,
    HALF,
    OFF_FULL,
    OFF_HALF,
    OPERATIONS,
    RAW,
    Fault,
    ToyEos,
    choices_changed,
    u32,
)

WITHOUT_CHUNKS = [op for op in OPERATIONS if op != 0x9107]


def test_fills_the_role() -> None:
    assert isinstance(bench().connect(), Camera)


def test_takes_control_of_what_would_spoil_frames() -> None:
    b = bench()
    b.connect()
    assert b.toy.values[0xD106] == u32(0)  # single shot
    assert b.toy.values[0xD11C] == u32(4)  # to the PC
    assert b.toy.values[0xD120] == RAW
    assert (0x911A, 0x0FFFFFFF, 0x1000, 1) in b.toy.log


def test_offers_what_the_camera_lists_and_the_rig_allows() -> None:
    camera = bench().connect(
        isos=(200, 400, 6400), longest_exposure="1 s", frame_time="3 s", frame_size="25 MB"
    )
    assert camera.capabilities() == CameraCapabilities(
        exposures_s=(1 / 128, 1 / 64, 1.0),
        isos=(200, 6400),
        f_numbers=(4.0, 5.6),
        overhead_s=3.0,
        settling_s=0.02,
        frame_bytes=25_000_000,
    )


def test_offers_follow_the_camera() -> None:
    b = bench()
    camera = b.connect()
    b.toy.events.append(choices_changed(0xD101, (0x38,)))
    assert camera.capabilities().f_numbers == (8.0,)


def test_declared_offers_are_thirds_of_stops_by_their_true_times() -> None:
    settings = PtpCamera.Settings.model_validate({"longest_exposure": "1 s", "isos": [400, 100]})
    capabilities = settings.planned_offers()
    assert capabilities.exposures_s[-1] == 1.0
    assert capabilities.exposures_s[0] == 1 / 8192
    ratios = {
        b / a for a, b in zip(capabilities.exposures_s, capabilities.exposures_s[1:], strict=False)
    }
    assert all(math.isclose(r, 2 ** (1 / 3)) for r in ratios)
    assert capabilities.isos == (100, 400)
    assert capabilities.overhead_s == settings.frame_time
    assert capabilities.frame_pixels is None
    for given, frame_bytes in (
        ({"frame_size": "27 MB"}, 27_000_000),
        ({"frame_pixels": [5634, 3752]}, 1.5 * 5634 * 3752),
    ):
        settings = PtpCamera.Settings.model_validate(given)
        assert settings.planned_offers().frame_bytes == frame_bytes


@pytest.mark.parametrize(
    "rig", [{"isos": [123]}, {"f_numbers": [5.7]}, {"shuter_lag": "1 s"}, {"isos": []}]
)
def test_settings_refuse_what_no_camera_has(rig: dict[str, object]) -> None:
    with pytest.raises(ValueError, match=r"isos|f_numbers|shuter_lag"):
        PtpCamera.Settings.model_validate(rig)


def test_configure_sets_only_what_is_not_in_force() -> None:
    b = bench()
    camera = b.connect()
    sets = b.toy.log.count((0x9110,))
    assert camera.configure(SHORT) == SHORT
    assert b.toy.log.count((0x9110,)) == sets + 3
    assert camera.configure(SHORT) == SHORT
    assert b.toy.log.count((0x9110,)) == sets + 3


def test_configure_takes_dial_labels_and_returns_true_times() -> None:
    camera = bench().connect()
    assert camera.configure(ExposureSettings(1 / 60, 100, None)).exposure_s == 1 / 64
    assert camera.configure(ExposureSettings(30, 100, None)).exposure_s == 32


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        (ExposureSettings(1 / 90, 100, 4.0), "shutter time"),
        (ExposureSettings(1 / 64, 6400, 4.0), "ISO"),  # listed, but not native
        (ExposureSettings(1 / 64, 100, 8.0), "f/4, f/5.6"),
        (ExposureSettings(math.nan, 100, 4.0), "longer than 0 s"),
        (ExposureSettings(0.0, 100, 4.0), "longer than 0 s"),
    ],
)
def test_configure_refuses_what_is_not_offered(asked: ExposureSettings, message: str) -> None:
    with pytest.raises(DeviceError, match=message):
        bench().connect().configure(asked)


@pytest.mark.parametrize(
    ("prop", "said"),
    [
        (0xD101, r"aperture \(0xD101\) = 0x30 \(f/5\.6\), it says 0x28 \(f/4\)"),
        (0xD102, r"shutter time \(0xD102\) = 0x68 \(1/64 s\), it says 0x70 \(1/128 s\)"),
        (0xD103, r"iso \(0xD103\) = 0x50 \(ISO 200\), it says 0x48 \(ISO 100\)"),
    ],
)
def test_what_is_set_is_read_back_and_both_are_reported(prop: int, said: str) -> None:
    b = bench()
    b.toy.stubborn.add(prop)
    with pytest.raises(DeviceError, match=f"asked the camera for {said}"):
        b.connect().configure(SHORT)


def test_manual_lens() -> None:
    b = bench()
    b.toy.values[0xD101] = u32(0)
    b.toy.lists[0xD101] = ()
    camera = b.connect()
    assert camera.capabilities().f_numbers == ()
    assert photograph(camera, ExposureSettings(1 / 64, 100)).settings.f_number is None
    with pytest.raises(DeviceError, match="by hand"):
        camera.configure(SHORT)


@pytest.mark.parametrize(
    ("prop", "value", "message"),
    [(0xD105, 0, "exposure mode"), (0xD102, 0x0C, "bulb"), (0xD103, 0, "automatic ISO")],
)
def test_wrong_mode_is_reported(prop: int, value: int, message: str) -> None:
    b = bench()
    b.toy.values[prop] = u32(value)
    camera = b.connect()
    with pytest.raises(DeviceError, match=message):
        camera.shoot()


def test_wrong_dial_offers_nothing() -> None:
    b = bench()
    b.toy.values[0xD105] = u32(0)
    camera = b.connect()
    with pytest.raises(DeviceError, match="dial"):
        camera.capabilities()


def test_a_dial_without_lists_is_reported() -> None:
    b = bench()
    b.toy.lists[0xD102] = ()
    with pytest.raises(DeviceError, match="turn its dial to M"):
        b.connect().capabilities()


def test_shoot_measures_the_press_that_succeeded() -> None:
    b = bench()
    camera = b.connect(shutter_lag="50 ms")
    camera.configure(SHORT)
    camera.arm()
    b.toy.faults[FULL] = [Fault.BUSY] * 3
    frame = camera.shoot()
    true_start_s = b.toy.exposing_until_s - SHORT.exposure_s
    # the answer is half a round trip after the command has arrived: here, one transaction
    assert frame.start_s == pytest.approx(true_start_s + 0.05, abs=TRANSACTION_S)
    assert frame.end_s == pytest.approx(frame.start_s + SHORT.exposure_s)
    assert frame.data == b.toy.frame(1)


class SlowWire(Wire):
    """The camera answers a half press only when its lens is through with searching."""

    searching_s = 0.0

    def bulk_read(self, handle: Any, ep: int, intf: int, buff: Any, timeout: int) -> int:
        assert isinstance(self.peer, ToyEos)
        if self.to_host and self.searching_s and self.peer.log[-1][:2] == HALF:
            waited_s = min(self.searching_s, timeout / 1e3)
            self.searching_s -= waited_s
            self.clock.spend(waited_s)
            if self.searching_s > 0:
                raise usb.core.USBTimeoutError("Operation timed out", -7, errno.ETIMEDOUT)
        return super().bulk_read(handle, ep, intf, buff, timeout)


@pytest.mark.parametrize(("searching_s", "is_patient"), [(8.0, True), (30.0, False)])
def test_a_half_press_may_take_eight_seconds(searching_s: float, is_patient: bool) -> None:
    b = bench()
    wire = SlowWire(b.toy, b.wire.clock)
    camera = Bench(b.toy, wire).connect()
    camera.configure(SHORT)
    wire.searching_s = searching_s
    if is_patient:
        camera.arm()
        assert camera.shoot().data == b.toy.frame(1)
        return
    with pytest.raises(DeviceError, match=r"RemoteReleaseOn 0x9128 within 12 s: no answer"):
        camera.arm()


def test_shoot_sends_nothing_before_the_press_and_lets_go_in_order() -> None:
    b = bench()
    camera = b.connect()
    camera.configure(SHORT)
    camera.arm()
    camera.arm()
    armed_at = len(b.toy.log)
    camera.shoot()
    assert b.toy.log[armed_at] == (*FULL, 0)
    releases = [key for key in b.toy.log if key[0] in (0x9128, 0x9129)]
    assert releases == [(*HALF, 0), (*FULL, 0), OFF_FULL, OFF_HALF]


def test_shoot_without_arm_arms() -> None:
    b = bench()
    camera = b.connect()
    assert camera.shoot().data == b.toy.frame(1)
    assert b.toy.is_idle


def test_configure_when_armed_lets_go_first() -> None:
    b = bench()
    camera = b.connect()
    camera.arm()
    assert photograph(camera).data == b.toy.frame(1)
    assert b.toy.is_idle


@pytest.mark.parametrize("size", [1, 512, 1024**2 - 12, 1024**2, 3 * 1024**2 + 5])
@pytest.mark.parametrize("operation", [0x9107, 0x101B, 0x9104])
def test_frames_of_any_size_by_any_operation(size: int, operation: int) -> None:
    b = bench(ToyEos((*WITHOUT_CHUNKS, operation)))
    b.toy.frame_bytes = size
    assert photograph(b.connect()).data == b.toy.frame(1)
    assert b.toy.stored == {}
    parts = [key[2:] for key in b.toy.log if key[0] in (0x9107, 0x101B)]
    assert parts == [
        (at, min(1024**2, size - at)) for at in range(0, size, 1024**2) if operation != 0x9104
    ]


# what lies beyond an announced end is never asked for in chunks
@pytest.mark.parametrize(("extra", "operation"), [(100, 0x9107), (100, 0x9104), (-100, 0x9104)])
def test_frame_of_another_size_than_announced(extra: int, operation: int) -> None:
    b = bench(ToyEos((*WITHOUT_CHUNKS, operation)))
    b.toy.announced_extra_bytes = extra
    camera = b.connect()
    with pytest.raises(DeviceError, match="expected"):
        photograph(camera)
    camera.make_safe()
    assert b.toy.is_idle


def test_jpeg_is_no_frame() -> None:
    b = bench()
    b.toy.name = b"IMG_0001.JPG"
    camera = b.connect()
    with pytest.raises(DeviceError, match=r"RAW.*IMG_0001\.JPG"):
        photograph(camera)
    camera.make_safe()
    assert b.toy.is_idle


@pytest.mark.parametrize(
    ("prop", "said"), [(0xD120, "image format"), (0xD11C, "destination"), (0xD106, "drive mode")]
)
def test_what_is_not_taken_is_refused_because_it_is_read_back(prop: int, said: str) -> None:
    b = bench()
    b.toy.stubborn.add(prop)
    before = b.toy.values[prop]
    with pytest.raises(DeviceError, match=f"asked the camera for {said} .* it says"):
        b.connect()
    assert not b.wire.claimed
    assert b.toy.values[prop] == before


def test_a_frame_taken_by_hand_is_not_mistaken() -> None:
    b = bench()
    camera = b.connect()
    b.toy.offer(77)
    assert photograph(camera).data == b.toy.frame(1)
    assert b.toy.is_idle


def test_no_frame_in_time() -> None:
    b = bench()
    b.toy.never_delivers = True
    camera = b.connect(transfer_timeout="7 s")
    with pytest.raises(DeviceError, match="within 7 s"):
        photograph(camera)
    camera.make_safe()
    assert b.toy.is_idle


def test_room_on_the_pc_is_reported_again_when_it_runs_out() -> None:
    b = bench()
    b.toy.values[0xD11B] = u32(3)
    camera = b.connect()
    told = b.toy.log.count((0x911A, 0x0FFFFFFF, 0x1000, 1))
    camera.arm()
    assert b.toy.log.count((0x911A, 0x0FFFFFFF, 0x1000, 1)) == told + 1


class TestOlderRelease:
    OPERATIONS = (*(op for op in OPERATIONS if op not in (0x9128, 0x9129)), 0x910F)

    def test_frame(self) -> None:
        b = bench(ToyEos(self.OPERATIONS))
        camera = b.connect()
        assert photograph(camera).data == b.toy.frame(1)
        camera.make_safe()

    @pytest.mark.parametrize(
        ("result", "message"), [(1, "focus"), (3, "mirror"), (7, "room"), (9, "menus")]
    )
    def test_results(self, result: int, message: str) -> None:
        b = bench(ToyEos(self.OPERATIONS))
        b.toy.release_result = result
        camera = b.connect()
        with pytest.raises(DeviceError, match=message):
            photograph(camera)
        camera.make_safe()
        b.toy.release_result = 0
        assert photograph(camera).data == b.toy.frame(1)


def test_a_camera_that_a_pc_cannot_release_is_refused_with_what_it_lacks() -> None:
    b = bench(ToyEos((0x1001, 0x1002, 0x1003, 0x9110)))
    with pytest.raises(DeviceError, match=r"0x9114.*0x910F.*0x100E.*USB mode") as caught:
        b.connect()
    assert "\n" not in str(caught.value)
    assert not b.wire.claimed
