"""A rig opened for real: pyserial on a terminal device whose other end is an emulated board."""

import os
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import serial

from labrig.acquire import LAMP, read_rig_file
from labrig.bench import open_bench
from labrig.foundation.clock import SystemClock
from labrig.foundation.errors import DeviceError, UsageError
from labrig.sim.boards import NumatoBoard
from tests.terminal import idle_guard, on_a_terminal

RIG = """
name: half a bench
devices:
  lamp: {{driver: numato, address: "{address}", relay: 3}}
"""


class HearingBoard(NumatoBoard):
    """Knows how many bytes it was sent."""

    heard_bytes = 0

    def receive(self, data: bytes) -> bytes:
        self.heard_bytes += len(data)
        return super().receive(data)


@pytest.fixture(autouse=True)
def unguarded(monkeypatch: pytest.MonkeyPatch) -> None:
    """No process of Python's is started for each bench; tests/test_guard.py has the real one."""
    monkeypatch.setattr("labrig.bench.guard._started", idle_guard)


@pytest.fixture
def wired() -> Iterator[tuple[str, HearingBoard]]:
    """A board on a terminal device, its relay 3 left on by somebody."""
    board = HearingBoard(8, lambda relay, on: None)
    board.states[3] = True
    with on_a_terminal(board) as address:
        yield address, board


@pytest.fixture
def rig(tmp_path: Path) -> Callable[[str], Path]:
    def write(address: str) -> Path:
        path = tmp_path / "rig.yaml"
        path.write_text(RIG.format(address=address))
        return path

    return write


def test_the_real_driver_on_a_real_port_with_the_systems_clock(
    wired: tuple[str, HearingBoard], rig: Callable[[str], Path]
) -> None:
    address, board = wired
    path = rig(address)
    with open_bench(read_rig_file(path), str(path)) as bench:
        assert isinstance(bench.clock, SystemClock)
        with bench.devices() as devices:
            assert not board.states[3], "off at connect"
            devices[LAMP].on()
            assert board.states == [False, False, False, True, False, False, False, False]
            assert devices[LAMP].is_on()
            assert "Numato" in devices.identities()["lamp"]
        assert not board.states[3], "off at the end"


def test_a_rig_in_use_is_refused_by_every_name_and_not_touched(
    wired: tuple[str, HearingBoard],
    rig: Callable[[str], Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    address, board = wired
    path = rig(address)
    with open_bench(read_rig_file(path), str(path)) as first, first.devices() as devices:
        devices[LAMP].on()
        before = board.heard_bytes
        (tmp_path / "by-id").symlink_to(address)
        monkeypatch.setenv("TMPDIR", str(tmp_path))
        monkeypatch.setattr("tempfile.tempdir", None)
        for spelling in (address, str(tmp_path / "by-id"), os.path.relpath(address)):
            path = rig(spelling)
            with (
                open_bench(read_rig_file(path), str(path)) as second,
                pytest.raises(UsageError, match="held by another labrig"),
                second.devices(),
            ):
                pass
            assert board.heard_bytes == before, spelling
        assert devices[LAMP].is_on()


def test_a_program_that_knows_no_labrig_is_refused_too(
    wired: tuple[str, HearingBoard], rig: Callable[[str], Path]
) -> None:
    """At least if it asks for the port alone, as labrig does."""
    path = rig(wired[0])
    with open_bench(read_rig_file(path), str(path)) as bench:
        with bench.devices(), pytest.raises(serial.SerialException, match="lock"):
            serial.Serial(wired[0], exclusive=True)
        with (
            serial.Serial(wired[0], exclusive=True),
            pytest.raises(DeviceError, match="has it open"),
            bench.devices(),
        ):
            pass


def test_two_names_of_one_board_are_one_port(
    wired: tuple[str, HearingBoard], rig: Callable[[str], Path], tmp_path: Path
) -> None:
    address, _ = wired
    link = tmp_path / "by-id"
    link.symlink_to(address)
    path = rig(address)
    thermometer = f"  thermometer: {{driver: numato, address: '{link}'}}\n"
    path.write_text(path.read_text() + thermometer)
    with open_bench(read_rig_file(path), str(path)) as bench, bench.devices() as devices:
        assert set(devices.identities()) == {"lamp", "thermometer"}


@pytest.mark.parametrize("scheme", ["spy://loop://?file=", "SPY://loop://?file=", "alt:///dev/"])
def test_pyserials_own_addresses_are_refused_before_it_sees_them(
    rig: Callable[[str], Path], tmp_path: Path, scheme: str
) -> None:
    mine = tmp_path / "mine.txt"
    mine.write_text("kept")
    path = rig(f"{scheme}{mine}")
    with (
        pytest.raises(UsageError, match="no serial port"),
        open_bench(read_rig_file(path), str(path)) as bench,
        bench.devices(),
    ):
        pass
    assert mine.read_text() == "kept"


def test_a_port_that_is_not_there(rig: Callable[[str], Path], tmp_path: Path) -> None:
    path = rig(str(tmp_path / "ttyACM9"))
    with (
        open_bench(read_rig_file(path), str(path)) as bench,
        pytest.raises(DeviceError, match="ttyACM9"),
        bench.devices(),
    ):
        pass


@pytest.mark.parametrize("address", ["usb://04a9", "ptp://127.0.0.1", "usb://zz:11", "COM3"])
def test_what_is_no_usb_address(tmp_path: Path, address: str) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text(f"name: x\ndevices:\n  camera: {{driver: ptp_camera, address: '{address}'}}\n")
    with (
        open_bench(read_rig_file(path), str(path)) as bench,
        pytest.raises(UsageError, match="no USB address"),
        bench.devices(),
    ):
        pass


def test_a_driver_in_the_wrong_role(tmp_path: Path, wired: tuple[str, HearingBoard]) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text(
        f"name: x\ndevices:\n  camera: {{driver: numato, address: '{wired[0]}', relay: 1}}\n"
    )
    with (
        open_bench(read_rig_file(path), str(path)) as bench,
        pytest.raises(UsageError, match="is no camera"),
        bench.devices(),
    ):
        pass
