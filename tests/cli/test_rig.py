"""`labrig rig devices` and `labrig rig check` on the simulated rig, well and badly set."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from serial.tools.list_ports_common import ListPortInfo

from labrig.acquire import load_driver, read_rig_file
from labrig.drivers.ptp.camera import PtpCamera
from labrig.foundation import resources
from labrig.foundation.errors import DeviceError
from labrig.foundation.yaml_file import read_yaml, validate, yaml_text
from labrig.setup import Host
from tests.conftest import Ended
from tests.quick_yaml import read_quickly, write_quickly

NumatoLamp: Any = load_driver("lamp", "numato", "rig.yaml")
SerialLamp: Any = load_driver("lamp", "serial_relay", "rig.yaml")

Report = dict[str, Any]
Labrig = Callable[..., Ended]
Make = Callable[..., Path]


def device(report: Report, key: str) -> Report:
    (found,) = [entry for entry in report["devices"] if entry["key"] == key]
    assert isinstance(found, dict)
    return found


@pytest.mark.usefixtures("logged")
def test_a_good_rig_is_measured_and_fine(labrig: Labrig, make_rig: Make) -> None:
    ended = labrig("rig", "check", make_rig())
    assert (ended.code, ended.err) == (0, "")
    for said in ("Numato", "5D Mark II", "switch on, read back", "frame_time", "safe state"):
        assert said in ended.out
    assert "from the Numato board" in labrig("rig", "check", make_rig(), "--verbose").err


def test_its_numbers_are_the_simulated_devices_own(labrig: Labrig, make_rig: Make) -> None:
    report = json.loads(labrig("rig", "check", make_rig(), "--json").out)
    assert (report["failures"], report["refusals"], report["unsafe"]) == ([], [], None)
    camera = device(report, "camera")
    assert len(device(report, "lamp")["measured"]) == 2
    measured = {entry["what"]: entry["value"] for entry in camera["measured"]}
    lag = next(value for what, value in measured.items() if what.startswith("release asked"))
    assert float(lag.split()[0]) == pytest.approx(60, abs=3), "the rig file's, plus half a trip"
    ready = next(value for what, value in measured.items() if what.startswith("exposure over"))
    assert 200 < float(ready.split()[0]) < 400, "the body reads out for 200 ms"
    suggested = {entry["key"]: entry["value"] for entry in camera["suggestions"]}
    assert suggested["frame_time"] == "300 ms"
    assert suggested["frame_pixels"] == "[96, 64]"
    assert suggested["frame_size"] == "13 kB"
    assert sum("dark frame" in what for what in measured) == 3
    assert {finding["severity"] for finding in camera["findings"]} == {"fine"}


def test_a_board_whose_commands_are_in_the_rig_file(labrig: Labrig, tmp_path: Path) -> None:
    rig = read_yaml(resources.folder("config") / "sim-arduino.yaml")
    rig["simulation"]["sensor"] = {"width": 96, "height": 64}
    path = tmp_path / "rig.yaml"
    path.write_text(yaml_text(rig))
    report = json.loads(labrig("rig", "check", path, "--json").out)
    assert (report["failures"], report["refusals"], report["unsafe"]) == ([], [], None)
    assert device(report, "lamp")["identity"] == "serial relay, labrig relays 1"
    assert len(device(report, "lamp")["measured"]) == 2
    assert len(device(report, "leds")["measured"]) == 5
    rig["devices"]["leds"]["baud"] = 19200
    path.write_text(yaml_text(rig))
    ended = labrig("rig", "check", path)
    assert ended.code == 2
    (line,) = ended.err.splitlines()
    assert "one at 9600 baud, 8N1, the other at 19200 baud, 8N1; give both the same" in line


SPOILERS: dict[str, tuple[dict[str, object], str]] = {
    "long-exposure noise reduction": (
        {"long_exposure_noise_reduction": True},
        "C.Fn II (Image) → 1 Long exp. noise reduction → 0: Off",
    ),
    "highlight priority": (
        {"highlight_tone_priority": True},
        "C.Fn II (Image) → 3 Highlight tone priority → 0: Disable",
    ),
    "mirror lock-up": ({"mirror_lock_up": True}, "C.Fn III (Autofocus/Drive) → 6 Mirror lockup"),
    "autofocus": ({"autofocus": True}, "set the switch on the lens to MF"),
    "auto-off": ({"auto_power_off": "60 s"}, "Set-up 1 (yellow) → Auto power off → Off"),
    "auto-ISO": ({"iso": "auto"}, "ISO button above the display"),
    "ISO that is computed": ({"iso": 6400}, "ISO button above the display, one of 100, 200"),
    "ISO in between": ({"iso": 125}, "ISO button above the display, one of 100, 200"),
    "dial": ({"exposure_mode": "Av"}, "turn it to M"),
}


@pytest.mark.parametrize(("camera", "where"), SPOILERS.values(), ids=SPOILERS)
def test_what_spoils_photometry_is_refused_with_its_place_in_the_menu(
    labrig: Labrig, make_rig: Make, camera: dict[str, object], where: str
) -> None:
    ended = labrig("rig", "check", make_rig(camera=camera))
    assert ended.code == 2
    assert "not exercised" in ended.out
    (line,) = ended.err.splitlines()
    assert where in line


def test_a_run_is_refused_before_anything_moves(
    labrig: Labrig, make_rig: Make, make_protocol: Make, tmp_path: Path
) -> None:
    rig = make_rig(camera={"highlight_tone_priority": True})
    ended = labrig("run", make_protocol(), "--rig", rig, "--runs", tmp_path / "runs")
    assert ended.code == 2
    assert "C.Fn II (Image) → 3 Highlight tone priority" in ended.err
    assert "nothing was recorded" in ended.err
    assert list((tmp_path / "runs").iterdir()) == []


def test_a_warning_does_not_keep_a_run_from_starting(
    labrig: Labrig, make_rig: Make, make_protocol: Make, tmp_path: Path
) -> None:
    rig = make_rig()
    content = read_quickly(rig.read_text())
    content["devices"]["camera"]["isos"] = [100, 125, 400]
    rig.write_text(write_quickly(content))
    report = json.loads(labrig("rig", "check", rig, "--json").out)
    warned = [f for f in device(report, "camera")["findings"] if f["severity"] == "warn"]
    assert ["ISO 125, which is not native" in finding["what"] for finding in warned] == [True]
    ended = labrig(
        "run", make_protocol(), "--rig", rig, "--runs", tmp_path / "runs", "--no-process"
    )
    assert ended.code == 0, ended.err


def test_a_room_that_is_not_dark_is_reported(labrig: Labrig, make_rig: Make) -> None:
    rig = make_rig(sample="stickers", initial={"concentration": 0.9})
    report = json.loads(labrig("rig", "check", rig, "--json").out)
    (warned,) = [f for f in device(report, "camera")["findings"] if f["severity"] == "warn"]
    assert "not dark" in warned["what"]


def test_a_device_that_fails_is_shown_and_the_others_are_still_checked(
    labrig: Labrig, make_rig: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    lamp = NumatoLamp
    monkeypatch.setattr(lamp, "is_on", lambda self: False)
    ended = labrig("rig", "check", make_rig(), "--json")
    assert ended.code == 3
    assert "the lamp was switched on, it says otherwise" in ended.err
    report = json.loads(ended.out)
    assert len(device(report, "camera")["measured"]) > 3


def test_a_fault_in_a_driver_is_one_line_too(
    labrig: Labrig, make_rig: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    camera = PtpCamera

    def break_down(self: object) -> None:
        raise KeyError("oops")

    monkeypatch.setattr(camera, "shoot", break_down)
    ended = labrig("rig", "check", make_rig())
    assert ended.code == 3
    assert "camera: its driver failed (KeyError('oops'))" in ended.err
    assert "left in its safe state" in ended.out


def test_an_unsafe_end_is_shown_beside_what_was_found(
    labrig: Labrig, make_rig: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    numato = NumatoLamp
    made_safe: list[int] = []

    def fail_at_the_end(self: Any) -> None:
        made_safe.append(1)
        if len(made_safe) > 1:
            raise DeviceError("the relay is welded")

    monkeypatch.setattr(numato, "make_safe", fail_at_the_end)
    ended = labrig("rig", "check", make_rig(), "--json")
    assert ended.code == 3
    assert "the relay is welded" in ended.err
    assert "switch off by hand" in json.loads(ended.out)["unsafe"]


def test_a_device_that_is_not_there_is_one_line(
    labrig: Labrig, make_rig: Make, tmp_path: Path
) -> None:
    path = make_rig()
    rig = read_quickly(path.read_text())
    rig["devices"]["lamp"]["address"] = str(tmp_path / "ttyACM7")
    path.write_text(write_quickly(rig))
    ended = labrig("rig", "check", path)
    assert ended.code == 3
    assert len(ended.err.splitlines()) == 1


def test_a_rig_that_does_not_exist(labrig: Labrig) -> None:
    ended = labrig("rig", "check", "sin")
    assert ended.code == 2
    assert "did you mean 'sim'?" in ended.err


def test_listing_needs_no_device(labrig: Labrig) -> None:
    ended = labrig("rig", "devices")
    assert ended.code == 0
    assert "serial ports:" in ended.out
    found = json.loads(labrig("rig", "devices", "--json").out)
    assert set(found) == {"ports", "cameras", "spectrometers", "notes"}


def test_what_is_listed_is_a_rig_file(
    labrig: Labrig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ports = []
    for device, ids in {"COM3": (0x2341, 0x43), "COM4": (0x2A19, 0xC05), "COM5": (1, 2)}.items():
        port = ListPortInfo(device)
        port.vid, port.pid = ids
        ports.append(port)
    around = Host("linux", lambda: ports, tuple, tuple)
    monkeypatch.setattr(Host, "of_this_pc", lambda: around)
    out = labrig("rig", "devices").out
    path = tmp_path / "rig.yaml"
    path.write_text(out[out.index("name:") :])
    rig = read_rig_file(path)
    assert {key: entry.address for key, entry in rig.devices.items()} == {"lamp": "COM3"}
    validate(rig.devices["lamp"].settings(), SerialLamp.Settings, "listed")
    assert out.count("# lamp:") == 2


def with_viewfinder(path: Path, address: str) -> Path:
    rig = read_quickly(path.read_text(encoding="utf-8"))
    rig["devices"]["viewfinder"] = {"driver": "uvc_preview", "address": address}
    path.write_text(write_quickly(rig), encoding="utf-8")
    return path


def test_a_viewfinder_is_looked_through_once(
    labrig: Labrig, make_rig: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert cv2.imwrite(str(tmp_path / "film000.png"), np.full((48, 64, 3), 90, np.uint8))
    film, opened = str(tmp_path / "film%03d.png"), cv2.VideoCapture
    monkeypatch.setattr(cv2, "VideoCapture", lambda number: opened(film))
    ended = labrig("rig", "check", with_viewfinder(make_rig(), "uvc://0"), "--json")
    assert (ended.code, ended.err) == (0, "")
    viewfinder = device(json.loads(ended.out), "viewfinder")
    assert "for aiming only" in viewfinder["identity"]
    assert viewfinder["failure"] is None
    (picture, _) = viewfinder["measured"]
    assert picture["what"] == "live picture"
    assert picture["value"].startswith("64 x 48 pixels, ")


def test_a_viewfinder_that_shows_nothing_fails_and_the_camera_is_still_checked(
    labrig: Labrig, make_rig: Make
) -> None:
    ended = labrig("rig", "check", with_viewfinder(make_rig(), "uvc://97"), "--json")
    assert ended.code == 3
    (line,) = ended.err.splitlines()
    assert "viewfinder: cannot open uvc://97" in line
    report = json.loads(ended.out)
    assert device(report, "viewfinder")["measured"] == []
    assert len(device(report, "camera")["measured"]) > 3
