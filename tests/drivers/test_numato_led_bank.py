"""LEDs behind a Numato board: wire transcripts, and never two lit, whatever happens."""

from typing import Any

import pytest
from hypothesis import given, settings, strategies as st
from pydantic import ValidationError

from labrig.acquire import LightBank, load_driver
from labrig.foundation.clock import VirtualClock
from labrig.foundation.errors import DeviceError
from labrig.sim.boards import NumatoBoard
from tests.drivers.serial_wire import BoardPort, InterruptingClock, Script, ScriptedPort, Wired

NumatoLeds: Any = load_driver("leds", "numato", "rig.yaml")
NumatoLamp: Any = load_driver("lamp", "numato", "rig.yaml")

OPENED = (b"\r", b"\n\r>")
RELAYS = {"450 nm": 1, "525 nm": 2, "far red": 10}


def switched(state: str, relay: str, reads: str | None = None) -> Script:
    """A relay that is switched and read back."""
    said = f"relay {state} {relay}"
    return [(f"{said}\r".encode(), f"{said}\n\r>".encode()), *read(relay, reads or state)]


def read(relay: str, state: str) -> Script:
    said = f"relay read {relay}"
    return [(f"{said}\r".encode(), f"{said}\n\r{state}\n\r>".encode())]


ALL_OFF = [*switched("off", "1"), *switched("off", "2"), *switched("off", "A")]


def bank(script: Script) -> tuple[Any, ScriptedPort]:
    clock = VirtualClock()
    port = ScriptedPort(clock, [OPENED, *script])
    driver = NumatoLeds(
        "COM3", NumatoLeds.Settings.model_validate({"channels": RELAYS}), Wired(clock, port)
    )
    return driver, port


def on_a_board(clock: VirtualClock, board: NumatoBoard) -> Any:
    wired = Wired(clock, BoardPort(clock, board))
    return NumatoLeds("COM3", NumatoLeds.Settings(channels={"a": 1, "b": 2, "c": 3}), wired)


def test_one_is_off_and_read_back_before_the_next_is_on() -> None:
    driver, port = bank(
        [
            *ALL_OFF,
            *switched("on", "1"),
            *switched("off", "1"),
            *switched("on", "A"),
            *read("1", "off"), *read("2", "off"), *read("A", "on"),
            *switched("off", "A"),
            *read("1", "off"), *read("2", "off"), *read("A", "off"),
            (b"ver\r", b"ver\n\r00000008\n\r>"), (b"id get\r", b"id get\n\r12345678\n\r>"),
        ]
    )  # fmt: skip
    assert isinstance(driver, LightBank)
    assert driver.channels() == tuple(RELAYS)
    assert driver.reads_back()
    driver.dark()
    driver.light("450 nm")
    driver.light("far red")
    assert driver.channel_on() == "far red"
    driver.dark()
    assert driver.channel_on() is None
    assert driver.identity() == (
        "Numato relay board, firmware 00000008, id 12345678, LEDs 450 nm on relay 1, 525 nm on "
        "relay 2, far red on relay 10"
    )
    assert port.script == []


def test_one_that_does_not_go_off_keeps_the_next_from_being_lit() -> None:
    stuck = [*ALL_OFF, *switched("on", "1"), *switched("off", "1", reads="on"), OPENED]
    driver, port = bank(stuck)
    driver.light("450 nm")
    with pytest.raises(DeviceError, match=r"relay 1 .* was switched off but reads on"):
        driver.light("525 nm")
    assert port.script == []


def test_one_that_is_stuck_does_not_keep_the_others_from_going_off() -> None:
    driver, port = bank(
        [OPENED, *switched("off", "1", reads="on"), OPENED, *switched("off", "2"),
         *switched("off", "A")]
    )  # fmt: skip
    with pytest.raises(DeviceError, match=r"relay 1 .* reads on"):
        driver.make_safe()
    assert port.script == []


def test_two_that_are_lit_at_once_are_an_error() -> None:
    driver, _ = bank([*read("1", "on"), *read("2", "off"), *read("A", "on")])
    with pytest.raises(DeviceError, match="450 nm and far red are lit at once"):
        driver.channel_on()


@pytest.mark.parametrize(
    ("answer", "said"),
    [(b"", "did not answer within 1 s"), (b"relay read 1\n\r>", "expected 'on' or 'off', got ''")],
    ids=["silent", "no value"],
)
def test_anything_but_the_expected_answer_is_a_device_error(answer: bytes, said: str) -> None:
    driver, _ = bank([(b"relay read 1\r", answer)])
    with pytest.raises(DeviceError) as caught:
        driver.channel_on()
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


@settings(max_examples=40)
@given(
    st.lists(st.sampled_from(["a", "b", "c", None]), max_size=6), st.integers(1, 200), st.booleans()
)
def test_two_are_never_lit_and_after_any_interruption_it_can_be_made_safe(
    sequence: list[str | None], waits: int, left_on: bool
) -> None:
    clock = InterruptingClock()
    lit_at_once: list[int] = []
    board = NumatoBoard(8, lambda relay, on: lit_at_once.append(sum(board.states[1:4])))
    board.states[2] = left_on
    driver = on_a_board(clock, board)
    with clock.interrupted_after(waits):
        for channel in sequence:
            if channel is None:
                driver.dark()
            else:
                driver.light(channel)
            assert driver.channel_on() == channel
    assert max(lit_at_once, default=0) <= 1
    driver.make_safe()
    assert not any(board.states)
    assert driver.channel_on() is None


def test_lamp_and_leds_share_a_line() -> None:
    clock = VirtualClock()
    board = NumatoBoard(8, lambda relay, on: None)
    wired = Wired(clock, BoardPort(clock, board))
    lamp = NumatoLamp("COM3", NumatoLamp.Settings(relay=0), wired)
    leds = NumatoLeds("COM3", NumatoLeds.Settings(channels={"a": 1, "b": 2}), wired)
    lamp.on()
    leds.light("b")
    leds.make_safe()
    assert lamp.is_on()
    assert board.states == [True, *[False] * 7]


@pytest.mark.parametrize(
    "keys", [{}, {"relays": {}}, {"relays": {"a": 1, "b": 1}}, {"relays": {"a": 32}}, {"relay": 1},
             {"relays": {"": 1}}],
)  # fmt: skip
def test_each_led_has_a_name_and_a_relay_of_its_own(keys: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        NumatoLeds.Settings.model_validate(keys)
