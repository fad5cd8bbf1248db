"""A changer that obeys lines of text, against transcripts and against the simulated room's."""

import pytest
from hypothesis import given, strategies as st

from labrig.acquire import Changer
from labrig.drivers.text_changer import TextChanger
from labrig.foundation.clock import VirtualClock
from labrig.foundation.errors import DeviceError, DeviceLostError
from labrig.sim.boards import ChangerBoard
from tests.drivers.serial_wire import BoardPort, Script, ScriptedPort, Wired


def changer(script: Script) -> tuple[TextChanger, ScriptedPort]:
    clock = VirtualClock()
    port = ScriptedPort(clock, script)
    return TextChanger("COM7", TextChanger.Settings(), Wired(clock, port)), port


def test_a_line_there_and_a_line_back() -> None:
    driver, port = changer([(b"filter 37\n", b"done\r\n"), (b"\n", b"")])
    assert isinstance(driver, Changer)
    assert driver.identity() == "changer at COM7"
    driver.do("filter 37")
    driver.make_safe()
    assert port.script == []


@pytest.mark.parametrize(
    ("answer", "error", "said"),
    [
        (b"cannot reach it\n", DeviceError, "expected 'done', got 'cannot reach it'; do it"),
        (b"\xff\n", DeviceError, "expected 'done'"),
        (b"", DeviceLostError, "did not answer within 120 s"),
    ],
)
def test_what_they_cannot_do(answer: bytes, error: type[DeviceError], said: str) -> None:
    driver, _ = changer([(b"filter 37\n", answer)])
    with pytest.raises(error) as refusal:
        driver.do("filter 37")
    assert said in str(refusal.value)


def test_the_simulated_rooms_changer() -> None:
    clock = VirtualClock()
    did: list[str] = []
    board = ChangerBoard({"fresh sample": lambda: did.append("fresh sample")})
    driver = TextChanger("COM7", TextChanger.Settings(), Wired(clock, BoardPort(clock, board)))
    board.receive(b"half a li")
    driver.make_safe()
    driver.do("fresh sample")
    assert did == ["fresh sample"]
    with pytest.raises(DeviceError, match="cannot filter 3; known: fresh sample"):
        driver.do("filter 3")


@given(st.binary(max_size=40))
def test_the_board_answers_any_bytes(data: bytes) -> None:
    ChangerBoard({}).receive(data)
