"""Serial lines that are not in order: answers that come late, bytes that nobody sent."""

from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given, strategies as st

from labrig.acquire import load_driver
from labrig.drivers.text_changer import TextChanger
from labrig.foundation.clock import VirtualClock
from labrig.foundation.errors import UnclearAnswerError
from labrig.foundation.yaml_file import validate
from labrig.sim.boards import ArduinoBoard, ChangerBoard, LcusBoard, MaestroBoard, NumatoBoard
from tests.drivers.serial_wire import Board, BoardPort, InterruptingClock, Wired

LcusLamp: Any = load_driver("lamp", "lcus", "rig.yaml")
MaestroDoor: Any = load_driver("door", "maestro", "rig.yaml")
NumatoLamp: Any = load_driver("lamp", "numato", "rig.yaml")
SerialLamp: Any = load_driver("lamp", "serial_relay", "rig.yaml")

LATE_S = 0.06
SKETCH = {
    "on": {"send": "on 0", "answer": "ok"},
    "off": {"send": "off 0", "answer": "ok"},
    "state": {"send": "state 0", "on": "on", "off": "off"},
}
DOOR = {"channel": 0, "closed": "1000 us", "open": "1500 us", "travel": "20 ms"}


def numato(clock: VirtualClock, late_s: float) -> tuple[Any, NumatoBoard]:
    board = NumatoBoard(8, lambda relay, on: None)
    wired = Wired(clock, BoardPort(clock, board, late_s))
    return NumatoLamp("COM3", NumatoLamp.Settings(relay=0), wired), board


def lcus(clock: VirtualClock, late_s: float) -> tuple[Any, LcusBoard]:
    board = LcusBoard(2, lambda relay, on: None, "text")
    wired = Wired(clock, BoardPort(clock, board, late_s))
    return LcusLamp("COM5", LcusLamp.Settings(relay=1), wired), board


def arduino(clock: VirtualClock, late_s: float) -> tuple[Any, ArduinoBoard]:
    board = ArduinoBoard(2, lambda relay, on: None, clock)
    settings = validate(SKETCH, SerialLamp.Settings, "rig.yaml")
    return SerialLamp("COM7", settings, Wired(clock, BoardPort(clock, board, late_s))), board


Make = Callable[[VirtualClock, float], tuple[Any, NumatoBoard]]


@pytest.mark.parametrize("make", [numato, lcus, arduino])
def test_a_relay_board_that_answers_late_is_usable(
    make: Make,
) -> None:
    driver, board = make(VirtualClock(), LATE_S)
    driver.make_safe()
    for state in (True, False, True):
        (driver.on if state else driver.off)()
        assert driver.is_on() == state == board.states[0]
    assert "relay" in driver.identity()
    driver.make_safe()
    assert not board.states[0]


def test_a_servo_board_that_answers_late_is_usable() -> None:
    clock = VirtualClock()
    board = MaestroBoard(clock, {0: 1000e-6})
    settings = validate(DOOR, MaestroDoor.Settings, "rig.yaml")
    door = MaestroDoor("COM6", settings, Wired(clock, BoardPort(clock, board, LATE_S)))
    door.make_safe()
    door.swing(safe=False)
    door.make_safe()
    assert [round(pulse.width_s * 1e6) for pulse in board.pulses(0)] == [1000, 1500, 1000]


@pytest.mark.parametrize("make", [numato, lcus, arduino])
@given(waits=st.integers(0, 120))
def test_interrupted_while_answers_are_on_their_way_it_is_made_safe(make: Make, waits: int) -> None:
    clock = InterruptingClock()
    driver, board = make(clock, LATE_S)
    with clock.interrupted_after(waits):
        driver.on()
        driver.is_on()
        driver.off()
        driver.on()
    driver.make_safe()
    assert not board.states[0]
    assert not driver.is_on()


class Straying:
    """A board on whose line bytes turn up before an answer, once."""

    def __init__(self, board: Board) -> None:
        self._board = board
        self.stray = b""

    def receive(self, data: bytes) -> bytes:
        stray, self.stray = self.stray, b""
        return stray + self._board.receive(data)


STRAY = [b"!", b">", b"\0", b"\xff", b"!on\n\r>", b"CH1: ON \r\n"]


@given(st.sampled_from([*STRAY, b"on\n\r>"]))
def test_stray_bytes_are_an_unclear_answer_and_the_next_one_is_clear(stray: bytes) -> None:
    clock = VirtualClock()
    board = Straying(NumatoBoard(8, lambda relay, on: None))
    wired = Wired(clock, BoardPort(clock, board))
    require_clear_after(stray, board, NumatoLamp("COM3", NumatoLamp.Settings(relay=0), wired))


@given(st.sampled_from(STRAY))
def test_stray_bytes_before_the_answers_of_the_rig_file(stray: bytes) -> None:
    clock = VirtualClock()
    board = Straying(ArduinoBoard(2, lambda relay, on: None, clock))
    settings = validate(SKETCH, SerialLamp.Settings, "rig.yaml")
    relay = SerialLamp("COM3", settings, Wired(clock, BoardPort(clock, board)))
    require_clear_after(stray, board, relay)


def require_clear_after(stray: bytes, board: Straying, relay: Any) -> None:
    for act in (relay.on, relay.off, relay.is_on):
        board.stray = stray
        with pytest.raises(UnclearAnswerError):
            act()
        relay.make_safe()
        assert not relay.is_on()


def test_lines_that_a_board_sends_of_its_own_accord_are_no_answers() -> None:
    clock = VirtualClock()
    board = ArduinoBoard(2, lambda relay, on: None, clock)
    port = BoardPort(clock, board)
    relay = SerialLamp("COM3", validate(SKETCH, SerialLamp.Settings, "x"), Wired(clock, port))
    for act, on in ((relay.on, True), (relay.off, False)):
        port.write(b"version\nalive\n")
        clock.sleep(1.0)
        act()
        assert relay.is_on() == board.states[0] == on


def test_hands_that_babble_are_asked_again_and_hands_that_cannot_are_not() -> None:
    clock = VirtualClock()
    board = Straying(ChangerBoard({"fresh sample": lambda: None}))
    changer = TextChanger("COM7", TextChanger.Settings(), Wired(clock, BoardPort(clock, board)))
    board.stray = b"\xff"
    with pytest.raises(UnclearAnswerError):
        changer.do("fresh sample")
    changer.make_safe()
    changer.do("fresh sample")
