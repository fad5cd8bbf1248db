"""The Maestro driver against wire transcripts and against the emulated board."""

from typing import Any

import pytest
from hypothesis import given, strategies as st

from labrig.acquire import Guarded, Swing, load_driver
from labrig.drivers.maestro import ERRORS, Wire, error_text, quarters, seven_bits
from labrig.foundation.clock import VirtualClock
from labrig.foundation.errors import DeviceError, DeviceLostError
from labrig.foundation.yaml_file import validate
from labrig.sim.boards import MaestroBoard
from tests.drivers.serial_wire import BoardPort, InterruptingClock, Script, ScriptedPort, Wired

MaestroDoor: Any = load_driver("door", "maestro", "rig.yaml")
MaestroShield: Any = load_driver("shield", "maestro", "rig.yaml")

KEYS = {"channel": 2, "closed": "1000 us", "open": "1500 us", "travel": "280 ms"}
FINE = (b"\xa1", b"\0\0")
CLOSED, OPEN = (4000).to_bytes(2, "little"), (6000).to_bytes(2, "little")
#: 1500 µs on channel 2, as in Pololu's manual; 1000 µs.
GO_OPEN, GO_CLOSED = bytes.fromhex("8402702E"), bytes.fromhex("8402201F")
WHERE = bytes.fromhex("9002")
NO_LIMITS: Script = [(bytes.fromhex("87020000"), b""), (bytes.fromhex("89020000"), b"")]


def settings(**keys: Any) -> Any:
    return validate({**KEYS, **keys}, MaestroDoor.Settings, "rig.yaml")


def door(script: Script, **keys: Any) -> tuple[Any, ScriptedPort]:
    clock = VirtualClock()
    port = ScriptedPort(clock, [FINE, FINE, *script])
    return MaestroDoor("COM6", settings(**keys), Wired(clock, port)), port


def test_targets_errors_and_pulses_on_the_wire() -> None:
    driver, port = door(
        [
            *((GO_OPEN, b""), FINE, (WHERE, OPEN)),
            *((GO_CLOSED, b""), FINE, (WHERE, OPEN), (WHERE, CLOSED)),
            (WHERE, CLOSED),
            FINE,
        ]
    )
    assert issubclass(MaestroDoor, Swing)
    assert issubclass(MaestroDoor, Guarded)
    driver.swing(safe=False)
    driver.swing(safe=True)
    assert driver.identity() == (
        "Pololu Maestro servo controller, trap door on channel 2, pulse 1000.00 µs"
    )
    driver.heartbeat()
    assert driver.travel_s() == 0.28
    assert port.script == []


def test_it_is_safe_when_the_servo_has_had_the_time_to_turn() -> None:
    clock = VirtualClock()
    board = MaestroBoard(clock, {2: 1500e-6})
    driver = MaestroDoor("COM6", settings(), Wired(clock, BoardPort(clock, board)))
    began_s = clock.now()
    driver.make_safe()
    # A pulse is sent at once; the door arrives after its travel.
    assert clock.now() - began_s >= 0.28


def test_safe_is_closed_whatever_was_interrupted() -> None:
    driver, port = door(
        [
            *((b"\xa1", b"\x10\0"), (b"\xa1", b"\0\0"), *NO_LIMITS, (WHERE, OPEN)),
            *((GO_CLOSED, b""), FINE, (WHERE, CLOSED), (WHERE, CLOSED)),
        ]
    )
    driver.make_safe()
    assert port.script == []


def test_limits_are_set_and_the_ramp_is_waited_for_when_it_has_to_be_safe() -> None:
    driver, port = door(
        [
            *(FINE, FINE, (bytes.fromhex("87020C01"), b""), (bytes.fromhex("89020700"), b"")),
            *((WHERE, OPEN), (GO_CLOSED, b""), FINE, (WHERE, OPEN), (b"\x93", b"\1")),
            *((WHERE, OPEN), (WHERE, CLOSED)),
            *((GO_OPEN, b""), FINE, (WHERE, CLOSED), (b"\x93", b"\1")),
        ],
        speed=140,
        acceleration=7,
    )
    driver.make_safe()
    driver.swing(safe=False)
    assert port.script == []


def test_one_maestro_of_several_is_called_by_its_number() -> None:
    clock = VirtualClock()
    script = [
        (bytes.fromhex("AA0C21"), b"\0\0"),
        (bytes.fromhex("AA0C21"), b"\0\0"),
        (bytes.fromhex("AA0C0402702E"), b""),
        (bytes.fromhex("AA0C21"), b"\0\0"),
        (bytes.fromhex("AA0C1002"), OPEN),
    ]
    port = ScriptedPort(clock, script)
    MaestroDoor("COM6", settings(device_number=12), Wired(clock, port)).swing(safe=False)
    assert port.script == []


@pytest.mark.parametrize("bit", range(len(ERRORS)))
def test_each_error_is_named_with_what_to_do(bit: int) -> None:
    driver, _ = door([(GO_OPEN, b""), (b"\xa1", (1 << bit).to_bytes(2, "little"))])
    with pytest.raises(DeviceError) as refusal:
        driver.swing(safe=False)
    said = str(refusal.value)
    assert ERRORS[bit][0] in said
    assert ERRORS[bit][1] in said
    assert "sent all its channels home" in said
    assert "\n" not in said


def test_the_watchdog_is_called_so() -> None:
    driver, _ = door([(b"\xa1", b"\x20\0")])
    with pytest.raises(DeviceError, match="serial time-out, the watchdog, has run out"):
        driver.heartbeat()


@pytest.mark.parametrize(
    ("script", "error", "said"),
    [
        ([(GO_OPEN, b""), (b"\xa1", b"")], DeviceLostError, "expected 2 bytes, got b''"),
        ([(GO_OPEN, b""), (b"\xa1", b"\0")], DeviceLostError, "expected 2 bytes, got b"),
        (
            [(GO_OPEN, b""), FINE, *[(WHERE, CLOSED)] * 30],
            DeviceError,
            "set to send 1500.00 µs and sends 1000.00 µs; in the Maestro Control Center",
        ),
        ([(GO_OPEN, b""), FINE, *[(WHERE, b"\0\0")] * 30], DeviceError, "sends 0.00 µs"),
    ],
    ids=["silent", "half an answer", "outside its range", "no servo channel"],
)
def test_what_does_not_answer_or_obey(script: Script, error: type[DeviceError], said: str) -> None:
    driver, _ = door(script)
    with pytest.raises(error) as refusal:
        driver.swing(safe=False)
    assert said in str(refusal.value)


def test_two_equal_pulses_are_refused() -> None:
    with pytest.raises(Exception, match="two different positions for 'closed' and 'open'"):
        settings(open="1000 us")


@given(bits=st.integers(0, 0xFFFF))
def test_errors_are_reported_exactly_where_there_are_any(bits: int) -> None:
    said = error_text(bits)
    assert bool(said) == bool(bits)
    for bit, (what, _) in enumerate(ERRORS):
        assert (what in said) == bool(bits >> bit & 1)


@given(
    number=st.none() | st.integers(0, 0x7F),
    code=st.integers(0x80, 0xFF),
    data=st.lists(st.integers(0, 0x7F), max_size=4),
)
def test_only_the_first_byte_of_a_command_has_its_high_bit_set(
    number: int | None, code: int, data: list[int]
) -> None:
    sent = Wire(number).command(code, *data)
    assert [byte >> 7 for byte in sent] == [1] + [0] * (len(sent) - 1)
    assert sent.endswith(bytes(data))


@given(value=st.integers(0, 0x3FFF))
def test_seven_bits_twice(value: int) -> None:
    low, high = seven_bits(value)
    assert low | high << 7 == value


class Bench:
    """Door and shield on one emulated Maestro, with its own history of pulses."""

    def __init__(self, clock: VirtualClock, time_out_s: float | None = None, **keys: Any) -> None:
        self.clock = clock
        self.board = MaestroBoard(clock, {2: 1000e-6, 5: 1800e-6}, time_out_s)
        wired = Wired(clock, BoardPort(clock, self.board))
        shield = {"channel": 5, "covering": "900 us", "uncovering": "1800 us", "travel": "0.3 s"}
        self.door = MaestroDoor("COM6", settings(**keys), wired)
        self.shield = MaestroShield(
            "COM6", validate(shield, MaestroShield.Settings, "rig.yaml"), wired
        )

    def widths_us(self, channel: int) -> list[int]:
        return [round(pulse.width_s * 1e6) for pulse in self.board.pulses(channel)]


@pytest.mark.parametrize("keys", [{}, {"device_number": 12}, {"speed": 140, "acceleration": 7}])
def test_two_channels_of_the_emulated_board(keys: dict[str, Any]) -> None:
    bench = Bench(VirtualClock(), **keys)
    assert issubclass(MaestroShield, Swing)
    bench.shield.swing(safe=False)
    bench.door.swing(safe=False)
    bench.door.swing(safe=True)
    bench.door.make_safe()
    bench.shield.make_safe()
    assert bench.widths_us(2) == [1000, 1500, 1000]
    assert bench.widths_us(5) == [1800, 900, 1800]


def test_the_time_out_closes_the_door_and_is_reported() -> None:
    bench = Bench(VirtualClock(), time_out_s=10.0)
    bench.door.swing(safe=False)
    opened_s = bench.clock.now()
    bench.clock.sleep(8.0)
    bench.door.heartbeat()
    bench.clock.sleep(8.0)
    assert bench.widths_us(2) == [1000, 1500]
    bench.clock.sleep(8.0)
    assert bench.widths_us(2) == [1000, 1500, 1000]
    assert bench.board.pulses(2)[-1].at_s == pytest.approx(opened_s + 18.0, abs=0.1)
    with pytest.raises(DeviceError, match="serial time-out"):
        bench.door.swing(safe=False)
    bench.door.make_safe()
    bench.door.swing(safe=False)
    bench.door.make_safe()


def test_a_pulse_outside_the_channels_range_is_reported() -> None:
    bench = Bench(VirtualClock(), open="2600 us")
    with pytest.raises(DeviceError, match=r"set to send 2600\.00 µs and sends 2500\.00 µs"):
        bench.door.swing(safe=False)


def test_another_programs_half_command_does_not_keep_the_door_open() -> None:
    bench = Bench(VirtualClock())
    bench.door.swing(safe=False)
    bench.board.receive(b"\x84\x02")
    bench.door.make_safe()
    assert bench.widths_us(2)[-1] == 1000
    bench.board.receive(b"\x84\x02")
    with pytest.raises(DeviceError, match="did not understand a command"):
        bench.door.swing(safe=False)


@given(waits=st.integers(0, 60), keys=st.sampled_from([{}, {"speed": 140}]))
def test_an_interruption_at_any_wait_can_be_made_safe(waits: int, keys: dict[str, Any]) -> None:
    clock = InterruptingClock()
    bench = Bench(clock, **keys)
    with clock.interrupted_after(waits):
        bench.door.swing(safe=False)
        bench.door.swing(safe=True)
        bench.door.swing(safe=False)
    bench.door.make_safe()
    assert bench.widths_us(2)[-1] == 1000


@given(answers=st.lists(st.binary(max_size=4), min_size=2, max_size=2))
def test_any_answer_is_understood_or_a_device_error(answers: list[bytes]) -> None:
    driver, _ = door([(b"\xa1", answers[0]), *[(b"\xa1", answers[1])] * 3])
    try:
        driver.heartbeat()
    except DeviceError as error:
        assert "\n" not in str(error)


@given(st.binary(max_size=60))
def test_the_board_takes_any_bytes_and_its_next_command(data: bytes) -> None:
    clock = VirtualClock()
    board = MaestroBoard(clock, {2: 1000e-6})
    board.receive(data)
    board.receive(b"\xa1")
    board.receive(b"\xa1")
    assert board.receive(GO_OPEN) == b""
    clock.spend(board.pulses(2)[-1].ramp_s)  # the bytes may have set a speed
    assert board.receive(WHERE) == OPEN
    assert board.receive(b"\xa1") == b"\0\0"


@given(
    quarter=st.integers(2000, 10_000), speed=st.integers(0, 400), acceleration=st.integers(0, 255)
)
def test_a_ramp_ends_at_its_target(quarter: int, speed: int, acceleration: int) -> None:
    clock = VirtualClock()
    board = MaestroBoard(clock, {0: 1000e-6})
    for code, value in ((0x87, speed), (0x89, acceleration), (0x84, quarter)):
        board.receive(bytes((code, 0, *seven_bits(value))))
    pulse = board.pulses(0)[-1]
    clock.spend(pulse.ramp_s / 2)
    moving = board.receive(b"\x93") == b"\1"
    assert moving == (pulse.ramp_s > 0)
    clock.spend(pulse.ramp_s)
    assert board.receive(b"\x93\x90\0") == b"\0" + quarter.to_bytes(2, "little")
    assert quarters(pulse.width_s) == quarter
