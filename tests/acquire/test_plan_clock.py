"""The position of a run in its plan, by what begins and when."""

import pytest
from hypothesis import given, strategies as st

from labrig.acquire import (
    CameraCapabilities,
    Plan,
    PlanClock,
    Step,
    plan,
    read_protocol,
    read_rig_file,
)
from labrig.foundation import resources
from labrig.record import PERSON

STEPS = (
    Step(0.0, "dark", PERSON, "close the door"),
    Step(60.0, "dark", "-", "warming up, 2 min", lasts_s=120.0),
    Step(180.0, "dark", "camera", "dark frame, 1 s ISO 400 f/4", 1.0),
    Step(182.0, "glow", "lamp", "on"),
    Step(182.0, "glow", "-", "charging, 10 min", lasts_s=600.0),
    Step(782.0, "glow", "lamp", "off"),
    Step(783.0, "glow", "camera", "decay frame, 1 s ISO 400 f/4", 1.0),
    Step(793.0, "glow", "camera", "decay frame, 1 s ISO 400 f/4", 1.0),
    Step(800.0, "glow", PERSON, "take the card away"),
)
ENDS_S = (182.0, 860.0)


def made(drawn: frozenset[str] = frozenset()) -> PlanClock:
    return PlanClock(Plan(STEPS, ("dark", "glow"), ENDS_S, CameraCapabilities((), ()), drawn=drawn))


def test_a_person_who_takes_longer_stops_the_clock() -> None:
    clock = made()
    clock.begin_unit("dark", 1000.0)
    clock.begin_step("by hand: close the door, it is windy", 1000.0)
    assert clock.left_s(1030.0) == pytest.approx(830.0)
    assert clock.left_s(5000.0) == clock.left_s(9000.0) == pytest.approx(860.0 - 180.0)
    clock.begin_wait("warming up, 2 min", 9000.0, 9120.0)
    assert clock.left_s(9000.0) == pytest.approx(800.0)


@given(st.floats(0.0, 3600.0))
def test_a_wait_ends_when_it_says(lasts_s: float) -> None:
    clock = made()
    clock.begin_unit("glow", 0.0)
    clock.begin_step("lamp on", 0.0)
    clock.begin_wait("charging, 10 min", 0.0, lasts_s)
    assert clock.left_s(0.0) == pytest.approx(lasts_s + 860.0 - 782.0)
    due = clock.next_by_hand(0.0)
    assert due is not None
    assert due.in_s == pytest.approx(lasts_s + 18.0)


def test_what_a_choice_leaves_out_is_skipped() -> None:
    clock = made()
    clock.begin_unit("glow", 0.0)
    clock.begin_step("lamp off", 30.0)
    assert clock.left_s(30.0) == pytest.approx(78.0)
    clock.begin_step("look frame, 1 s ISO 400 f/4", 31.0)  # it is not in the plan
    assert clock.left_s(31.0) == pytest.approx(77.0)


def test_random_times_do_not_move_the_clock() -> None:
    even, drawn = made(), made(frozenset({"glow"}))
    for clock in (even, drawn):
        clock.begin_unit("glow", 0.0)
        clock.begin_step("lamp off", 600.0)
        clock.begin_step("decay frame, 1 s ISO 400 f/4", 601.0)
        clock.begin_step("decay frame, 1 s ISO 400 f/4", 605.0)
    assert even.left_s(605.0) == pytest.approx(860.0 - 793.0)
    assert drawn.left_s(605.0) == pytest.approx(860.0 - 782.0 - 5.0)


def test_a_step_by_hand_of_a_later_unit_is_announced() -> None:
    clock = made()
    clock.begin_unit("dark", 0.0)
    clock.begin_step("by hand: close the door", 0.0)
    due = clock.next_by_hand(10.0)
    assert due is not None
    assert due.what == "take the card away"
    assert due.in_s == pytest.approx(790.0)


def test_a_plan_counts_every_change_of_settings_as_the_rig_declares_it() -> None:
    rig = read_rig_file(resources.find("config", "rig", "sim"))
    protocol = read_protocol(resources.find("protocols", "protocol", "camera_calibration"))
    camera = rig.devices["camera"].model_copy(update={"change_time": "100 ms"})
    slow = rig.model_copy(update={"devices": {**rig.devices, "camera": camera}})
    plain = plan(protocol, rig, "rig.yaml")
    added_s = plan(protocol, slow, "rig.yaml").duration_s - plain.duration_s
    assert added_s == pytest.approx(0.1 * round(added_s / 0.1))
    assert plain.frames / 3 < added_s / 0.1 < plain.frames
