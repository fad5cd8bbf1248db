"""The Numato driver against wire transcripts and against the emulated board."""

from typing import Any

import pytest
from hypothesis import given, strategies as st

from labrig.acquire import Lamp, load_driver
from labrig.drivers.serial_line import SerialLine
from labrig.foundation.clock import VirtualClock
from labrig.foundation.errors import DeviceError
from labrig.sim.boards import NumatoBoard
from tests.drivers.serial_wire import BoardPort, InterruptingClock, ScriptedPort, Wired

NumatoLamp: Any = load_driver("lamp", "numato", "rig.yaml")


def lamp(script: list[tuple[bytes, bytes]], relay: int = 0) -> tuple[Any, ScriptedPort]:
    clock = VirtualClock()
    port = ScriptedPort(clock, [(b"\r", b"\n\r>"), *script])
    settings = NumatoLamp.Settings(relay=relay)
    return NumatoLamp("COM3", settings, Wired(clock, port)), port


def test_on_and_off_are_read_back() -> None:
    driver, port = lamp(
        [
            (b"relay on A\r", b"relay on A\n\r>"),
            (b"relay read A\r", b"relay read A\n\ron\n\r>"),
            (b"relay off A\r", b"relay off A\n\r>"),
            (b"relay read A\r", b"relay read A\n\roff\n\r>"),
            (b"relay read A\r", b"relay read A\n\roff\n\r>"),
            (b"ver\r", b"ver\n\r00000008\n\r>"),
            (b"id get\r", b"id get\n\r12345678\n\r>"),
        ],
        relay=10,
    )
    assert isinstance(driver, Lamp)
    driver.on()
    driver.off()
    assert not driver.is_on()
    assert driver.identity() == "Numato relay board, firmware 00000008, id 12345678, relay 10"
    assert port.script == []


@pytest.mark.parametrize(
    ("script", "said"),
    [
        ([(b"relay on 0\r", b"relay on 0\n\r>"), (b"relay read 0\r", b"relay read 0\n\roff\n\r>")],
         "switched on but reads off"),
        ([(b"relay on 0\r", b"")], "did not answer within 1 s"),
        ([(b"relay on 0\r", b"\xff\xfe>")], "did not echo"),
        ([(b"relay on 0\r", b"relay on 0\n\rbad relay\n\r>")], "refused"),
        ([(b"relay on 0\r", b"relay on 0\n\r>"), (b"relay read 0\r", b"relay read 0\n\r>")],
         "expected 'on' or 'off', got ''"),
    ],
    ids=["welded", "silent", "babble", "error text", "no value"],
)  # fmt: skip
def test_anything_but_the_expected_answer_is_a_device_error(
    script: list[tuple[bytes, bytes]], said: str
) -> None:
    driver, _ = lamp(script)
    with pytest.raises(DeviceError) as caught:
        driver.on()
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


@given(st.integers(0, 60))
def test_an_interruption_at_any_wait_can_be_made_safe(waits: int) -> None:
    """A half-read echo must not spoil the command that switches the lamp off."""
    clock = InterruptingClock()
    moved: list[tuple[int, bool]] = []
    board = NumatoBoard(8, lambda relay, on: moved.append((relay, on)))
    driver = NumatoLamp("COM3", NumatoLamp.Settings(relay=0), Wired(clock, BoardPort(clock, board)))
    with clock.interrupted_after(waits):
        driver.on()
        driver.off()
        driver.on()
    driver.make_safe()
    assert not board.states[0]
    assert not driver.is_on()


@given(st.binary(max_size=40))
def test_the_board_answers_any_bytes(data: bytes) -> None:
    NumatoBoard(8, lambda relay, on: None).receive(data)


@given(st.binary(max_size=60))
def test_any_answer_is_understood_or_a_device_error(answer: bytes) -> None:
    driver, _ = lamp([(b"relay read 0\r", answer)])
    try:
        assert driver.is_on() in (True, False)
    except DeviceError as error:
        assert "\n" not in str(error)


def test_a_pulled_plug_is_a_device_error() -> None:
    class Gone(ScriptedPort):
        def write(self, data: bytes, /) -> int:
            raise OSError(5, "Input/output error")

    clock = VirtualClock()
    with pytest.raises(DeviceError, match="is gone"):
        SerialLine(Gone(clock, []), clock, "the board").write(b"x")
