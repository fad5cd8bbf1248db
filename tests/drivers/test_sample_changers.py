"""Sample changers, against transcripts of their wires and a simulated servo board."""

from typing import Any

import pytest
from pydantic import ValidationError

from labrig.acquire import SampleChanger, load_driver
from labrig.foundation.clock import VirtualClock
from labrig.foundation.errors import UnclearAnswerError
from labrig.foundation.yaml_file import validate
from labrig.sim.boards import MaestroBoard
from tests.drivers.serial_wire import BoardPort, ScriptedPort, Wired

MaestroSampleChanger: Any = load_driver("sample_changer", "maestro", "rig.yaml")
SerialSampleChanger: Any = load_driver("sample_changer", "serial_relay", "rig.yaml")

SERVO = {
    "channel": 3,
    "travel": "1 s",
    "away": "1000 us",
    "samples": {"blue paint": "1300 us", "green paint": "1600 us"},
}
BOARD = {
    "samples": {"blue paint": {"send": "turn 2", "answer": "there"}, "green paint": "turn 3"},
    "away": {"send": "turn 1", "answer": "there"},
    "travel": "2 s",
}


def test_a_changer_on_a_servo() -> None:
    clock = VirtualClock()
    board = MaestroBoard(clock, {3: 1000e-6})
    settings = validate(SERVO, MaestroSampleChanger.Settings, "rig.yaml")
    changer = MaestroSampleChanger("COM2", settings, Wired(clock, BoardPort(clock, board)))
    assert isinstance(changer, SampleChanger)
    assert changer.names() == tuple(settings.samples)
    changer.put("green paint")
    assert "sample changer on channel 3, pulse 1600.00 µs" in changer.identity()
    changer.make_safe()
    assert "1000.00 µs" in changer.identity()


def test_a_changer_whose_commands_are_in_the_rig_file() -> None:
    clock = VirtualClock()
    script = [(b"turn 2\n", b"there\n"), (b"turn 3\n", b""), (b"turn 1\n", b"stuck\n")]
    settings = validate(BOARD, SerialSampleChanger.Settings, "rig.yaml")
    changer = SerialSampleChanger("COM4", settings, Wired(clock, ScriptedPort(clock, script)))
    assert isinstance(changer, SampleChanger)
    changer.put("blue paint")
    before_s = clock.now()
    changer.put("green paint")
    assert clock.now() - before_s == pytest.approx(2.0, abs=0.1)
    with pytest.raises(UnclearAnswerError, match="got b'stuck'"):
        changer.put(None)


@pytest.mark.parametrize(
    ("model", "keys"),
    [
        (MaestroSampleChanger.Settings, SERVO | {"away": "1300 us"}),
        (SerialSampleChanger.Settings, BOARD | {"samples": {"a": "turn 2", "b": "turn 2"}}),
    ],
)
def test_two_samples_in_one_place_are_refused(model: Any, keys: dict[str, Any]) -> None:
    with pytest.raises(ValidationError, match="of its own for every sample"):
        model.model_validate(keys)
