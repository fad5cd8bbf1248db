"""The room's thermometer: what the relay board says of it."""

import numpy as np
import pytest

from labrig.foundation.clock import VirtualClock
from labrig.sim.bench_settings import TemperatureSettings
from labrig.sim.boards import NumatoBoard
from labrig.sim.faults import FaultTime
from labrig.sim.temperature import SENSOR_SIGMA_K, TemperatureSensor


def shown(board: NumatoBoard, number: int = 0) -> float:
    """Degrees of a TMP36 at an input, by its data sheet, from what the board says 400 times."""
    answers = [board.receive(f"adc read {number}\r".encode()).decode() for _ in range(400)]
    steps = [int(answer.removeprefix(f"adc read {number}").strip("\n\r>")) for answer in answers]
    return float((np.mean(steps) * 5000 / 1023 - 500) / 10)


def make(
    clock: VirtualClock, settings: TemperatureSettings | None, seed: int = 1, *off: FaultTime
) -> NumatoBoard:
    sensor = TemperatureSensor(settings, clock, np.random.default_rng(seed), off)
    return NumatoBoard(8, lambda relay, on: None, {0: sensor.volts})


def test_a_room_of_which_nothing_is_reported_has_21_degrees() -> None:
    clock = VirtualClock()
    boards = [make(clock, None, seed) for seed in range(12)]
    errors = np.array([shown(board) - 21 for board in boards])
    assert abs(errors.mean()) < 3 * SENSOR_SIGMA_K / np.sqrt(12)
    assert 0.3 * SENSOR_SIGMA_K < errors.std() < 2 * SENSOR_SIGMA_K


@pytest.mark.parametrize("drift", [-4.0, 2.5])
def test_the_sensor_follows_the_room(drift: float) -> None:
    clock = VirtualClock()
    board = make(clock, TemperatureSettings(start=24, drift_per_hour=drift))
    before = shown(board)
    clock.sleep(2 * 3600)
    assert shown(board) - before == pytest.approx(2 * drift, abs=0.1)


def test_a_wire_that_has_come_off_shows_at_the_end_of_the_range() -> None:
    clock = VirtualClock()
    board = make(clock, None, 1, FaultTime.model_validate({"at": "10 s", "for": "10 s"}))
    said = []
    for _ in range(3):
        said.append(board.receive(b"adc read 0\r") == b"adc read 0\n\r1023\n\r>")
        clock.sleep(10)
    assert said == [False, True, False]


@pytest.mark.parametrize(
    ("command", "answer"),
    [("adc read 1", "1023\n\r"), ("adc read 9", ""), ("adc read", ""), ("adc read 00", "")],
    ids=["open", "no such input", "none", "two digits"],
)
def test_other_inputs(command: str, answer: str) -> None:
    board = make(VirtualClock(), None)
    assert board.receive(f"{command}\r".encode()).decode() == f"{command}\n\r{answer}>"
