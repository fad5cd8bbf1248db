"""The drivers' bytes through pyserial and a terminal device, on the system's clock."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from labrig.acquire import DOOR, LAMP, read_rig_file
from labrig.bench import open_bench
from labrig.clock import VirtualClock
from labrig.sim.boards import LcusBoard, MaestroBoard
from tests.drivers.serial_wire import Board
from tests.terminal import on_a_terminal

RIG = """
name: two boards
devices:
  lamp: {{driver: lcus_relay, address: "{lcus}", relay: 2}}
  door: {{driver: maestro_door, address: "{maestro}", channel: 3, closed: 1000 us, open: 1877.5 us,
          travel: 20 ms}}
"""


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
            rig[DOOR].open()
            assert "pulse 1877.50 µs" in rig.identities()["door"]
        assert not lcus.states[1]
    assert [pulse.width_s * 1e6 for pulse in maestro.pulses(3)] == pytest.approx(
        [2000, 1000, 1877.5, 1000]
    )
