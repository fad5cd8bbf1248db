"""The guard: the lamp goes off when labrig cannot switch it off itself, and only then."""

import os
import queue
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import serial

from labrig.acquire import LAMP, read_rig_file
from labrig.acquire.readback import LightReadback
from labrig.bench import Bench, guard as guard_module, guard_process, open_bench
from labrig.bench.guard import ALL_OFF, MAY_BE_ON, Guard, guarding
from labrig.foundation.errors import DeviceError
from labrig.record import read_run

pytest.importorskip("pty", reason="Windows has no pseudo terminals")

from tests.lit_bench import RELAY, BoardProcess, lit_bench
from tests.terminal import idle_guard

OFF_WITHIN_S = 20.0
RIG = "name: lamp\ndevices:\n  lamp: {{driver: numato, address: '{address}', relay: {relay}}}\n"

#: The Numato board by the driver that knows no board.
COMMANDS_RIG = r"""
name: lamp
devices:
  lamp:
    driver: serial_relay
    address: '{address}'
    line_end: '\r'
    answer_end: '>'
    on: {{send: relay on {relay}, answer: relay on {relay}}}
    off: {{send: relay off {relay}, answer: relay off {relay}}}
    state:
      send: relay read {relay}
      on: relay read {relay} on
      off: relay read {relay} off
"""


@pytest.fixture
def board() -> Iterator[BoardProcess]:
    board = BoardProcess()
    yield board
    board.end()


@pytest.fixture
def rig(tmp_path: Path) -> Callable[[str], Path]:
    def write(address: str) -> Path:
        path = tmp_path / "rig.yaml"
        path.write_text(RIG.format(address=address, relay=RELAY))
        return path

    return write


def test_ctrl_z_stops_it_safely_and_after_kill_9_the_guard_switches_off(tmp_path: Path) -> None:
    with lit_bench(tmp_path, BoardProcess()) as bench:
        process = bench.start()
        process.send_signal(signal.SIGTSTP)
        assert bench.board.wait_for(False, OFF_WITHIN_S), "safe first"
        os.waitid(os.P_PID, process.pid, os.WSTOPPED | os.WNOWAIT)
        process.send_signal(signal.SIGCONT)
        assert bench.board.wait_for(True, OFF_WITHIN_S), "the unit is done again"
        process.kill()
        assert bench.board.wait_for(False, OFF_WITHIN_S)
        process.communicate()
        (run,) = (tmp_path / "runs").iterdir()
        record = read_run(run)
    assert [attempt.exit_status for attempt in record.attempts] == ["abort", None]
    assert "Ctrl-Z" in record.attempts[0].reason
    assert "a process of its own" in record.attempts[0].start["guard"]


def test_after_kill_9_the_guard_sends_the_commands_of_the_rig_file(tmp_path: Path) -> None:
    with lit_bench(tmp_path, BoardProcess()) as bench:
        path = tmp_path / "rig.yaml"
        path.write_text(COMMANDS_RIG.format(address=bench.board.address, relay=RELAY))
        process = bench.start()
        process.kill()
        assert bench.board.wait_for(False, OFF_WITHIN_S)
        process.communicate()


def heard(tmp_path: Path, said: bytes) -> bool:
    """Whether a guard that has heard this, and then nothing more, takes it that a light is on."""
    path = tmp_path / "said"
    path.write_bytes(said)
    with path.open("rb") as source:
        return guard_process.labrig_is_gone(source, 0)


@pytest.mark.parametrize(
    ("said", "on"),
    [
        (b"", False),
        (MAY_BE_ON, True),
        (MAY_BE_ON + ALL_OFF, False),
        (b"+-+", True),
        (b"++-", False),
    ],
)
def test_what_was_reported_last_counts(tmp_path: Path, said: bytes, on: bool) -> None:
    assert heard(tmp_path, said) is on


def test_silence_ends_what_hangs_but_only_while_a_light_may_be_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    killed: list[int] = []
    monkeypatch.setattr(guard_process, "HEARTBEAT_INTERVAL_S", 0.01)
    monkeypatch.setattr(guard_process, "HANG_TIMEOUT_S", 0.1)
    monkeypatch.setattr(guard_process, "_kill", killed.append)
    hears, says = os.pipe()
    with os.fdopen(hears, "rb", buffering=0) as source, os.fdopen(says, "wb", buffering=0) as pipe:
        answers: queue.Queue[bool] = queue.Queue()

        def wait() -> None:
            answers.put(guard_process.labrig_is_gone(source, 4711))

        import threading

        waiting = threading.Thread(target=wait)
        waiting.start()
        pipe.write(ALL_OFF)
        time.sleep(0.3)
        assert answers.empty()
        pipe.write(MAY_BE_ON)
        assert answers.get(timeout=OFF_WITHIN_S)
        waiting.join()
    assert killed == [4711]


def test_without_a_guard_no_light_is_lit(
    rig: Callable[[str], Path], board: BoardProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = rig(board.address)
    monkeypatch.setattr(sys, "executable", "/bin/false")
    with open_bench(read_rig_file(path), str(path)) as bench:
        with pytest.raises(DeviceError, match="cannot start"), bench.devices():
            pytest.fail("it was opened")
        assert "\n" not in bench.guarded_by
    monkeypatch.setattr(sys, "executable", "/nowhere/python")
    with (
        open_bench(read_rig_file(path), str(path)) as bench,
        pytest.raises(DeviceError, match="No such file"),
        bench.devices(),
    ):
        pass


@pytest.fixture
def stand_ins(monkeypatch: pytest.MonkeyPatch) -> list["subprocess.Popen[bytes]"]:
    """All that were started in place of a guard; they do nothing."""
    started: list[subprocess.Popen[bytes]] = []

    def start(order: object) -> "subprocess.Popen[bytes]":
        started.append(idle_guard(order))
        return started[-1]

    monkeypatch.setattr(guard_module, "_started", start)
    monkeypatch.setattr(guard_module, "HEARTBEAT_INTERVAL_S", 0.01)
    return started


def test_a_guard_that_somebody_killed_is_replaced(
    rig: Callable[[str], Path], stand_ins: list["subprocess.Popen[bytes]"]
) -> None:
    with guarding(read_rig_file(rig("COM3")), "rig.yaml") as guard:
        assert guard is not None
        assert stand_ins == [], "none is needed yet"
        guard.watch()
        stand_ins[0].kill()
        deadline_s = time.monotonic() + OFF_WITHIN_S
        while len(stand_ins) < 2 and time.monotonic() < deadline_s:
            time.sleep(0.01)
        guard.stand_down()
    assert len(stand_ins) == 2
    assert stand_ins[1].wait() == 0


def test_lamp_and_leds_of_one_board_are_all_switched_off(
    rig: Callable[[str], Path], board: BoardProcess
) -> None:
    """Each is opened by itself; they wait for one another's port."""
    path = rig(board.address)
    bank = f"{{driver: numato, address: '{board.address}', channels: {{a: {RELAY}, b: 6}}}}"
    path.write_text(path.read_text().replace(f"relay: {RELAY}", "relay: 5") + f"  leds: {bank}\n")
    with serial.Serial(board.address) as port:
        port.write(f"relay on {RELAY}\r".encode())
        assert board.wait_for(True, OFF_WITHIN_S)
    file = read_rig_file(path)
    with guarding(file, str(path)) as guard:
        assert guard is not None
        assert guard.lights == {"lamp", "leds"}
    guard_process.Lights(file, str(path)).switch_off()
    assert board.wait_for(False, OFF_WITHIN_S)


def test_a_rig_without_lights_has_no_guard(tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text(
        "name: x\ndevices:\n  camera: {driver: ptp_camera, address: 'usb://04a9:3199'}\n"
    )
    with open_bench(read_rig_file(path), str(path)) as bench:
        assert bench.guard is None
        assert bench.guarded_by.startswith("nothing")


@pytest.fixture
def told(monkeypatch: pytest.MonkeyPatch) -> list[bytes]:
    """All that a guard is told."""
    told: list[bytes] = []
    tell = Guard._tell

    def noted(self: Guard, state: bytes) -> None:
        told.append(state)
        tell(self, state)

    monkeypatch.setattr(Guard, "_tell", noted)
    return told


def test_it_may_go_only_when_all_lights_are_known_to_be_off(
    rig: Callable[[str], Path],
    board: BoardProcess,
    stand_ins: list["subprocess.Popen[bytes]"],
    told: list[bytes],
) -> None:
    path = rig(board.address)
    with open_bench(read_rig_file(path), str(path)) as bench:
        with bench.devices() as devices:
            devices[LAMP].on()
        assert told == [MAY_BE_ON, ALL_OFF]
        with pytest.raises(DeviceError, match="its guard goes on trying for 5 min"):
            _lose_the_board(bench, board)
        assert told == [MAY_BE_ON, ALL_OFF, MAY_BE_ON, MAY_BE_ON]
        with pytest.raises(DeviceError, match="cannot open"), bench.devices():
            pass
        assert told[3:] == [MAY_BE_ON], "it may still burn"
    stand_ins[-1].wait()


def test_in_the_dark_of_a_run_it_is_released_until_the_lamp_cannot_be_made_safe(
    rig: Callable[[str], Path],
    board: BoardProcess,
    stand_ins: list["subprocess.Popen[bytes]"],
    told: list[bytes],
) -> None:
    path = rig(board.address)

    def lose_the_board_in_the_dark() -> None:
        with open_bench(read_rig_file(path), str(path)) as bench, bench.devices() as devices:
            LightReadback(devices)
            assert told == [MAY_BE_ON, ALL_OFF]
            board.plug_in_again()

    with pytest.raises(DeviceError, match="its guard goes on trying for 5 min"):
        lose_the_board_in_the_dark()
    assert told == [MAY_BE_ON, ALL_OFF, MAY_BE_ON]
    stand_ins[-1].wait()


def test_a_board_that_never_answered_is_left_alone(
    rig: Callable[[str], Path], told: list[bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nobody has lit its lamp, and the next labrig needs the port."""
    monkeypatch.setattr("labrig.acquire.rig.PATIENCE_S", 0.1)
    ends = os.openpty()
    path = rig(os.ttyname(ends[1]))
    with (
        open_bench(read_rig_file(path), str(path)) as bench,
        pytest.raises(DeviceError, match=r"not confirmed; switch off by hand: .*address$"),
        bench.devices(),
    ):
        pass
    for end in ends:
        os.close(end)
    assert told == []


def _lose_the_board(bench: Bench, board: BoardProcess) -> None:
    with bench.devices() as devices:
        devices[LAMP].on()
        board.plug_in_again()
