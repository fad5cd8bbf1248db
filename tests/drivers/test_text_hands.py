"""Hands that obey lines of text, against transcripts and against the simulated room's."""

import pytest
from hypothesis import given, strategies as st

from labrig.acquire import Hands
from labrig.clock import VirtualClock
from labrig.drivers.text_hands import TextHands
from labrig.errors import DeviceError, DeviceLostError
from labrig.sim.boards import HandsBoard
from tests.drivers.serial_wire import BoardPort, Script, ScriptedPort, Wired


def hands(script: Script) -> tuple[TextHands, ScriptedPort]:
    clock = VirtualClock()
    port = ScriptedPort(clock, script)
    return TextHands("COM7", TextHands.Settings(), Wired(clock, port)), port


def test_a_line_there_and_a_line_back() -> None:
    driver, port = hands([(b"filter 37\n", b"done\r\n"), (b"\n", b"")])
    assert isinstance(driver, Hands)
    assert driver.identity() == "hands at COM7"
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
    driver, _ = hands([(b"filter 37\n", answer)])
    with pytest.raises(error) as refusal:
        driver.do("filter 37")
    assert said in str(refusal.value)


def test_the_simulated_rooms_hands() -> None:
    clock = VirtualClock()
    did: list[str] = []
    board = HandsBoard({"fresh sample": lambda: did.append("fresh sample")})
    driver = TextHands("COM7", TextHands.Settings(), Wired(clock, BoardPort(clock, board)))
    board.receive(b"half a li")
    driver.make_safe()
    driver.do("fresh sample")
    assert did == ["fresh sample"]
    with pytest.raises(DeviceError, match="cannot filter 3; known: fresh sample"):
        driver.do("filter 3")


@given(st.binary(max_size=40))
def test_the_board_answers_any_bytes(data: bytes) -> None:
    HandsBoard({}).receive(data)
