"""The drivers' bytes through pyserial and a terminal device, on the system's clock."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from labrig.acquire import DOOR, LAMP, read_rig_file
from labrig.bench import open_bench
from labrig.foundation.clock import VirtualClock
from labrig.sim.boards import ArduinoBoard, LcusBoard, MaestroBoard
from tests.drivers.serial_wire import Board
from tests.terminal import idle_guard, on_a_terminal

RIG = """
name: two boards
devices:
  lamp: {{driver: lcus, address: "{lcus}", relay: 2}}
  door: {{driver: maestro, address: "{maestro}", channel: 3, closed: 1000 us, open: 1877.5 us,
          travel: 20 ms}}
"""

COMMANDS_RIG = """
name: one board
devices:
  lamp: {{driver: serial_relay, address: "{address}", baud: 19200, framing: 8N2,
          on: {{send: on 0, answer: ok}}, off: {{send: off 0, answer: ok}}}}
"""


@pytest.fixture(autouse=True)
def unguarded(monkeypatch: pytest.MonkeyPatch) -> None:
    """No process of Python's is started for each bench; tests/test_guard.py has the real one."""
    monkeypatch.setattr("labrig.bench.guard._started", idle_guard)


@pytest.fixture
def open_ports() -> Iterator[Callable[[Board], str]]:
    with ExitStack() as stack:
        yield lambda board: stack.enter_context(on_a_terminal(board))


def test_lamp_and_door(open_ports: Callable[[Board], str], tmp_path: Path) -> None:
    lcus = LcusBoard(2, lambda relay, on: None, "text")
    maestro = MaestroBoard(VirtualClock(), {3: 1000e-6})
    maestro.start_at(3, 2000e-6)
    lcus.states[1] = True
    path = tmp_path / "rig.yaml"
    path.write_text(RIG.format(lcus=open_ports(lcus), maestro=open_ports(maestro)))
    with open_bench(read_rig_file(path), str(path)) as bench:
        with bench.devices() as rig:
            assert not lcus.states[1]
            rig[LAMP].on()
            assert rig[LAMP].is_on()
            rig[DOOR].swing(safe=False)
            assert "pulse 1877.50 µs" in rig.identities()["door"]
        assert not lcus.states[1]
    assert [pulse.width_s * 1e6 for pulse in maestro.pulses(3)] == pytest.approx(
        [2000, 1000, 1877.5, 1000]
    )


def test_line_settings_of_the_rig_file(open_ports: Callable[[Board], str], tmp_path: Path) -> None:
    termios = pytest.importorskip("termios", reason="Windows sets its ports in another way")
    address = open_ports(ArduinoBoard(1, lambda relay, on: None, VirtualClock()))
    path = tmp_path / "rig.yaml"
    path.write_text(COMMANDS_RIG.format(address=address))
    with open_bench(read_rig_file(path), str(path)) as bench, bench.devices() as rig:
        rig[LAMP].on()
        with Path(address).open("rb") as terminal:
            settings = termios.tcgetattr(terminal)
    assert settings[2] & termios.CSTOPB
    assert settings[5] == termios.B19200
