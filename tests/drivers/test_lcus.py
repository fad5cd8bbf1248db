"""The LCUS driver against wire transcripts and against the emulated board."""

from typing import Any

import pytest
from hypothesis import given, strategies as st

from labrig.acquire import Checkable, Lamp, load_driver
from labrig.drivers.lcus import command, relay_states
from labrig.foundation.clock import VirtualClock
from labrig.foundation.errors import DeviceError, DeviceLostError
from labrig.sim.boards import LcusBoard
from labrig.sim.boards.lcus import Answers
from tests.drivers.serial_wire import (
    BoardPort,
    InterruptingClock,
    Script,
    ScriptedPort,
    Wired,
)

LcusLamp: Any = load_driver("lamp", "lcus", "rig.yaml")

ON_1, OFF_1 = bytes.fromhex("A00101A2"), bytes.fromhex("A00100A1")
ON_2, OFF_2 = bytes.fromhex("A00201A3"), bytes.fromhex("A00200A2")
QUERY = b"\xff"
ANSWERS: tuple[Answers, ...] = ("nothing", "text", "bytes")


def lamp(script: Script, relay: int = 1) -> tuple[Any, ScriptedPort]:
    clock = VirtualClock()
    port = ScriptedPort(clock, script)
    return LcusLamp("COM5", LcusLamp.Settings(relay=relay), Wired(clock, port)), port


def asked(first: bytes, second: bytes) -> Script:
    return [(QUERY, first), (QUERY, second)]


def test_a_mute_board_is_reported_and_never_asked_again() -> None:
    driver, port = lamp(
        [(OFF_1, b""), *asked(b"", b""), (ON_1, b""), (OFF_1, b""), (OFF_1, b""), (OFF_1, b"")]
    )
    assert isinstance(driver, Lamp)
    assert isinstance(driver, Checkable)
    driver.on()
    assert driver.is_on(), "what was sent last"
    driver.off()
    assert not driver.is_on()
    driver.make_safe()
    assert "only the camera can verify it" in driver.identity()
    (finding,) = driver.findings()
    assert finding.severity == "warn"
    assert "never acknowledges" in finding.what
    assert "camera" in finding.remedy
    assert port.script == []


@pytest.mark.parametrize(
    ("off", "on"),
    [
        (b"CH1: OFF\r\nCH2: OFF\r\n", b"CH1: OFF\r\nCH2: ON \r\n"),
        (b"CH1:OFF \r\nCH2:OFF \r\n", b"CH1:OFF \r\nCH2:ON \r\n"),
        (b"\x00\x00", b"\x00\x01"),
    ],
    ids=["brzycki", "AscomSwitchDriver", "bytes"],
)
def test_the_second_of_two_answers_counts(off: bytes, on: bytes) -> None:
    driver, port = lamp(
        [
            (OFF_2, b""),
            *asked(on, off),
            (ON_2, b""),
            *asked(off, on),
            *asked(on, on),
            *((OFF_2, b""), (OFF_2, b"")),
            *asked(on, off),
        ],
        relay=2,
    )
    driver.on()
    assert driver.is_on(), "the first answer is what was true before"
    assert driver.identity() == "LCUS relay board (2 relays, read back by query), relay 2"
    driver.make_safe()
    assert [finding.severity for finding in driver.findings()] == ["fine"]
    assert port.script == []


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        (b"ver\n\r00000008\n\r>", "expected 'CH2: ON' or 'OFF', or a byte for each relay, got"),
        (b"CH1: OFF\r\n", "has it that many relays?"),
        (b"CH1: OFF\r\nCH2: O", "is it an LCUS board"),
        (b"\x00", "has it that many relays?"),
    ],
    ids=["another board", "one relay", "cut off", "one byte"],
)
def test_another_answer_is_a_device_error(answer: bytes, said: str) -> None:
    with pytest.raises(DeviceError, match="got") as refusal:
        lamp([(OFF_2, b""), *asked(answer, answer)], relay=2)
    assert said in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_register_that_stays_on_is_reported() -> None:
    driver, _ = lamp(
        [(OFF_1, b""), *asked(b"\1", b"\1"), (OFF_1, b""), (OFF_1, b""), *asked(b"\1", b"\1")]
    )
    with pytest.raises(DeviceError, match="was switched off but reads on; switch off by hand"):
        driver.make_safe()


def test_a_board_that_fell_silent_is_reported() -> None:
    driver, _ = lamp(
        [(OFF_1, b""), *asked(b"\0", b"\0"), (OFF_1, b""), (OFF_1, b""), *asked(b"", b"")]
    )
    with pytest.raises(DeviceLostError, match="answered its query before"):
        driver.make_safe()


def test_the_command_has_left_when_it_returns_and_no_sooner() -> None:
    clock = VirtualClock()
    board = LcusBoard(1, lambda relay, on: None)
    driver = LcusLamp("COM5", LcusLamp.Settings(relay=1), Wired(clock, BoardPort(clock, board)))
    before_s = clock.now()
    driver.on()
    assert clock.now() - before_s == pytest.approx(4 * 10 / 9600)


@pytest.mark.parametrize("answers", ANSWERS)
def test_the_driver_and_the_emulated_board(answers: Answers) -> None:
    clock = VirtualClock()
    moved: list[tuple[int, bool]] = []
    board = LcusBoard(4, lambda relay, on: moved.append((relay, on)), answers)
    board.states[2] = True
    driver = LcusLamp("COM5", LcusLamp.Settings(relay=3), Wired(clock, BoardPort(clock, board)))
    assert moved == [(3, False)], "off at connect"
    for on in (True, False, True):
        (driver.on if on else driver.off)()
        assert driver.is_on() == on
        assert board.states == [False, False, on, False]
    driver.make_safe()
    assert not board.states[2]


@given(waits=st.integers(0, 80), answers=st.sampled_from(ANSWERS))
def test_an_interruption_at_any_wait_can_be_made_safe(waits: int, answers: Answers) -> None:
    clock = InterruptingClock()
    board = LcusBoard(2, lambda relay, on: None, answers)
    driver = LcusLamp("COM5", LcusLamp.Settings(relay=1), Wired(clock, BoardPort(clock, board)))
    with clock.interrupted_after(waits):
        driver.on()
        driver.is_on()
        driver.off()
        driver.on()
    driver.make_safe()
    assert not board.states[0]
    assert not driver.is_on()


@pytest.mark.parametrize("torn", [b"\xa0", b"\xa0\x01", b"\xa0\x01\x01"])
def test_half_a_command_of_another_program_does_not_keep_the_lamp_on(torn: bytes) -> None:
    clock = VirtualClock()
    board = LcusBoard(2, lambda relay, on: None)
    driver = LcusLamp("COM5", LcusLamp.Settings(relay=1), Wired(clock, BoardPort(clock, board)))
    driver.on()
    board.receive(torn)
    driver.make_safe()
    assert not board.states[0]


@given(relay=st.integers(1, 8), on=st.booleans())
def test_a_command_moves_its_relay_and_no_other(relay: int, on: bool) -> None:
    board = LcusBoard(8, lambda relay, on: None)
    board.states[:] = [not on] * 8
    assert board.receive(command(relay, on=on)) == b""
    assert [number for number, state in enumerate(board.states, start=1) if state == on] == [relay]


@given(
    states=st.lists(st.booleans(), min_size=1, max_size=8),
    answers=st.sampled_from(("text", "bytes")),
)
def test_what_a_board_tells_is_read(states: list[bool], answers: Answers) -> None:
    board = LcusBoard(len(states), lambda relay, on: None, answers)
    board.states[:] = states
    board.receive(QUERY)
    assert relay_states(board.receive(QUERY)) == tuple(states)


@given(st.binary(max_size=60))
def test_any_answer_is_understood_or_a_device_error(answer: bytes) -> None:
    driver, _ = lamp([(OFF_1, b""), *asked(b"\0", b"\0"), *asked(answer, answer)])
    try:
        assert driver.is_on() in (True, False)
    except DeviceError as error:
        assert "\n" not in str(error)


@given(st.binary(max_size=40), st.sampled_from(ANSWERS))
def test_the_board_answers_any_bytes(data: bytes, answers: Answers) -> None:
    LcusBoard(8, lambda relay, on: None, answers).receive(data)


EIGHT: dict[str, Any] = {f"{365 + 40 * n} nm": n + 1 for n in range(8)}


def eight(role: str, wired: Wired, channels: dict[str, Any] = EIGHT) -> Any:
    bank = load_driver(role, "lcus", "rig.yaml")
    return bank("COM5", bank.Settings.model_validate({"channels": channels}), wired)


def off(relay: int) -> tuple[bytes, bytes]:
    return command(relay, on=False), b""


@pytest.mark.parametrize("role", ["leds", "illuminants"])
def test_eight_relays_drive_a_bank_of_lights(role: str) -> None:
    none, third = b"\0" * 8, b"\0\0\1\0\0\0\0\0"
    clock = VirtualClock()
    port = ScriptedPort(
        clock,
        [
            off(1),
            *asked(none, none),
            *map(off, range(2, 9)),  # off at connect, and the board is asked once
            (command(3, on=True), b""),
            *asked(third, third),
            *(off(3), (command(8, on=True), b"")),
            *asked(third, b"\0" * 7 + b"\1"),
            off(8),
            *asked(none, none), *asked(none, none),  # for its identity, twice
            *map(off, range(1, 9)), *map(off, range(1, 9)),
            *asked(none, none),
        ],
    )  # fmt: skip
    driver = eight(role, Wired(clock, port))
    assert driver.channels() == tuple(EIGHT)
    driver.light("445 nm")
    assert driver.channel_on() == "445 nm"
    driver.light("645 nm")
    assert driver.channel_on() == "645 nm"
    driver.dark()
    assert driver.identity().startswith("LCUS relay board (8 relays, read back by query), ")
    assert "645 nm on relay 8" in driver.identity()
    driver.make_safe()
    assert port.script == []


def test_a_light_of_a_bank_that_stays_on_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = VirtualClock()
    board = LcusBoard(8, lambda relay, on: None, "bytes")
    driver = eight("leds", Wired(clock, BoardPort(clock, board)))

    board.states[4] = True
    monkeypatch.setattr(board, "_obey", lambda command: None)
    with pytest.raises(DeviceError, match=r"relay 5 .* was switched off but reads on"):
        driver.make_safe()


def test_a_relay_that_the_board_has_not_is_refused_before_anything_is_lit() -> None:
    clock = VirtualClock()
    board = LcusBoard(4, lambda relay, on: None, "text")
    driver = eight("leds", Wired(clock, BoardPort(clock, board)))
    with pytest.raises(DeviceError, match=r"was asked for relay 8: .* has it that many relays"):
        driver.make_safe()


@given(
    sequence=st.lists(st.sampled_from([*EIGHT, None]), max_size=6),
    waits=st.integers(1, 200),
    answers=st.sampled_from(ANSWERS),
)
def test_two_lights_are_never_lit_and_after_any_interruption_all_go_off(
    sequence: list[str | None], waits: int, answers: Answers
) -> None:
    clock = InterruptingClock()
    lit_at_once: list[int] = []
    board = LcusBoard(8, lambda relay, on: lit_at_once.append(sum(board.states)), answers)
    driver = eight("leds", Wired(clock, BoardPort(clock, board)))
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


@given(waits=st.integers(1, 20), answers=st.sampled_from(ANSWERS))
def test_a_light_whose_command_was_interrupted_goes_off_before_the_next_is_lit(
    waits: int, answers: Answers
) -> None:
    clock = InterruptingClock()
    board = LcusBoard(8, lambda relay, on: None, answers)
    driver = eight("leds", Wired(clock, BoardPort(clock, board)))
    with clock.interrupted_after(waits):
        driver.light("365 nm")
    driver.light("405 nm")
    assert [number for number, on in enumerate(board.states, start=1) if on] == [2]


class TwoBoards(Wired):
    """Connections with a board at COM5 and one at COM6, if that is not missing."""

    def __init__(self, clock: VirtualClock, **boards: LcusBoard) -> None:
        self.clock = clock
        self._ports = {name: BoardPort(clock, board) for name, board in boards.items()}

    def serial(self, address: str, baudrate: int, framing: str = "8N1") -> ScriptedPort:
        if address not in self._ports:
            raise DeviceError(f"nothing is at {address}")
        return self._ports[address]


def test_lights_on_two_boards_are_one_bank_and_none_stays_lit_if_one_board_is_missing() -> None:
    clock = VirtualClock()
    boards = {port: LcusBoard(2, lambda relay, on: None, "bytes") for port in ("COM5", "COM6")}
    channels: dict[str, Any] = {
        "far": {"relay": 1, "address": "COM6"},
        "a": 1,
        "b": 2,
        "beyond": {"relay": 2, "address": "COM6"},
    }
    bank = eight("leds", TwoBoards(clock, **boards), channels)
    assert bank.channels() == ("far", "a", "b", "beyond")
    for name, port, relay in (("far", "COM6", 0), ("b", "COM5", 1), ("beyond", "COM6", 1)):
        bank.light(name)
        assert bank.channel_on() == name
        lit = [(at, n) for at, board in boards.items() for n in (0, 1) if board.states[n]]
        assert lit == [(port, relay)]
    bank.make_safe()
    assert not any(state for board in boards.values() for state in board.states)
    boards["COM5"].states[0] = True
    with pytest.raises(DeviceError, match="nothing is at COM6"):
        eight("leds", TwoBoards(clock, COM5=boards["COM5"]), channels)
    assert not boards["COM5"].states[0]
