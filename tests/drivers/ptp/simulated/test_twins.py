"""Two cameras of one model on one bus, told apart by what they say of themselves in PTP."""

import os
from collections.abc import Callable, Iterable, Iterator
from itertools import chain
from pathlib import Path
from typing import Any

import pytest
import usb.core
import usb.util

from labrig.acquire import CAMERA, ExposureSettings, read_rig_file
from labrig.bench import open_bench
from labrig.drivers.ptp import PtpCamera
from labrig.foundation.clock import VirtualClock
from labrig.foundation.errors import DeviceError, UsageError
from labrig.sim.camera import BodySettings, SimulatedCamera
from tests.counterparts.served import EOS, STANDARD, Film
from tests.drivers.ptp.simulated.wired import Wired

SETTINGS = ExposureSettings(0.125, 400, 4.0)
BUSES = 2
EOS_IDS, STANDARD_IDS = "04a9:3199", "1209:0001"


class Twins:
    """Cameras with the serial numbers 0111 and 0222, and what each has taken."""

    def __init__(self, body: BodySettings) -> None:
        self.clock = VirtualClock()
        self.films = {serial: Film(size=3000) for serial in ("0111", "0222")}
        self.cameras = {
            serial: SimulatedCamera(self.clock, film, serial=serial, seed=1, body=body)
            for serial, film in self.films.items()
        }

    def find(self, backend: Any = None, **wanted: Any) -> Any:
        """As `usb.core.find`, where it is not told on which bus to look."""
        if backend is not None:
            return pyusb_find(backend=backend, **wanted)
        return chain.from_iterable(
            _on_bus(number, pyusb_find(backend=camera.backend, **wanted))
            for number, camera in enumerate(self.cameras.values(), start=1)
        )


def _on_bus(number: int, devices: Iterable[Any]) -> Iterator[Any]:
    for device in devices:
        # A bus of this process's own: the lock of a camera is by its place, for the whole PC.
        device.bus = BUSES * os.getpid() + number
        yield device


pyusb_find = usb.core.find


@pytest.fixture
def plug_in(monkeypatch: pytest.MonkeyPatch) -> Callable[[BodySettings], Twins]:
    def plug(body: BodySettings) -> Twins:
        twins = Twins(body)
        monkeypatch.setattr(usb.core, "find", twins.find)
        # The bench has the cameras' clock: nobody waits for exposures.
        monkeypatch.setattr("labrig.bench.opening.SystemClock", lambda: twins.clock)
        return twins

    return plug


@pytest.fixture
def rig(tmp_path: Path) -> Callable[..., Path]:
    """Writes a rig with a camera at each address."""

    def write(address: str) -> Path:
        path = tmp_path / "rig.yaml"
        entry = f"{{driver: ptp_camera, address: '{address}'}}"
        path.write_text(f"name: twins\ndevices:\n  camera: {entry}\n")
        return path

    return write


def photograph(path: Path) -> bytes:
    with open_bench(read_rig_file(path), str(path)) as bench, bench.devices() as devices:
        devices[CAMERA].configure(SETTINGS)
        return devices[CAMERA].shoot().data


@pytest.mark.parametrize("ending", ["0222", "222"])
@pytest.mark.parametrize(("body", "ids"), [(EOS, EOS_IDS), (STANDARD, STANDARD_IDS)])
def test_the_one_that_is_meant_photographs(
    plug_in: Callable[[BodySettings], Twins],
    rig: Callable[..., Path],
    body: BodySettings,
    ids: str,
    ending: str,
) -> None:
    twins = plug_in(body)
    path = rig(f"usb://{ids}/{ending}")
    with open_bench(read_rig_file(path), str(path)) as bench, bench.devices() as devices:
        other, _ = twins.find(find_all=True)
        usb.util.claim_interface(other, 0)  # the other one is free
        usb.util.dispose_resources(other)
        devices[CAMERA].configure(SETTINGS)
        data = devices[CAMERA].shoot().data
    assert twins.films["0222"].delivered == [data]
    assert twins.films["0111"].taken == []


def test_a_serial_number_that_is_not_there_is_reported_with_those_that_are(
    plug_in: Callable[[BodySettings], Twins], rig: Callable[..., Path]
) -> None:
    plug_in(EOS)
    with pytest.raises(DeviceError, match=r"serial number 0333; .* there are 0111, 0222$"):
        photograph(rig(f"usb://{EOS_IDS}/0333"))


def test_a_twin_that_somebody_else_uses_is_passed_over(
    plug_in: Callable[[BodySettings], Twins], rig: Callable[..., Path]
) -> None:
    twins = plug_in(EOS)
    first, _ = twins.find(find_all=True)
    usb.util.claim_interface(first, 0)
    assert photograph(rig(f"usb://{EOS_IDS}/0222")) == twins.films["0222"].delivered[0]
    with pytest.raises(DeviceError, match="another program holds it"):
        photograph(rig(f"usb://{EOS_IDS}/0111"))
    usb.util.dispose_resources(first)
    assert photograph(rig(f"usb://{EOS_IDS}/0111")) == twins.films["0111"].delivered[0]


@pytest.mark.parametrize("serial", ["", "/0111"])
def test_one_that_another_labrig_has_is_not_even_asked(
    plug_in: Callable[[BodySettings], Twins], rig: Callable[..., Path], serial: str
) -> None:
    twins = plug_in(EOS)
    path = rig(f"usb://{EOS_IDS}/0111")
    with open_bench(read_rig_file(path), str(path)) as bench, bench.devices() as devices:
        with pytest.raises(UsageError, match="held by another labrig"):
            photograph(rig(f"usb://{EOS_IDS}{serial}"))
        assert photograph(rig(f"usb://{EOS_IDS}/0222")) == twins.films["0222"].delivered[0]
        devices[CAMERA].configure(SETTINGS)
        assert devices[CAMERA].shoot().data == twins.films["0111"].delivered[0]


def test_one_whose_program_died_is_asked_and_then_taken_over(
    plug_in: Callable[[BodySettings], Twins], rig: Callable[..., Path]
) -> None:
    twins = plug_in(EOS)
    wired = Wired(twins.clock, twins.cameras["0222"])
    camera = PtpCamera("usb://x", PtpCamera.Settings(), wired)
    camera.configure(SETTINGS)
    camera.arm()
    twins.cameras["0222"].lose_host()
    for serial in ("0111", "0222"):
        data = photograph(rig(f"usb://{EOS_IDS}/{serial}"))
        assert twins.films[serial].delivered == [data]


def test_without_a_serial_number_the_first_is_taken(
    plug_in: Callable[[BodySettings], Twins], rig: Callable[..., Path]
) -> None:
    twins = plug_in(EOS)
    assert photograph(rig(f"usb://{EOS_IDS}")) == twins.films["0111"].delivered[0]
