"""Cables and disks that fail as real ones do."""

import errno
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO, cast

import pytest
import serial

from labrig.foundation.clock import VirtualClock
from labrig.foundation.output_file import REAL_DISK
from labrig.sim import OpenRoom, open_room
from labrig.sim.faults import AfterBytes, Slowness
from labrig.sim.pc import SimulatedDisk


@contextmanager
def room(*faults: Any) -> Iterator[OpenRoom]:
    content = {"sample": "bottle", "sensor": {"width": 96, "height": 64}, "faults": list(faults)}
    with open_room(content, "rig.yaml") as opened:
        yield opened


def port() -> Any:
    return serial.serial_for_url("sim://room/relays", timeout=0)


def answer(opened: OpenRoom, line: Any, command: bytes) -> bytes:
    line.write(command)
    opened.clock.spend(0.1)
    return bytes(line.read(99))


def test_a_port_that_was_pulled_fails_as_linux_says_and_stays_dead() -> None:
    with room({"relays_unplugged": {"at": "10 s", "for": "5 s"}}) as opened:
        line = port()
        assert answer(opened, line, b"ver\r") == b"ver\n\r00000008\n\r>"
        opened.clock.spend(10.0)
        uses: list[Callable[[], Any]] = [
            lambda: line.write(b"x"),
            lambda: line.read(1),
            lambda: line.in_waiting,
        ]
        for use in uses:
            with pytest.raises(OSError, match="Errno 5"):
                use()
        with pytest.raises(serial.SerialException, match="No such file") as missing:
            port()
        assert missing.value.errno == errno.ENOENT
        opened.clock.spend(10.0)
        with pytest.raises(serial.SerialException, match="write failed"):
            line.write(b"x")
        assert answer(opened, port(), b"ver\r").endswith(b">")


def test_a_silent_board_neither_hears_nor_answers() -> None:
    with room({"relays_silent": {"at": "10 s", "for": "5 s"}}) as opened:
        line = port()
        opened.clock.spend(10.0)
        assert answer(opened, line, b"relay on 0\r") == b""
        assert not opened.room.lamp_on
        opened.clock.spend(5.0)
        assert answer(opened, line, b"relay read 0\r") == b"relay read 0\n\roff\n\r>"


def test_a_board_whose_echo_is_lost_obeys() -> None:
    with room("relays_echo_lost") as opened:
        assert answer(opened, port(), b"relay on 0\r") == b"\n\r>"
        assert opened.room.lamp_on


@pytest.fixture
def write(tmp_path: Path) -> Callable[..., int]:
    """Writes so many bytes to a disk; how many of them are in the file."""

    def to(disk: SimulatedDisk, count: int) -> int:
        path = tmp_path / "file"
        with path.open("wb", buffering=0) as file:
            try:
                disk.write(file, bytes(count))
            except OSError as error:
                assert error.errno == errno.ENOSPC
        return path.stat().st_size

    return to


def test_a_disk_fills_up_in_the_middle_of_a_write_until_room_is_made(
    write: Callable[..., int],
) -> None:
    clock = VirtualClock()
    full = AfterBytes.model_validate({"after_bytes": 250, "for": "10 s"})
    disk = SimulatedDisk(REAL_DISK, clock, [full], [])
    assert [write(disk, 100) for _ in range(4)] == [100, 100, 50, 0]
    clock.spend(10.0)
    assert write(disk, 100) == 100


def test_a_cut_write_is_no_whole_one_when_the_disk_below_is_full(tmp_path: Path) -> None:
    class FullFile:
        """A file of a disk that takes 60 bytes more, as the system reports it."""

        def __init__(self) -> None:
            self.left = 60

        def write(self, data: bytes) -> int:
            if not self.left:
                raise OSError(errno.ENOSPC, "full")
            taken = min(len(data), self.left)
            self.left -= taken
            return taken

    disk = SimulatedDisk(REAL_DISK, VirtualClock(), [], [])
    with pytest.raises(OSError, match="full"):
        disk.write(cast("BinaryIO", FullFile()), bytes(100))


def test_the_cable_of_one_board_is_pulled() -> None:
    with room({"board_unplugged": {"board": "servo", "at": "10 s", "for": "5 s"}}) as opened:
        relays = opened.boards["relays"]
        plugged = []
        for _ in range(3):
            plugged.append((opened.boards["servo"].is_plugged, relays.is_plugged))
            opened.clock.spend(10.0)
        assert plugged == [(True, True), (False, True), (True, True)]


def test_a_slow_disk_takes_its_time(write: Callable[..., int]) -> None:
    clock = VirtualClock()
    slow = Slowness.model_validate({"takes": "2 s", "for": "3 s"})
    disk = SimulatedDisk(REAL_DISK, clock, [], [slow])
    for expected_s in (2.0, 4.0, 4.0):
        assert write(disk, 100) == 100
        assert clock.now() == expected_s
