"""The thermometer on a Numato board: wire transcripts, what is wrong with it, and a shared line."""

from contextlib import suppress
from typing import Any

import pytest
from hypothesis import given, settings, strategies as st

from labrig.acquire import Thermometer, load_driver
from labrig.drivers.numato import CONVERSIONS, PLAUSIBLE_C
from labrig.foundation.clock import Interrupted, VirtualClock
from labrig.foundation.errors import DeviceError
from labrig.sim.boards import NumatoBoard
from tests.drivers.serial_wire import BoardPort, InterruptingClock, Script, ScriptedPort, Wired

NumatoLamp: Any = load_driver("lamp", "numato", "rig.yaml")
NumatoThermometer: Any = load_driver("thermometer", "numato", "rig.yaml")

OPENED = (b"\r", b"\n\r>")


def read(step: int, number: int = 0) -> tuple[bytes, bytes]:
    """One conversion on the wire."""
    command = f"adc read {number}"
    return f"{command}\r".encode(), f"{command}\n\r{step:04d}\n\r>".encode()


def thermometer(script: Script, **keys: float) -> tuple[Any, ScriptedPort]:
    clock = VirtualClock()
    port = ScriptedPort(clock, [OPENED, *script])
    settings = NumatoThermometer.Settings.model_validate(keys)
    return NumatoThermometer("COM3", settings, Wired(clock, port)), port


def test_the_mean_of_many_conversions_is_finer_than_a_step() -> None:
    steps = [147, 148] * (CONVERSIONS // 2)
    driver, port = thermometer(
        [*map(read, steps), (b"ver\r", b"ver\n\r00000008\n\r>"), (b"id get\r", b"id get\n\r7\n\r>")]
    )
    assert isinstance(driver, Thermometer)
    assert driver.celsius() == pytest.approx((147.5 / 1023 * 5 - 0.5) * 100)
    assert driver.identity() == "Numato relay board, firmware 00000008, id 7, analogue input 0"
    assert port.script == []


def test_an_lm35_on_another_input_of_a_board_with_3_3_volts_and_12_bits() -> None:
    driver, _ = thermometer(
        [read(261, 3)] * CONVERSIONS,
        input=3, volts_at_zero=0, reference_volts=3.3, bits=12,
    )  # fmt: skip
    assert driver.celsius() == pytest.approx(261 / 4095 * 330)


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        (b"", "did not answer within 1 s"),
        (b"\xff\xfe>", "did not echo"),
        (b"adc read 0\n\r>", "expected a number from 0 to 1023, got ''"),
        (b"adc read 0\n\rwhat\n\r>", "got 'what'"),
        (b"adc read 0\n\r-147\n\r>", "got '-147'"),
        (b"adc read 0\n\r4000\n\r>", "as many 'bits'"),
        (b"adc read 0\n\r1023\n\r>", "reads 1023, the end of its range"),
        (b"adc read 0\n\r0000\n\r>", "reads 0, the beginning of its range"),
        (b"adc read 0\n\r0043\n\r>", "would be -29.0 °C"),
        (b"adc read 0\n\r0300\n\r>", "would be 96.6 °C"),
    ],
    ids=["silent", "babble", "no value", "word", "negative", "too large", "open", "short", "LM35",
         "not a room"],
)  # fmt: skip
def test_what_is_no_temperature_is_a_device_error(answer: bytes, said: str) -> None:
    once = (b"adc read 0\r", answer)
    complete = answer.endswith(b"0043\n\r>") or answer.endswith(b"0300\n\r>")
    driver, port = thermometer([*[once] * (CONVERSIONS if complete else 1), OPENED])
    with pytest.raises(DeviceError) as caught:
        driver.celsius()
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
    assert port.script == [], "the line was brought back into step"


class Parrot:
    """A board that has one answer to every command."""

    def __init__(self, answer: bytes) -> None:
        self._answer = answer

    def receive(self, data: bytes) -> bytes:
        return OPENED[1] if data == OPENED[0] else self._answer


@settings(max_examples=50)
@given(st.binary(max_size=40) | st.integers(0, 1100).map(lambda step: read(step)[1]))
def test_any_answer_is_understood_or_a_device_error(answer: bytes) -> None:
    clock = VirtualClock()
    wired = Wired(clock, BoardPort(clock, Parrot(answer)))
    driver = NumatoThermometer("COM3", NumatoThermometer.Settings(), wired)
    try:
        assert PLAUSIBLE_C[0] <= driver.celsius() <= PLAUSIBLE_C[1]
    except DeviceError as error:
        assert "\n" not in str(error)


def test_a_slow_board_takes_a_second_or_two_and_no_more() -> None:
    clock = VirtualClock()

    class Slow(BoardPort):
        def write(self, data: bytes, /) -> int:
            clock.spend(0.4)
            return super().write(data)

    board = NumatoBoard(8, lambda relay, on: None, {0: lambda: 0.72})
    driver = NumatoThermometer(
        "COM3", NumatoThermometer.Settings(), Wired(clock, Slow(clock, board))
    )
    began_s = clock.now()
    assert driver.celsius() == pytest.approx(22.0, abs=0.5)
    assert clock.now() - began_s < 2


def test_relay_and_thermometer_share_a_line() -> None:
    clock = VirtualClock()
    board = NumatoBoard(8, lambda relay, on: None, {0: lambda: 0.71})
    wired = Wired(clock, BoardPort(clock, board))
    lamp = NumatoLamp("COM3", NumatoLamp.Settings(relay=0), wired)
    warmth = NumatoThermometer("COM3", NumatoThermometer.Settings(), wired)
    opened = NumatoThermometer("COM3", NumatoThermometer.Settings(input=1), wired)
    lamp.on()
    assert warmth.celsius() == pytest.approx(21.0, abs=0.5)
    with pytest.raises(DeviceError, match="is the sensor connected"):
        opened.celsius()
    assert lamp.is_on()
    lamp.off()
    assert not board.states[0]


@settings(max_examples=30)
@given(st.integers(0, 300))
def test_an_interrupted_reading_does_not_keep_the_lamp_on(waits: int) -> None:
    clock = InterruptingClock()
    board = NumatoBoard(8, lambda relay, on: None, {0: lambda: 0.71})
    wired = Wired(clock, BoardPort(clock, board))
    lamp = NumatoLamp("COM3", NumatoLamp.Settings(relay=0), wired)
    warmth = NumatoThermometer("COM3", NumatoThermometer.Settings(), wired)
    lamp.on()
    clock.waits_left = waits
    with suppress(Interrupted):
        warmth.celsius()
    clock.waits_left = 10**9
    lamp.make_safe()
    warmth.make_safe()
    assert not board.states[0]


def test_one_that_is_gone_is_safe_all_the_same() -> None:
    clock = VirtualClock()

    class Pulled(BoardPort):
        gone = False

        def write(self, data: bytes, /) -> int:
            if self.gone:
                raise OSError(5, "Input/output error")
            return super().write(data)

    port = Pulled(clock, NumatoBoard(8, lambda relay, on: None, {0: lambda: 0.71}))
    driver = NumatoThermometer("COM3", NumatoThermometer.Settings(), Wired(clock, port))
    port.gone = True
    with pytest.raises(DeviceError, match="is gone"):
        driver.celsius()
    driver.make_safe()
    driver.disconnect()
