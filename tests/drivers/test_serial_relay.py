"""Boards whose commands are in the rig file: wire transcripts, and four emulated boards."""

from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given, strategies as st

from labrig.acquire import Checkable, Guarded, Lamp, LightBank, load_driver
from labrig.foundation.clock import VirtualClock
from labrig.foundation.errors import DeviceError, DeviceLostError, UnclearAnswerError
from labrig.foundation.yaml_file import validate
from labrig.sim.boards import ArduinoBoard, LcusBoard, NumatoBoard
from tests.drivers.serial_wire import (
    Board,
    BoardPort,
    InterruptingClock,
    Script,
    ScriptedPort,
    Wired,
)

SerialLeds: Any = load_driver("leds", "serial_relay", "rig.yaml")
SerialLamp: Any = load_driver("lamp", "serial_relay", "rig.yaml")

Keys = dict[str, Any]


def sketch(relay: int) -> Keys:
    return {
        "on": {"send": f"on {relay}", "answer": "ok"},
        "off": {"send": f"off {relay}", "answer": "ok"},
        "state": {"send": f"state {relay}", "on": "on", "off": "off"},
    }


ARDUINO: Keys = sketch(0) | {
    "starts_in": "2 s",
    "identity": {"send": "version", "answer": "labrig relays 1"},
    "keep_alive": {"send": "alive", "answer": "ok"},
}
NUMATO: Keys = {
    "line_end": r"\r",
    "answer_end": ">",
    "on": {"send": "relay on 0", "answer": "relay on 0"},
    "off": {"send": "relay off 0", "answer": "relay off 0"},
    "state": {
        "send": "relay read 0",
        "on": "relay read 0 on",
        "off": "relay read 0 off",
    },
}
LCUS: Keys = {"on": "hex A0 01 01 A2", "off": "hex A00100A1"}
MINIMAL: Keys = {"on": "1", "off": "0"}
BOARDS: dict[str, tuple[Keys, Callable[[VirtualClock], ArduinoBoard | LcusBoard | NumatoBoard]]] = {
    "Arduino": (ARDUINO, lambda clock: ArduinoBoard(2, lambda relay, on: None, clock)),
    "Numato": (NUMATO, lambda clock: NumatoBoard(2, lambda relay, on: None)),
    "LCUS": (LCUS, lambda clock: LcusBoard(2, lambda relay, on: None)),
}


def settings(keys: Keys) -> Any:
    return validate(keys, SerialLamp.Settings, "rig.yaml, devices.lamp")


def lamp(keys: Keys, script: Script) -> tuple[Any, ScriptedPort]:
    clock = VirtualClock()
    port = ScriptedPort(clock, script)
    return SerialLamp("COM5", settings(keys), Wired(clock, port)), port


def on_board(keys: Keys, clock: VirtualClock, board: Board) -> Any:
    return SerialLamp("COM5", settings(keys), Wired(clock, BoardPort(clock, board)))


def test_text_is_confirmed_and_read_back() -> None:
    version = (b"version\n", b"labrig relays 1\r\n")
    driver, port = lamp(
        ARDUINO,
        [
            (b"\n", b""), version, version,
            (b"on 0\n", b"ok\r\n"), (b"state 0\n", b"on\r\n"),
            (b"state 0\n", b"on\r\n"),
            (b"alive\n", b"ok\r\n"),
            (b"\n", b""), (b"off 0\n", b"ok\r\n"),
            (b"off 0\n", b"ok\r\n"), (b"state 0\n", b"off\r\n"),
            version,
        ],
    )  # fmt: skip
    assert isinstance(driver, Lamp)
    assert isinstance(driver, Checkable)
    assert isinstance(driver, Guarded)
    driver.on()
    assert driver.is_on()
    driver.heartbeat()
    driver.make_safe()
    assert driver.identity() == "serial relay, labrig relays 1"
    assert driver.reads_back()
    assert [finding.severity for finding in driver.findings()] == ["fine"]
    assert port.script == []


def test_a_mute_board_is_sent_its_bytes_and_reported() -> None:
    on, off = bytes.fromhex("A00101A2"), bytes.fromhex("A00100A1")
    driver, port = lamp(LCUS, [(off, b""), (off, b""), (on, b""), (off, b"")])
    driver.make_safe()
    driver.on()
    assert driver.is_on(), "what was sent last"
    driver.off()
    assert not driver.is_on()
    driver.heartbeat()
    assert driver.identity() == "serial relay, board at COM5"
    (finding,) = driver.findings()
    assert finding.severity == "warn"
    assert "never acknowledges" in finding.what
    assert port.script == []


def test_a_relay_counts_as_on_until_its_board_confirms_that_it_is_off() -> None:
    keys = {"on": {"send": "1", "answer": "A"}, "off": {"send": "0", "answer": "B"}}
    driver, port = lamp(keys, [(b"0\n", b"B\n"), (b"0\n", b"?\n"), (b"0\n", b"B\n")])
    assert driver.is_on(), "nobody knows"
    driver.off()
    assert not driver.is_on()
    with pytest.raises(UnclearAnswerError):
        driver.off()
    assert driver.is_on()
    driver.off()
    assert not driver.is_on()
    assert port.script == []


def test_a_board_that_confirms_only_is_said_so() -> None:
    driver, _ = lamp({"on": {"send": "1", "answer": "A"}, "off": {"send": "0", "answer": "B"}}, [])
    (finding,) = driver.findings()
    assert "confirms commands" in finding.what


@pytest.mark.parametrize(
    ("answer", "error", "said"),
    [
        (b"error\r\n", UnclearAnswerError, "was sent 'on 0': expected 'ok', got b'error'"),
        (b"\xff\x00\r\n", UnclearAnswerError, "expected 'ok'"),
        (b"o", DeviceLostError, "did not answer within 1 s"),
        (b"", DeviceLostError, "did not answer within 1 s"),
    ],
)
def test_another_answer_is_a_device_error(
    answer: bytes, error: type[DeviceError], said: str
) -> None:
    driver, _ = lamp(sketch(0), [(b"on 0\n", answer)])
    with pytest.raises(error) as refusal:
        driver.on()
    assert said in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_register_that_stays_on_is_reported() -> None:
    driver, _ = lamp(sketch(0), [(b"off 0\n", b"ok\n"), (b"state 0\n", b"on\n")])
    with pytest.raises(DeviceError, match="was switched off but reads on; switch off by hand"):
        driver.off()


def test_another_board_is_not_switched() -> None:
    asked = (b"version\n", b"printer 7\r\n")
    with pytest.raises(UnclearAnswerError, match="expected 'labrig relays 1', got b'printer 7'"):
        lamp(ARDUINO, [(b"\n", b""), asked, asked])


@pytest.mark.parametrize(
    ("query", "sent", "answer", "shown"),
    [
        ("ver", b"ver\n", b"board  7\r\n", "board 7"),
        ("hex 5A", b"\x5a", b"\x08\x01", "08 01"),
    ],
)
def test_an_identity_that_is_not_expected_is_shown(
    query: str, sent: bytes, answer: bytes, shown: str
) -> None:
    start: Script = [] if sent == b"\x5a" else [(b"\n", b"")]
    asked = (sent, answer)
    driver, port = lamp(MINIMAL | {"identity": query}, [*start, asked, asked, asked])
    assert driver.identity() == f"serial relay, {shown}"
    assert port.script == []


def test_answers_of_several_lines_and_of_some_bytes() -> None:
    echoing = {"on": {"send": "1", "answer": r"1\nOK"}, "off": "0"}
    driver, port = lamp(echoing, [(b"1\n", b"1\r\nOK\r\n")])
    driver.on()
    terse = {"on": {"send": "hex 01", "answer": "hex 06"}, "off": "hex 00"}
    other, other_port = lamp(terse, [(b"\x01", b"\x06"), (b"\x00", b"")])
    other.on()
    other.off()
    assert port.script == other_port.script == []


def test_the_command_has_left_when_it_returns() -> None:
    clock = VirtualClock()
    driver = on_board(LCUS | {"baud": 1200}, clock, LcusBoard(1, lambda relay, on: None))
    before_s = clock.now()
    driver.on()
    assert 4 * 10 / 1200 <= clock.now() - before_s < 0.1


@pytest.mark.parametrize("name", BOARDS)
def test_emulated_boards_understand_it(name: str) -> None:
    keys, make = BOARDS[name]
    clock = VirtualClock()
    board = make(clock)
    board.states[0] = True
    driver = on_board(keys, clock, board)
    driver.make_safe()
    assert board.states == [False, False]
    for on in (True, False, True):
        (driver.on if on else driver.off)()
        assert driver.is_on() == on
        assert board.states == [on, False]
    driver.make_safe()
    assert not board.states[0]


@pytest.mark.parametrize("name", BOARDS)
@given(waits=st.integers(0, 80))
def test_an_interruption_at_any_wait_can_be_made_safe(name: str, waits: int) -> None:
    keys, make = BOARDS[name]
    clock = InterruptingClock()
    board = make(clock)
    driver = on_board(keys, clock, board)
    with clock.interrupted_after(waits):
        driver.on()
        driver.is_on()
        driver.off()
        driver.on()
    driver.make_safe()
    assert not board.states[0]
    assert not driver.is_on()


@pytest.mark.parametrize("name", BOARDS)
@pytest.mark.parametrize("torn", [b"o", b"on 0", b"relay on", b"\xa0", b"\xa0\x01\x01", b"\xff"])
def test_half_a_command_of_another_program_does_not_keep_the_lamp_on(
    name: str, torn: bytes
) -> None:
    keys, make = BOARDS[name]
    clock = VirtualClock()
    board = make(clock)
    driver = on_board(keys, clock, board)
    driver.on()
    board.receive(torn)
    driver.make_safe()
    assert not board.states[0]


def test_the_watchdog_of_the_firmware_is_kept_quiet_and_noticed() -> None:
    clock = VirtualClock()
    board = ArduinoBoard(1, lambda relay, on: None, clock, silence_s=180.0)
    driver = on_board(ARDUINO, clock, board)
    driver.make_safe()
    driver.on()
    for _ in range(10):
        clock.sleep(40.0)
        driver.heartbeat()
    assert driver.is_on()
    clock.sleep(181.0)
    with pytest.raises(UnclearAnswerError, match="expected 'ok', got b'expired'"):
        driver.heartbeat()
    assert not board.states[0]
    driver.make_safe()
    driver.heartbeat()


def bank(clock: VirtualClock, board: Board, keys: Keys | None = None) -> Any:
    channels = {"channels": {"450 nm": sketch(1), "525 nm": sketch(2)}} if keys is None else keys
    return SerialLeds(
        "COM5",
        validate(channels, SerialLeds.Settings, "rig.yaml, devices.leds"),
        Wired(clock, BoardPort(clock, board)),
    )


@given(
    st.lists(st.sampled_from(["450 nm", "525 nm", None]), max_size=6),
    st.integers(1, 200),
    st.booleans(),
)
def test_two_leds_are_never_lit_and_after_any_interruption_all_go_off(
    sequence: list[str | None], waits: int, left_on: bool
) -> None:
    clock = InterruptingClock()
    lit_at_once: list[int] = []
    board = ArduinoBoard(3, lambda relay, on: lit_at_once.append(sum(board.states)), clock)
    board.states[2] = left_on
    leds = bank(clock, board)
    with clock.interrupted_after(waits):
        for channel in sequence:
            if channel is None:
                leds.dark()
            else:
                leds.light(channel)
            assert leds.channel_on() == channel
    assert max(lit_at_once, default=0) <= 1
    leds.make_safe()
    assert not any(board.states)
    assert leds.channel_on() is None


def test_lamp_and_leds_share_a_line() -> None:
    clock = VirtualClock()
    board = ArduinoBoard(3, lambda relay, on: None, clock)
    relay, leds = on_board(ARDUINO, clock, board), bank(clock, board)
    assert issubclass(SerialLeds, LightBank)
    assert leds.channels() == ("450 nm", "525 nm")
    assert leds.reads_back()
    relay.on()
    leds.light("525 nm")
    leds.heartbeat()
    leds.make_safe()
    assert relay.is_on()
    assert board.states == [True, False, False]


def test_leds_that_are_not_read_back_are_as_commanded() -> None:
    clock = VirtualClock()
    board = LcusBoard(2, lambda relay, on: None)
    keys = {"450 nm": {"on": "hex A00101A2", "off": "hex A00100A1"},
            "525 nm": {"on": "hex A00201A3", "off": "hex A00200A2"}}  # fmt: skip
    leds = bank(clock, board, {"channels": keys})
    leds.light("450 nm")
    leds.light("525 nm")
    assert leds.channel_on() == "525 nm"
    assert board.states == [False, True]
    assert not leds.reads_back()
    assert [finding.severity for finding in leds.findings()] == ["warn"]


@given(st.binary(max_size=40))
def test_the_board_answers_any_bytes(data: bytes) -> None:
    ArduinoBoard(2, lambda relay, on: None, VirtualClock()).receive(data)
