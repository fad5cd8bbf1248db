"""Filter wheels, against transcripts of their wires and against simulated ones."""

from typing import Any

import pytest
from hypothesis import given, strategies as st
from pydantic import ValidationError

from labrig.acquire import Places, TurnWheel, load_driver
from labrig.foundation.clock import VirtualClock
from labrig.foundation.errors import DeviceError, ProtocolError, UnclearAnswerError
from labrig.foundation.yaml_file import validate
from labrig.sim.boards import Fw102cBoard, MaestroBoard
from tests.drivers.serial_wire import BoardPort, Script, ScriptedPort, Wired

MaestroFilterWheel: Any = load_driver("filter_wheel", "maestro", "rig.yaml")
SerialFilterWheel: Any = load_driver("filter_wheel", "serial_relay", "rig.yaml")
ThorlabsFilterWheel: Any = load_driver("filter_wheel", "thorlabs_fw102c", "rig.yaml")

OPENED: Script = [
    (b"\r", b"\rCommand error CMD_NOT_DEFINED\r> "),
    (b"*idn?\r", b"*idn?\rTHORLABS FW102C/FW212C Filter Wheel version 1.07\r> "),
    (b"pcount?\r", b"pcount?\r6\r> "),
]
FILTERS = {"bandpass-450": 2, "bandpass-500": 4}
COMMANDS = {
    "filters": {"blue": {"send": "turn 2", "answer": "there"}, "red": "turn 3"},
    "open": {"send": "turn 1", "answer": "there"},
    "travel": "2 s",
    "answers_within": "5 s",
}


def thorlabs(script: Script) -> tuple[Any, ScriptedPort]:
    clock = VirtualClock()
    port = ScriptedPort(clock, [*OPENED, *script])
    settings = ThorlabsFilterWheel.Settings(filters=FILTERS)
    return ThorlabsFilterWheel("COM9", settings, Wired(clock, port)), port


def test_the_wheel_is_turned_and_its_slot_read_back() -> None:
    wheel, port = thorlabs(
        [
            (b"pos?\r", b"pos?\r1\r> "),
            (b"pos=4\r", b"pos=4\r\r> "),
            (b"pos?\r", b"pos?\r1\r> "),
            (b"pos?\r", b"pos?\r4\r> "),
            (b"pos?\r", b"pos?\r4\r> "),
        ]
    )
    assert isinstance(wheel, Places)
    assert "FW102C/FW212C Filter Wheel version 1.07" in wheel.identity()
    assert wheel.names() == ("bandpass-450", "bandpass-500")
    wheel.put("bandpass-500")
    wheel.put("bandpass-500")
    assert port.script == []


@pytest.mark.parametrize(
    ("script", "said"),
    [
        ([(b"pos?\r", b"pos?\rx\r> ")], "expected a number, got 'x'"),
        (
            [
                (b"pos?\r", b"pos?\r1\r> "),
                (b"pos=2\r", b"pos=2\rCommand error CMD_ARG_INVALID\r> "),
            ],
            "CMD_ARG_INVALID",
        ),
        ([(b"pos?\r", b"")], "did not answer within 10 s"),
    ],
)
def test_a_wheel_that_answers_something_else(script: Script, said: str) -> None:
    wheel, _ = thorlabs(script)
    with pytest.raises(UnclearAnswerError, match=said):
        wheel.put("bandpass-450")


def test_another_device_and_a_smaller_wheel_are_refused() -> None:
    clock = VirtualClock()
    settings = ThorlabsFilterWheel.Settings(filters={"red": 7})
    port = ScriptedPort(clock, list(OPENED))
    with pytest.raises(DeviceError, match="has 6 slots, the rig file names slot 7"):
        ThorlabsFilterWheel("COM9", settings, Wired(clock, port))
    script = [OPENED[0], (b"*idn?\r", b"*idn?\rTHORLABS MC2000B\r> ")]
    with pytest.raises(DeviceError, match="expected FW102C or FW212C"):
        ThorlabsFilterWheel("COM9", settings, Wired(clock, ScriptedPort(clock, script)))


def test_the_simulated_wheel_takes_its_time() -> None:
    clock = VirtualClock()
    slots: list[int] = []
    board = Fw102cBoard(slots.append, clock)
    port = BoardPort(clock, board)
    board.receive(b"po")  # cut off
    settings = ThorlabsFilterWheel.Settings(filters=FILTERS)
    wheel = ThorlabsFilterWheel("COM9", settings, Wired(clock, port))
    before_s = clock.now()
    wheel.put("bandpass-500")
    assert clock.now() - before_s == pytest.approx(2.9, abs=0.3)
    assert board.slot == 4
    wheel.make_safe()
    assert slots == [4]


@given(st.binary(max_size=40))
def test_the_simulated_wheel_answers_any_bytes(data: bytes) -> None:
    Fw102cBoard(lambda slot: None, VirtualClock()).receive(data)


def test_a_wheel_whose_commands_are_in_the_rig_file() -> None:
    clock = VirtualClock()
    script = [(b"turn 2\n", b"there\r\n"), (b"turn 3\n", b""), (b"turn 2\n", b"stuck\n")]
    port = ScriptedPort(clock, script)
    settings = validate(COMMANDS, SerialFilterWheel.Settings, "rig.yaml")
    wheel = SerialFilterWheel("COM4", settings, Wired(clock, port))
    assert isinstance(wheel, Places)
    wheel.put("blue")
    before_s = clock.now()
    wheel.put("red")
    assert clock.now() - before_s == pytest.approx(2.0, abs=0.1)
    with pytest.raises(UnclearAnswerError, match="got b'stuck'"):
        wheel.put("blue")


def test_a_wheel_on_a_servo() -> None:
    clock = VirtualClock()
    board = MaestroBoard(clock, {2: 1000e-6})
    keys = {"channel": 2, "travel": "1 s", "open": "1000 us", "filters": {"blue": "1400 us"}}
    settings = validate(keys, MaestroFilterWheel.Settings, "rig.yaml")
    wheel = MaestroFilterWheel("COM2", settings, Wired(clock, BoardPort(clock, board)))
    assert isinstance(wheel, Places)
    wheel.put("blue")
    assert "1400.00 µs" in wheel.identity()
    wheel.make_safe()
    assert "1000.00 µs" in wheel.identity()


@pytest.mark.parametrize(
    ("model", "keys"),
    [
        (ThorlabsFilterWheel.Settings, {"filters": {"a": 2, "b": 2}}),
        (ThorlabsFilterWheel.Settings, {"filters": {"a": 1}}),
        (SerialFilterWheel.Settings, {**COMMANDS, "filters": {"a": "turn 2", "b": "turn 2"}}),
        (
            MaestroFilterWheel.Settings,
            {"channel": 0, "travel": "1 s", "open": "1 ms", "filters": {"a": "1000 us"}},
        ),
    ],
)
def test_two_filters_in_one_place_are_refused(model: Any, keys: dict[str, Any]) -> None:
    with pytest.raises(ValidationError, match="of its own for every filter"):
        model.model_validate(keys)


def test_a_filter_that_the_wheel_has_not() -> None:
    wheel, _ = thorlabs([])
    with pytest.raises(
        ProtocolError, match="'bandpass-455' before the lamp, which the wheel has not"
    ):
        TurnWheel("bandpass-455").begin(wheel)
