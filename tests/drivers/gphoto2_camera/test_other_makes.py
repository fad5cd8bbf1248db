"""Other makes, by what libgphoto2 shows of them; and where libgphoto2 cannot be used at all."""

import importlib.util
import sys
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from labrig.acquire import ExposureSettings
from labrig.drivers.gphoto2_camera import Gphoto2Camera
from labrig.foundation.clock import SystemClock, VirtualClock
from labrig.foundation.errors import DeviceError, UsageError

from .bench import JPEG, TIFF, FastClock, Loopback, ToyBench

pytestmark = pytest.mark.skipif(
    sys.platform == "win32", reason="python-gphoto2 is not made for Windows"
)

NEF, JPG = ["DSC_0001.NEF", TIFF.hex()], ["DSC_0001.JPG", JPEG.hex()]
SETTINGS = ExposureSettings(1 / 64, 400, 8.0)


def test_a_nikon_is_prepared_set_and_released(toy: ToyBench) -> None:
    with toy.connected({}, {"files": [NEF]}) as camera:
        assert toy.log()[1:] == [
            "model PTP/IP Camera", "capturetarget=Internal RAM", "capturemode=Single Shot",
            "autofocus=Off", "imagequality=NEF (Raw)",
        ]  # fmt: skip
        assert camera.identity() == (
            "Nikon Corporation D7000, serial unknown, firmware unknown, released by libgphoto2 "
            "toy, trigger_capture"
        )
        capabilities = camera.capabilities()
        assert capabilities.exposures_s[:2] == (1 / 8192, 1 / 128)
        assert capabilities.exposures_s[-3:] == (2 ** (1 / 3), 2.0, 32.0)
        assert capabilities.isos == (100, 200, 400, 800, 1600)
        assert capabilities.f_numbers == (4.0, 4.5, 5.0, 5.6, 8.0)
        assert camera.configure(ExposureSettings(1 / 60, 400, 8.0)) == SETTINGS
        frame = camera.shoot()
        assert (frame.data, frame.suffix, frame.settings) == (TIFF, ".nef", SETTINGS)
    assert toy.log()[-4:] == ["iso=400", "f-number=f/8", "trigger", "exit"]


def test_what_is_right_already_is_left_alone(toy: ToyBench) -> None:
    right = {"imagequality": ["NEF (Raw)", "JPEG Fine", "NEF (Raw)"], "autofocus": ["Off", "Off"]}
    with toy.connected(right) as camera:
        camera.configure(ExposureSettings(1 / 64, 200, 5.6))
        assert [line.partition("=")[0] for line in toy.log()[2:]] == [
            "capturetarget",
            "capturemode",
        ]


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"expprogram": ["A", "A"]}, "its dial is at A"),
        ({"focusmode": ["AF-S", "AF-S"]}, "autofocus is on (AF-S)"),
        ({"isoauto": ["On", "On", "Off"]}, "automatic ISO is on"),
        ({"longexpnr": ["On", "On", "Off"]}, "long-exposure noise reduction is on"),
    ],
)
def test_what_spoils_photometry_is_refused(
    toy: ToyBench, changes: dict[str, list[str]], said: str
) -> None:
    with toy.connected(changes) as camera:
        (refused,) = [f for f in camera.findings() if f.severity == "refuse"]
    assert said in refused.what
    assert refused.remedy


def test_what_cannot_be_reported_is_warned_of(toy: ToyBench) -> None:
    names = ("expprogram", "focusmode", "isoauto", "longexpnr", "imagequality")
    untold: dict[str, list[str]] = {name: [] for name in names}
    with toy.connected(untold | {"autopoweroff": ["60"]}) as camera:
        warned = " ".join(str(f) for f in camera.findings() if f.severity == "warn")
    for said in ("exposure mode", "focus mode", "noise reduction", "image format", "after 60 s"):
        assert said in warned
    assert "assumed to be powers of two" in warned
    assert "trigger_capture" in warned


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"imagequality": ["JPEG Fine", "JPEG Fine"]}, "can be set to RAW alone"),
        ({"iso": []}, "cannot set the sensitivity"),
        ({"shutterspeed": [], "shutterspeed2": []}, "cannot set the shutter time"),
    ],
)
def test_a_camera_that_cannot_be_measured_with(
    toy: ToyBench, changes: dict[str, list[str]], why: str
) -> None:
    with pytest.raises(DeviceError, match=why), toy.connected(changes):
        pass


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"expprogram": ["P", "P"]}, "dial at M, it says P"),
        ({"iso": ["Hi 1", "Hi 1"]}, "none of the rig file's isos"),
        ({"shutterspeed2": ["Bulb", "Bulb"]}, "none of the rig file's shutter times"),
    ],
)
def test_nothing_to_offer(toy: ToyBench, changes: dict[str, list[str]], why: str) -> None:
    with toy.connected(changes) as camera, pytest.raises(DeviceError, match=why):
        camera.capabilities()


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"shutterspeed2": ["Bulb", "1/60", "Bulb"]}, "shutter time .* says Bulb"),
        ({"iso": ["Auto", "200", "Auto"]}, "ISO .* says Auto"),
    ],
)
def test_not_photographed_with_at_bulb_or_automatic_iso(
    toy: ToyBench, changes: dict[str, list[str]], why: str
) -> None:
    with toy.connected(changes) as camera, pytest.raises(DeviceError, match=why):
        camera.shoot()


def test_a_setting_that_is_not_taken(toy: ToyBench) -> None:
    with (
        toy.connected({}, {"stuck": ["iso"]}) as camera,
        pytest.raises(DeviceError, match="asked for iso 400, it stays at 200"),
    ):
        camera.configure(SETTINGS)


@pytest.mark.parametrize(
    ("files", "why"),
    [
        ([JPG], "'DSC_0001.JPG' of 64 bytes, a JPEG"),
        ([["DSC_0001.NEF", ""]], "'DSC_0001.NEF' of 0 bytes"),
        ([], "reported none"),
    ],
)
def test_a_frame_that_is_none(toy: ToyBench, files: list[Any], why: str) -> None:
    with toy.connected({}, {"files": files}, transfer_timeout="1 s") as camera:
        camera.configure(SETTINGS)
        with pytest.raises(DeviceError, match=why):
            camera.shoot()
        camera.make_safe()


def test_busy_may_mean_that_it_has_released_all_the_same(toy: ToyBench) -> None:
    second = ["DSC_0002.NEF", TIFF[::-1].hex()]
    described = {"files": [NEF, second], "busy": 1}
    with toy.connected({}, described, clock=FastClock()) as camera:
        camera.configure(SETTINGS)
        assert camera.shoot().data == TIFF[::-1], "the first one has no known beginning"
        assert toy.log().count("trigger") == 2


def test_a_camera_that_is_busy_while_its_frame_is_awaited(toy: ToyBench) -> None:
    with toy.connected({}, {"files": [NEF], "busy_s": 0.1}, clock=FastClock()) as camera:
        camera.configure(SETTINGS)
        assert camera.shoot().data == bytes.fromhex(NEF[1])


class StoppedClock(SystemClock):
    """The clock of a process that is stopped for a second as it asks for the time."""

    readings_left = -1

    def now(self) -> float:
        self.readings_left -= 1
        if self.readings_left == 0:
            time.sleep(1.0)  # meanwhile libgphoto2 goes on
        return super().now()


def test_a_frame_is_there_after_a_stop_at_any_moment(toy: ToyBench) -> None:
    clock, moments = StoppedClock(), range(3, 17)
    described = {"files": [NEF] * len(moments), "busy_s": 0.25}
    with toy.connected({}, described, clock=clock, transfer_timeout="0.5 s") as camera:
        camera.configure(SETTINGS)
        for moment in moments:
            camera.arm()
            clock.readings_left = moment
            assert camera.shoot().data == bytes.fromhex(NEF[1])
            assert clock.readings_left < 0


@pytest.mark.campaign
def test_a_camera_that_stays_busy(toy: ToyBench) -> None:
    with toy.connected({}, {"files": [NEF] * 4, "busy": 3}, clock=FastClock()) as camera:
        camera.configure(SETTINGS)
        with pytest.raises(DeviceError, match=r"wait until its card lamp is off"):
            camera.shoot()
        camera.make_safe()
        assert camera.shoot().data == bytes.fromhex(NEF[1])


def test_live_view_is_switched_off_again(toy: ToyBench) -> None:
    viewfinder = {"viewfinder": ["0", "0", "1"]}
    with toy.connected(viewfinder, {"preview": JPEG.hex(), "files": [NEF]}) as camera:
        camera.make_safe()
        assert "viewfinder=0" not in toy.log(), "it was not on"
        for ending in (camera.make_safe, camera.arm):
            assert camera.preview() == JPEG
            ending()
            assert toy.log()[-1] == "viewfinder=0"


def test_a_camera_without_live_view(toy: ToyBench) -> None:
    with (
        toy.connected({}) as camera,
        pytest.raises(DeviceError, match="libgphoto2 cannot do this with this camera"),
    ):
        camera.preview()


def test_a_manual_lens(toy: ToyBench) -> None:
    with toy.connected({"f-number": []}, {"files": [NEF]}) as camera:
        assert camera.capabilities().f_numbers == ()
        wanted = ExposureSettings(1 / 64, 400)
        assert camera.configure(wanted) == wanted
        with pytest.raises(DeviceError, match="set it by hand and leave f_number out"):
            camera.configure(SETTINGS)


def test_a_button_that_the_camera_does_not_have(toy: ToyBench) -> None:
    with (
        pytest.raises(UsageError, match="write 'release: trigger'"),
        toy.connected({}, release="button"),
    ):
        pass


def test_a_camera_on_usb_is_found_by_its_place_on_the_bus(toy: ToyBench) -> None:
    context = SimpleNamespace(dispose=lambda device: None)
    on_bus = SimpleNamespace(bus=1, address=14, _ctx=context)
    toy.describe({}, {"models": {"usb:001,014": "Nikon DSC D7000 (PTP mode)"}})
    camera = Gphoto2Camera("usb://04b0:0428", Gphoto2Camera.Settings(), Loopback(usb=on_bus))
    camera.disconnect()
    assert toy.log()[:2] == ["port usb:001,014", "model Nikon DSC D7000 (PTP mode)"]
    on_bus.address = 15
    with pytest.raises(DeviceError, match="libgphoto2 knows no camera there"):
        Gphoto2Camera("usb://04b0:0428", Gphoto2Camera.Settings(), Loopback(usb=on_bus))


def test_a_simulated_rig_has_a_clock_of_its_own() -> None:
    for address in ("sim://room/camera", "ptpip://127.0.0.1:1"):
        with pytest.raises(UsageError, match="labrig sim camera"):
            Gphoto2Camera(address, Gphoto2Camera.Settings(), Loopback(VirtualClock()))


def test_the_extra_is_not_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(UsageError, match=r"pip install 'labrig\[gphoto2\]'"):
        Gphoto2Camera("usb://04b0:0428", Gphoto2Camera.Settings(), Loopback())


def test_planning_needs_neither_camera_nor_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    settings = Gphoto2Camera.Settings.model_validate({"isos": [1600, 100], "frame_time": "3 s"})
    capabilities = settings.planned_offers()
    assert capabilities.isos == (100, 1600)
    assert (capabilities.exposures_s[0], capabilities.exposures_s[-1]) == (1 / 8192, 32.0)
    assert capabilities.overhead_s == 3.0


def test_the_virtual_nikon_that_comes_with_libgphoto2(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Read by the real libgphoto2; it has no sensitivity to set."""
    spec = importlib.util.find_spec("gphoto2")
    assert spec is not None
    assert spec.origin is not None
    if not (Path(spec.origin).parent / "libgphoto2" / "vusb").is_dir():
        pytest.skip("this build of python-gphoto2 comes without the virtual camera")
    (tmp_path / "GP_0001.JPG").write_bytes(JPEG)
    monkeypatch.setenv("VCAMERADIR", str(tmp_path))
    context = SimpleNamespace(dispose=lambda device: None)
    on_bus = SimpleNamespace(bus=1, address=1, _ctx=context)
    with pytest.raises(DeviceError, match="cannot set the sensitivity"):
        Gphoto2Camera("usb://04b0:0437", Gphoto2Camera.Settings(), Loopback(usb=on_bus))
