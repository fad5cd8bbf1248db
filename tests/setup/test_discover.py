"""What is plugged in, on PCs that are made up: no test needs a device, libusb or a desktop."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import usb.core

from labrig.acquire import Program, linux_programs, load_driver
from labrig.acquire.rig_file import DeviceEntry
from labrig.drivers.ptp import PtpCamera
from labrig.foundation import plugins
from labrig.foundation.clock import VirtualClock
from labrig.foundation.yaml_file import parse_yaml, validate
from labrig.setup import Host, discover
from labrig.sim import open_room
from labrig.sim.camera import SimulatedCamera
from tests.quick_yaml import read_quickly

DRIVERS = ("numato", "ptp_camera")


@dataclass
class Plugged:
    device: str
    description: str = "n/a"
    vid: int | None = None
    pid: int | None = None
    serial_number: str | None = None


class NoFilm:
    def photograph(self, start_s: float, exposure_s: float, iso: int, f_number: float) -> bytes:
        raise AssertionError("listing takes no photographs")

    def preview(self, at_s: float) -> Any:
        raise AssertionError("listing looks through no viewfinder")


def cameras(count: int = 1) -> list[Any]:
    """Simulated cameras, each on a bus of its own."""
    made = [
        SimulatedCamera(VirtualClock(), NoFilm(), serial=str(number), seed=1)
        for number in range(count)
    ]
    return [usb.core.find(backend=camera.backend) for camera in made]


def pc(
    ports: Iterable[Plugged] = (),
    usb_devices: Iterable[Any] = (),
    processes: Iterable[Program] = (),
    platform: str = "linux",
) -> Host:
    return Host(platform, lambda: ports, lambda: usb_devices, lambda: processes)


def no_libusb() -> Iterable[Any]:
    raise usb.core.NoBackendError("No backend available")


def test_a_spectrometer_is_listed_with_its_line_and_its_extra() -> None:
    with open_room({"sample": "blue-paint"}, "rig.yaml") as room:
        device = usb.core.find(backend=room.spectrometer)
        found = discover(pc(usb_devices=[device, *cameras()]), plugins.names(plugins.DRIVERS))
    (spectrometer,) = found.spectrometers
    assert len(found.cameras) == 1
    entry = parse_yaml(spectrometer.snippet, "snippet")["spectrometer"]
    assert entry == {"driver": "seabreeze_spectrometer", "address": "usb://2457:101e"}
    assert "pip install 'labrig[seabreeze]'" in spectrometer.hints[-1]


def test_nothing_is_plugged_in() -> None:
    found = discover(pc(), DRIVERS)
    assert (found.ports, found.cameras, found.notes) == ((), (), ())


def test_without_libusb_serial_ports_are_still_listed() -> None:
    found = discover(Host("win32", lambda: [Plugged("COM3")], no_libusb, tuple), DRIVERS)
    assert [port.address for port in found.ports] == ["COM3"]
    assert "libusb is not installed" in found.notes[0]


@pytest.mark.parametrize(
    ("port", "name", "has_driver"),
    [
        (
            Plugged("COM4", "USB", 0x2A19, 0x0C05, "NLRL1"),
            "Numato relay board (2a19:0c05, se",
            True,
        ),
        (Plugged("COM5", "USB", 0x1A86, 0x7523), "CH340", False),
        (Plugged("COM6", "USB", 0x1FFB, 0x008A), "Pololu", False),
        (Plugged("COM7", "FT232R", 0x0403, 0x6001), "FTDI", False),
        (Plugged("COM8", "Gadget", 0x1234, 0x5678), "Gadget (1234:5678), unknown", False),
        (Plugged("COM1"), "not on USB", False),
    ],
    ids=lambda value: value.device if isinstance(value, Plugged) else None,
)
def test_serial_ports_are_reported_by_their_usb_numbers(
    port: Plugged, name: str, has_driver: bool
) -> None:
    (found,) = discover(pc([port]), DRIVERS).ports
    assert found.address == port.device
    assert name in found.name
    assert bool(found.snippet) == has_driver


@pytest.mark.parametrize(
    ("ids", "driver", "role", "hint"),
    [
        ((0x1A86, 0x7523), "lcus", "lamp", "only if it is an LCUS board"),
        ((0x1FFB, 0x0089), "maestro", "door", "usually the lower one"),
        ((0x1FFB, 0x008C), "maestro", "door", "USB Dual Port"),
        ((0x2341, 0x0043), "serial_relay", "lamp", "commands of the sketch"),
        ((0x1313, 0x8066), "thorlabs_dc4100", "leds", "the output to which it is connected"),
        ((0x0403, 0x6001), "serial_relay", "lamp", "write its own commands"),
        ((0x04D8, 0xFFEE), "serial_relay", "lamp", "never acknowledges"),
        ((0x1234, 0x5678), "serial_relay", "lamp", "write its own commands"),
    ],
    ids=[
        "LCUS",
        "Maestro Micro 6",
        "Maestro Mini 24",
        "Arduino",
        "Thorlabs",
        "FTDI",
        "Devantech",
        "unknown",
    ],
)
def test_a_board_has_the_line_of_its_driver(
    ids: tuple[int, int], driver: str, role: str, hint: str
) -> None:
    (found,) = discover(pc([Plugged("COM5", "USB", *ids)]), [driver]).ports
    line = parse_yaml(found.snippet, "a test")
    assert (line[role]["driver"], line[role]["address"]) == (driver, "COM5")
    assert hint in found.hints[0]
    settings = {key: line[role][key] for key in line[role] if key not in DeviceEntry.model_fields}
    load_driver(role, driver, "a test").Settings.model_validate(settings)


def test_snippets_are_yaml_that_names_driver_and_address() -> None:
    found = discover(pc([Plugged("COM4", "USB", 0x2A19, 0x0C05)], cameras()), DRIVERS)
    devices = read_quickly("\n".join(d.snippet for d in (*found.ports, *found.cameras)))
    assert devices["lamp"] == {
        "driver": "numato", "address": "COM4", "relay": 0, "warm_up": "15 min",
    }  # fmt: skip
    assert devices["camera"]["driver"] == "ptp_camera"
    assert devices["camera"]["address"] == "usb://04a9:3199"


def test_a_driver_that_is_not_installed_gives_no_snippet() -> None:
    (found,) = discover(pc([Plugged("COM4", "USB", 0x2A19, 0x0C05)]), ()).ports
    assert found.snippet == ""


def test_a_camera_is_named_and_left_free() -> None:
    (device,) = cameras()
    (found,) = discover(pc(usb_devices=[device]), DRIVERS).cameras
    assert found.name == "Canon Inc. Canon Digital Camera"
    (hint,) = found.hints
    assert "shutter_lag" in hint
    line = parse_yaml(found.snippet, "a test")
    camera = validate(line["camera"], DeviceEntry, "a test")
    assert validate(camera.settings(), PtpCamera.Settings, "a test").shutter_lag > 0
    usb.util.claim_interface(device, 0)


@pytest.mark.parametrize(
    ("vendor", "platform", "driver"),
    [
        (0x04A9, "linux", "ptp_camera"),
        (0x04B0, "win32", "ptp_camera"),
        (0x054C, "linux", "gphoto2_camera"),
        (0x04CB, "darwin", "gphoto2_camera"),
        (0x04CB, "win32", None),
    ],
    ids=["Canon", "Nikon", "Sony", "Fujifilm", "Fujifilm on Windows"],
)
def test_a_makers_own_commands_are_left_to_libgphoto2(
    vendor: int, platform: str, driver: str | None
) -> None:
    (device,) = cameras()
    device.idVendor = vendor
    around = pc(usb_devices=[device], platform=platform)
    (found,) = discover(around, (*DRIVERS, "gphoto2_camera")).cameras
    camera = read_quickly(found.snippet)["camera"] if found.snippet else {}
    assert camera.get("driver") == driver
    assert any("labrig[gphoto2]" in hint for hint in found.hints) == (driver != "ptp_camera")


def test_twins_without_serial_numbers_cannot_be_distinguished() -> None:
    found = discover(pc(usb_devices=cameras(2)), DRIVERS)
    assert all("append /SERIAL" in camera.hints[0] for camera in found.cameras)


@pytest.mark.parametrize(
    ("platform", "process", "remedy"),
    [
        ("linux", Program(7, "gvfsd-gphoto2"), "gio mount -s gphoto2"),
        ("linux", Program(7, "gvfs-gphoto2-volume-monitor"), "systemctl --user mask"),
        ("linux", Program(7, "odd", frozenset({"/dev/bus/usb/001/001"})), "close it"),
        ("darwin", Program(7, "ptpcamerad"), "killall ptpcamerad"),
        ("darwin", Program(7, "PTPCamera"), "killall PTPCamera"),
    ],
    ids=lambda value: value.name if isinstance(value, Program) else None,
)
def test_what_may_hold_the_camera_and_how_to_free_it(
    platform: str, process: Program, remedy: str
) -> None:
    around = pc(usb_devices=cameras(), processes=[Program(1, "init"), process], platform=platform)
    (found,) = discover(around, DRIVERS).cameras
    hint, _ = found.hints
    assert process.name in hint
    assert "7" in hint
    assert remedy in hint


@pytest.mark.parametrize(
    ("platform", "remedy"), [("win32", "Zadig"), ("linux", "udev"), ("darwin", "plug it in")]
)
def test_a_camera_that_cannot_be_opened(
    platform: str, remedy: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    (device,) = cameras()

    def refuse(dev: int) -> Any:
        raise usb.core.USBError("Access denied (insufficient permissions)", -3, 13)

    monkeypatch.setattr(device._ctx.backend, "open_device", refuse)
    (found,) = discover(pc(usb_devices=[device], platform=platform), DRIVERS).cameras
    assert "Access denied" in found.hints[0]
    assert remedy in found.hints[0]
    assert found.address == "usb://04a9:3199"


def test_other_usb_devices_are_no_cameras() -> None:
    class Mouse:
        idVendor = 0x046D  # noqa: N815, as pyusb calls it

        def __iter__(self) -> Any:
            raise usb.core.USBError("Entity not found", -5, 2)

    assert discover(pc(usb_devices=[Mouse()]), DRIVERS).cameras == ()


def test_programs_are_read_from_proc(tmp_path: Path) -> None:
    place = tmp_path / "42"
    (place / "fd").mkdir(parents=True)
    (place / "cmdline").write_bytes(b"/usr/libexec/gvfsd-gphoto2\0--spawner\0")
    try:
        (place / "fd" / "7").symlink_to("/dev/bus/usb/001/004")
    except OSError:
        pytest.skip("this user may not make links")
    (tmp_path / "43").mkdir()
    assert list(linux_programs(tmp_path)) == [
        Program(42, "gvfsd-gphoto2", frozenset({"/dev/bus/usb/001/004"}))
    ]


def test_this_pc_can_be_looked_at() -> None:
    found = discover(Host.of_this_pc(), DRIVERS)
    assert all(device.address for device in (*found.ports, *found.cameras))
