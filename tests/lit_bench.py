"""A lamp that burns on a real bench: labrig, a relay board in another process, and a terminal.

`labrig run hold` lights the lamp and waits; the board says when its relay moves. Here are the
protocol, the board and what starts both.
"""

import json
import os
import pty
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from serial.tools import list_ports
from serial.tools.list_ports_common import ListPortInfo

from labrig.acquire import LAMP_OFF, LAMP_ON, ProtocolModel, Session, Unit
from labrig.drivers.numato import Numato
from labrig.sim.boards import NumatoBoard
from tests.quick_yaml import write_quickly

ROOT = Path(__file__).parent.parent
RELAY = 3
PATIENCE_S = 60.0
ENTRY_POINTS = """
[labrig.measurements]
hold = tests.hold_registration:HOLD
[labrig.drivers]
listed_relay = tests.lit_bench:ListedBoard
"""
#: Names the file with the serial ports that a PC has, for `listed_relay`.
PORTS_FILE = "LABRIG_TEST_PORTS"


class Hold(ProtocolModel):
    """Lamp on, for long, and off.

    Attributes
    ----------
    eats_bytes
        Memory that is asked for a second after the lamp has been switched on.
    """

    hold_s: float = 600.0
    eats_bytes: int = 0

    def units(self) -> Sequence[Unit]:
        return [HoldUnit(self.hold_s, self.eats_bytes)]


@dataclass(frozen=True)
class HoldUnit:
    hold_s: float
    eats_bytes: int
    name: str = "hold"

    def run(self, session: Session) -> None:
        session.perform(LAMP_ON)
        session.wait(1.0, "charging")
        bytearray(self.eats_bytes)
        session.wait(self.hold_s, "charging")
        session.perform(LAMP_OFF)


class ListedBoard(Numato):
    """A Numato board on a PC whose USB is what a file says: terminals are not on the USB."""


def _listed_ports() -> list[ListPortInfo]:
    listed = []
    for device, serial_number in json.loads(
        Path(os.environ[PORTS_FILE]).read_text(encoding="utf-8")
    ).items():
        port = ListPortInfo(device)
        port.vid, port.pid, port.location = 0x2A19, 0x0C01, "1-1"
        port.serial_number = serial_number
        listed.append(port)
    return listed


if PORTS_FILE in os.environ:
    setattr(list_ports, "comports", _listed_ports)  # noqa: B010


class Stubborn:
    """A board that at first does not do what it is told, once its lamp has burnt.

    Parameters
    ----------
    for_s
        From when it is first told to switch off.
    answers
        `?` to everything; `on` to questions; nothing at all; or `!` before what it answers.
    """

    def __init__(self, board: NumatoBoard, for_s: float, answers: str) -> None:
        self._board = board
        self._for_s = for_s
        self._answers = answers
        self._told_s: float | None = None

    def receive(self, data: bytes) -> bytes:
        now_s = time.monotonic()
        if self._told_s is None and self._board.states[RELAY] and b"off" in data:
            self._told_s = now_s
        if self._told_s is None or now_s > self._told_s + self._for_s:
            return self._board.receive(data)
        match self._answers:
            case "?":
                return b"?\n\r>"
            case "on":
                return self._board.receive(data.replace(b"off", b"on "))
            case "!":
                return b"!" + self._board.receive(data)
        return b""


class BoardProcess:
    """A Numato board on a terminal, in a process of its own; it tells when its lamp moves.

    Parameters
    ----------
    late_s
        By which each answer is late.
    stubborn
        How the board is made stubborn, if it is.
    """

    def __init__(
        self, late_s: float = 0.0, stubborn: Callable[[NumatoBoard], Stubborn] | None = None
    ) -> None:
        self._told, tells = os.pipe()
        hears, self._orders = os.pipe()
        self.pid = os.fork()
        if self.pid == 0:
            try:
                _serve(tells, hears, late_s, stubborn)
            finally:
                os._exit(0)
        os.close(tells)
        os.close(hears)
        self.address = os.read(self._told, 64).decode().strip()

    def wait_for(self, on: bool, within_s: float) -> float | None:
        """When the lamp went on or off, on the monotonic clock; None if it does not."""
        deadline_s = time.monotonic() + within_s
        while (left_s := deadline_s - time.monotonic()) > 0:
            if not select.select([self._told], [], [], left_s)[0]:
                return None
            state, at_s = os.read(self._told, 64).decode().splitlines()[-1].split()
            if (state == "on") == on:
                return float(at_s)
        return None

    def plug_in_again(self) -> None:
        """Pull its cable and put it back: the terminal is another one. It has its own power."""
        os.write(self._orders, b"!")
        self.address = os.read(self._told, 64).decode().strip()

    def end(self) -> None:
        """Take it away."""
        os.kill(self.pid, signal.SIGKILL)
        os.waitpid(self.pid, 0)
        os.close(self._told)
        os.close(self._orders)


def _serve(
    tells: int,
    hears: int,
    late_s: float,
    stubborn: Callable[[NumatoBoard], Stubborn] | None,
) -> None:
    def moved(relay: int, on: bool) -> None:
        if relay == RELAY:
            os.write(tells, f"{'on' if on else 'off'} {time.monotonic()}\n".encode())

    board = NumatoBoard(8, moved)
    receive = board.receive if stubborn is None else stubborn(board).receive
    ours, theirs = pty.openpty()
    while True:
        os.write(tells, f"{os.ttyname(theirs)}\n".encode())
        while True:
            ready = select.select([ours, hears], [], [])[0]
            if hears in ready:
                os.read(hears, 1)
                break
            answer = receive(os.read(ours, 100))
            time.sleep(late_s)
            os.write(ours, answer)
        before, (ours, theirs) = (ours, theirs), pty.openpty()  # so that its name is another one
        for descriptor in before:
            os.close(descriptor)


@dataclass
class LitBench:
    """A folder with rig, protocol and runs, and the board."""

    folder: Path
    board: BoardProcess
    environment: dict[str, str]

    @property
    def command(self) -> list[str]:
        return [
            *(sys.executable, "-m", "labrig", "run", str(self.folder / "hold.yaml")),
            *("--rig", str(self.folder / "rig.yaml"), "--runs", str(self.folder / "runs")),
            "--no-process",
        ]

    def list_port(self) -> Path:
        """Say in a file on which port the board is."""
        path = self.folder / "ports.json"
        path.write_text(json.dumps({self.board.address: "00000001"}))
        return path

    def plug_in_again(self) -> None:
        """Pull the board's cable and put it back: it gets another name."""
        self.board.plug_in_again()
        self.list_port()

    def start(self, **keys: Any) -> "subprocess.Popen[str]":
        """labrig, as soon as the lamp is on; `keys` are Popen's."""
        process = subprocess.Popen(
            self.command,
            env=self.environment,
            stdout=subprocess.DEVNULL,
            text=True,
            **{"stderr": subprocess.PIPE, **keys},
        )
        if self.board.wait_for(True, PATIENCE_S) is None:
            process.kill()
            raise AssertionError(f"the lamp does not light: {process.communicate()}")
        return process


@contextmanager
def lit_bench(
    folder: Path, board: BoardProcess, driver: str = "numato", **protocol: Any
) -> Iterator[LitBench]:
    """All that a run of `hold` with that board needs, in `folder`."""
    info = folder / "path" / "hold-1.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: hold\nVersion: 1\n")
    (info / "entry_points.txt").write_text(ENTRY_POINTS)
    lamp = {"driver": driver, "address": board.address, "relay": RELAY}
    (folder / "rig.yaml").write_text(write_quickly({"name": "lamp", "devices": {"lamp": lamp}}))
    (folder / "hold.yaml").write_text(write_quickly({"protocol": "hold", **protocol}))
    path = os.pathsep.join((str(info.parent), str(ROOT)))
    try:
        bench = LitBench(folder, board, os.environ | {"PYTHONPATH": path})
        bench.environment[PORTS_FILE] = str(bench.list_port())
        yield bench
    finally:
        wait_for_guards(folder)
        board.end()


def wait_for_guards(folder: Path) -> None:
    """Wait until the guards have ended whose labrigs have `folder` in their environment.

    A guard whose board is taken away while it reads back goes on trying, by a name that the system
    gives to the next terminal.
    """
    deadline = time.monotonic() + PATIENCE_S
    while _has_guard(folder) and time.monotonic() < deadline:
        time.sleep(0.02)


def _has_guard(folder: Path) -> bool:
    """Whether such a guard runs; it has the environment of its labrig."""
    for process in started_with(b"labrig.bench.guard_process"):
        with suppress(OSError):
            if bytes(folder) in (process / "environ").read_bytes():
                return True
    return False


def started_with(*words: bytes) -> Iterator[Path]:
    """Folders in /proc of the processes whose command line has all of these words."""
    for process in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):  # it has ended
            line = (process / "cmdline").read_bytes()
            if all(word in line for word in words):
                yield process
