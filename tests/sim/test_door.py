"""The trap door: how it swings, what the camera and the lamp then see of the sample."""

import io
import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import rawpy
import serial
from hypothesis import given, settings, strategies as st
from scipy.integrate import quad

from labrig.foundation.clock import VirtualClock
from labrig.foundation.errors import UsageError
from labrig.foundation.yaml_file import validate
from labrig.material.file import read_material
from labrig.sim import open_room
from labrig.sim.bench_settings import DoorSettings
from labrig.sim.boards import Pulse
from labrig.sim.door import FRAME_S, Door, DoorDrive
from labrig.sim.faults import FaultTime, Slowness
from labrig.sim.lamp import Lamp
from labrig.sim.lights import Lights
from labrig.sim.phosphor import phosphor
from labrig.sim.room import Room
from labrig.sim.simulation import LampSettings, Simulation

SMALL = {"sample": "blue-paint", "sensor": {"width": 96, "height": 64, "flicker": 0.0}}
DOOR = DoorSettings()


def drive(
    clock: VirtualClock, pulses: Sequence[Pulse], *, jitter_s: float = 0.01, **faults: Any
) -> DoorDrive:
    first = [Pulse(0.0, DOOR.closed, 0.0)]
    made = DoorDrive(
        DOOR,
        lambda: first + [pulse for pulse in pulses if pulse.at_s <= clock.now()],
        lambda _: jitter_s,
        clock,
        is_open=False,
        **faults,
    )
    return made


def moved(until_s: float, pulses: Sequence[Pulse], **keys: Any) -> Door:
    clock = VirtualClock()
    made = drive(clock, pulses, **keys)
    clock.spend(until_s)
    return made.door


def when(at: str, lasting: str | None = None) -> FaultTime:
    return FaultTime.model_validate({"at": at, "for": lasting})


def to_open(at_s: float) -> Pulse:
    return Pulse(at_s, DOOR.open, 0.0)


def to_closed(at_s: float) -> Pulse:
    return Pulse(at_s, DOOR.closed, 0.0)


def test_it_waits_for_the_servos_frame_travels_overshoots_and_rings_out() -> None:
    door = moved(2.0, [to_open(1.0)])
    assert [door.angle(t) for t in (0.5, 1.0, 1.01)] == [0.0, 0.0, 0.0]
    assert door.angle(1.01 + DOOR.travel / 2) == pytest.approx(0.5)
    stop_s = 1.01 + DOOR.travel
    assert door.angle(stop_s) == pytest.approx(1.0)
    ringing = np.array([door.angle(stop_s + t) for t in np.linspace(0, 0.05, 200)])
    assert 1.01 < ringing.max() < 1 + DOOR.overshoot
    assert ringing.min() < 1.0
    expected_s = stop_s + DOOR.ringing * math.log(DOOR.overshoot / 1e-4)
    assert door.settled_s == pytest.approx(expected_s)
    assert door.settled_s - 1.0 < 0.28, "the paper's door stops 280 ms after the command"
    assert door.openness(door.settled_s) == 1.0
    assert door.is_still(door.settled_s, 99.0)
    assert not door.is_still(stop_s, 99.0)


times = st.lists(st.floats(0.1, 3.0), min_size=1, max_size=6).map(sorted)


@settings(max_examples=30)
@given(times=times, widths=st.lists(st.floats(900e-6, 2100e-6), min_size=6, max_size=6))
def test_openness_is_a_part_and_goes_on_steadily_until_it_rests(
    times: list[float], widths: list[float]
) -> None:
    pulses = [Pulse(t, width, 0.0) for t, width in zip(times, widths, strict=False)]
    door = moved(4.0, pulses)
    grid = np.linspace(0.0, 4.0, 4001)
    openness = np.array([door.openness(t) for t in grid])
    assert np.all((openness >= 0) & (openness <= 1))
    assert np.abs(np.diff(openness)).max() < 0.1, "it never jumps"
    last = min(max((pulses[-1].width_s - DOOR.closed) / (DOOR.open - DOOR.closed), 0.0), 1.0)
    assert door.angle(4.0) == pytest.approx(last)
    corners = door.corners(0.0, 4.0)
    assert corners == sorted(corners)


def test_looking_early_does_not_change_what_happened() -> None:
    pulses = [to_open(1.0), to_closed(1.1), to_open(2.0)]
    clock = VirtualClock()
    looked_at = drive(clock, pulses)
    for _ in range(40):
        clock.spend(0.1)
        _ = looked_at.door
    late = moved(4.0, pulses)
    assert looked_at.door.swings == late.swings


def test_a_ramp_of_the_board_slows_the_door() -> None:
    door = moved(3.0, [Pulse(1.0, DOOR.open, 0.8)])
    assert door.angle(1.01 + 0.4) == pytest.approx(0.5)
    assert moved(3.0, [Pulse(1.0, DOOR.open, 0.1)]).settled_s == pytest.approx(
        moved(3.0, [to_open(1.0)]).settled_s
    )


def test_a_servo_without_pulses_stays() -> None:
    assert moved(3.0, [to_open(1.0), Pulse(1.06, 0.0, 0.0), to_closed(2.0)]).angle(1.9) == 1.0


def test_a_stuck_door_stays_and_swings_on_when_it_is_free() -> None:
    door = moved(5.0, [to_open(1.0)], stuck=[when(at="1.11 s", lasting="2 s")])
    assert door.angle(3.1) == pytest.approx(0.5)
    assert door.angle(1.2) == pytest.approx(0.5)
    assert door.angle(4.0) == 1.0
    assert moved(5.0, [to_open(1.0)], stuck=[FaultTime()]).angle(5.0) == 0.0


def test_a_slow_door_takes_its_time() -> None:
    door = moved(5.0, [to_open(1.0)], slow=[Slowness.model_validate({"takes": "1 s"})])
    assert door.angle(1.51) == pytest.approx(0.5)
    assert door.angle(2.5) == 1.0


def lights(pulses: Sequence[Pulse], room_light: Sequence[FaultTime] = ()) -> Lights:
    lamp = Lamp.found(LampSettings(), on=True).switched(False, 0.9)
    return Lights(lamp, room_light, moved(9.0, pulses), Door.found(DOOR, is_open=True))


def brute_force(shine: Callable[[float], float], start_s: float, end_s: float) -> float:
    edges = np.linspace(start_s, end_s, 41)
    return sum(
        quad(shine, low, high, epsabs=1e-12, epsrel=1e-10)[0] for low, high in pairwise(edges)
    )


def test_what_is_seen_is_integrated_exactly() -> None:
    """Lamp fading, door opening and room light, all in one exposure."""
    both = lights([to_open(1.0)], [when(at="0.5 s")])
    door, lamp = both.door, both.lamp
    assert door is not None
    band = 100
    room = lights([], [FaultTime()]).irradiance(8.0)[band]
    seen = both.seen(0.8, 2.0)

    def openness(t: float) -> float:
        assert door is not None
        return door.openness(t)

    def sample(t: float) -> float:
        o = openness(t)
        return float(o * (1 - o) * lamp.irradiance(t)[band] + o * room)

    def outside(t: float) -> float:
        return float((1 - openness(t)) * (lamp.irradiance(t)[band] + room))

    reflected = seen.sample[band] + seen.sample_stray[band]
    assert reflected == pytest.approx(brute_force(sample, 0.8, 2.0), rel=1e-6)
    assert seen.door[band] == pytest.approx(brute_force(outside, 0.8, 2.0), rel=1e-6)
    assert seen.cloth[band] == pytest.approx(both.exposure(0.8, 2.0)[band], rel=1e-9)


def test_the_glow_is_integrated_with_the_doors_openness() -> None:
    glowing = phosphor([read_material("blue-paint")], [None], 4.0)
    dark = Lights(Lamp.found(LampSettings(), on=False), (), moved(9.0, [to_open(1.0)]))
    start = np.full(len(glowing.k_r_per_s), 0.5)
    _, seen_s = glowing.evolve(start, 0.8, 1.8, dark, dark.openness)
    (k_r,) = glowing.k_r_per_s
    expected = brute_force(lambda t: 0.5 * math.exp(-k_r * (t - 0.8)) * dark.openness(t), 0.8, 1.8)
    assert seen_s[0] == pytest.approx(expected, rel=1e-6)


def room_with(pulses: Sequence[Pulse] = (), **changed: Any) -> tuple[Room, VirtualClock]:
    simulation = Simulation.model_validate({**SMALL, **changed})
    clock = VirtualClock(simulation.epoch.timestamp())
    made = Room(simulation, clock, lambda _: [p for p in pulses if p.at_s <= clock.now()])
    return made, clock


def shot(room: Room, clock: VirtualClock, exposure_s: float = 1.0) -> bytes:
    start_s = clock.now()
    clock.spend(exposure_s)
    return room.photograph(start_s, exposure_s, 400, 4.0)


def middle(dng: bytes) -> float:
    with rawpy.imread(io.BytesIO(dng)) as raw:
        return float(raw.raw_image_visible[20:44, 30:66].mean()) - 1024


def test_an_open_door_is_no_door_and_a_closed_one_hides_the_glow() -> None:
    initial = {"concentration": 0.5}
    bare = shot(*room_with(initial=initial))
    opened = shot(*room_with(initial=initial | {"door": "open"}, door={}))
    closed = shot(*room_with(initial=initial, door={}))
    assert opened == bare
    assert middle(bare) > 1000
    assert middle(closed) == pytest.approx(0, abs=3)


def test_the_lamp_charges_behind_a_closed_door_only() -> None:
    glow = {}
    for state in ("closed", "open"):
        pulses = [Pulse(0.0, DOOR.open if state == "open" else DOOR.closed, 0.0), to_open(601.0)]
        room, clock = room_with(pulses, door={}, initial={"door": state})
        room.switch_lamp(True)
        clock.spend(600.0)
        room.switch_lamp(False)
        clock.spend(2.0)
        glow[state] = middle(shot(room, clock))
    assert glow["closed"] > 1000
    assert glow["open"] == pytest.approx(0, abs=3)


def test_a_shield_keeps_the_lamp_away() -> None:
    found = []
    for pulses in ([], [to_closed(0.1)]):
        room, clock = room_with(pulses, shield={"channel": 1})
        clock.spend(2.0)
        room.switch_lamp(True)
        clock.spend(300.0)
        lit = middle(shot(room, clock, 2**-6))
        room.switch_lamp(False)
        clock.spend(3.0)
        found.append((lit, middle(shot(room, clock))))
    (lit, glow), covered = found
    assert lit > 1000
    assert glow > 1000
    assert covered == pytest.approx((0, 0), abs=3)


def test_the_servos_frame_is_different_each_time_and_the_same_for_a_seed() -> None:
    def starts(seed: int) -> list[float]:
        content = {**SMALL, "seed": seed, "door": {}}
        with open_room(content, "rig.yaml") as opened:
            line = serial.serial_for_url("sim://room/servo", timeout=0)
            found = []
            for number in range(20):
                opened.clock.spend(2.0)
                asked_s = opened.clock.now()
                line.write(pulse_command(0, (1000 if number % 2 else 2000) * 4))
                opened.clock.spend(1.0)
                assert opened.room.door is not None
                found.append(opened.room.door.swings[-1].start_s - asked_s)
            return found

    once, again, other = starts(1), starts(1), starts(2)
    assert once == again != other
    assert all(0 <= start_s <= FRAME_S + 1e-3 for start_s in once)
    assert max(once) - min(once) > FRAME_S / 2


def pulse_command(channel: int, quarters: int) -> bytes:
    return bytes((0x84, channel, quarters & 0x7F, quarters >> 7))


def test_the_boards_time_out_closes_the_door_even_if_nobody_asks_it() -> None:
    content = {**SMALL, "door": {}, "servo": {"time_out": "5 s"}, "initial": {"concentration": 0.5}}
    with open_room(content, "rig.yaml") as opened:
        line = serial.serial_for_url("sim://room/servo", timeout=0)
        line.write(pulse_command(0, 8000))
        opened.clock.spend(2.0)
        lit = middle(shot(opened.room, opened.clock))
        opened.clock.spend(5.0)
        hidden = middle(shot(opened.room, opened.clock))
    assert lit > 1000
    assert hidden == pytest.approx(0, abs=3)


@pytest.mark.parametrize(
    ("board", "other"), [("relays", "lcus"), ("lcus", "arduino"), ("arduino", "relays")]
)
def test_the_lamp_hangs_on_the_board_that_is_named(board: str, other: str) -> None:
    off = {"relays": b"relay off 0\r", "lcus": bytes.fromhex("A00100A1"), "arduino": b"off 0\n"}
    on = {"relays": b"relay on 0\r", "lcus": bytes.fromhex("A00101A2"), "arduino": b"on 0\n"}
    content = {**SMALL, "lamp": {"board": board}, "initial": {"lamp": "on"}}
    with open_room(content, "rig.yaml") as opened:
        assert opened.room.lamp_on
        line, other_line = (
            serial.serial_for_url(f"sim://room/{name}", timeout=0) for name in (board, other)
        )
        told = [
            (line, off[board]), (other_line, on[other]), (line, on[board]), (other_line, off[other])
        ]  # fmt: skip
        fed = []
        for port, command in told:
            port.write(command)
            fed.append(opened.room.lamp_on)
    assert fed == [False, False, True, True], "the other board's relays carry nothing"


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ({"faults": ["door_stuck"]}, "a fault of the door needs a 'door:'"),
        ({"door": {}, "shield": {}}, "on two channels of the servo board"),
        ({"door": {"open": "1000 us"}}, "two different pulses"),
        ({"door": {"travl": "1 s"}}, "did you mean 'travel'?"),
    ],
)
def test_mistakes_are_named(content: dict[str, Any], said: str) -> None:
    with pytest.raises(UsageError) as refusal:
        validate({**SMALL, **content}, Simulation, "rig.yaml")
    assert said in str(refusal.value)
