"""A rig opened for real: pyserial on a terminal device whose other end is an emulated board."""

import os
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from labrig.acquire import read_rig_file
from labrig.bench import open_bench
from labrig.clock import SystemClock
from labrig.errors import DeviceError, UsageError
from labrig.sim.boards import NumatoBoard

pty = pytest.importorskip("pty", reason="Windows has no pseudo terminals")

RIG = """
name: half a bench
devices:
  lamp: {{driver: numato_relay, address: "{address}", relay: 3}}
"""


@pytest.fixture
def wired() -> Iterator[tuple[str, NumatoBoard]]:
    """A board on a terminal device, its relay 3 left on by somebody."""
    board = NumatoBoard(8, lambda relay, on: None)
    board.states[3] = True
    ours, theirs = pty.openpty()
    os.set_blocking(ours, True)

    def serve() -> None:
        while True:
            try:
                data = os.read(ours, 100)
                os.write(ours, board.receive(data))
            except OSError:
                return

    threading.Thread(target=serve, daemon=True).start()
    yield os.ttyname(theirs), board
    os.close(theirs)
    os.close(ours)


@pytest.fixture
def rig(tmp_path: Path) -> Callable[[str], Path]:
    def write(address: str) -> Path:
        path = tmp_path / "rig.yaml"
        path.write_text(RIG.format(address=address))
        return path

    return write


def test_the_real_driver_on_a_real_port_with_the_systems_clock(
    wired: tuple[str, NumatoBoard], rig: Callable[[str], Path]
) -> None:
    address, board = wired
    path = rig(address)
    with open_bench(read_rig_file(path), str(path)) as bench:
        assert isinstance(bench.clock, SystemClock)
        with bench.devices() as devices:
            assert not board.states[3], "off at connect"
            devices.lamp.on()
            assert board.states == [False, False, False, True, False, False, False, False]
            assert devices.lamp.is_on()
            assert "Numato" in devices.identities()["lamp"]
        assert not board.states[3], "off at the end"


def test_a_rig_in_use_is_refused(
    wired: tuple[str, NumatoBoard], rig: Callable[[str], Path]
) -> None:
    path = rig(wired[0])
    file = read_rig_file(path)
    with (
        open_bench(file, str(path)) as first,
        first.devices(),
        open_bench(file, str(path)) as second,
        pytest.raises(UsageError, match="held by another labrig"),
        second.devices(),
    ):
        pass


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


def test_a_driver_in_the_wrong_role(tmp_path: Path, wired: tuple[str, NumatoBoard]) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text(
        f"name: x\ndevices:\n  camera: {{driver: numato_relay, address: '{wired[0]}', relay: 1}}\n"
    )
    with (
        open_bench(read_rig_file(path), str(path)) as bench,
        pytest.raises(UsageError, match="is no camera"),
        bench.devices(),
    ):
        pass
