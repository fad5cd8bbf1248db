"""Lamp, shield and door in the report: when they began, against when they were to begin."""

import pytest

from labrig.record import ActionRecord
from labrig.report.timing import moves_text


def move(device: str, action: str, late_s: float, unit: str = "decay-1") -> ActionRecord:
    return ActionRecord(unit, device, action, 1.8e9, 1.8e9, late_s)


IN_TIME = [move("lamp", "off", 0.0), move("shield", "cover", 0.0052), move("door", "open", 0.0)]
#: Done at once, not at a time: nobody asks how late.
AT_ONCE = [move("lamp", "on", 0.0), move("door", "close", 0.0), move("person", "sample", 0.0)]


def test_every_kind_of_move_is_reported_with_its_worst() -> None:
    moves = [*AT_ONCE, *IN_TIME, move("shield", "cover", 0.0011, "decay-2")]
    assert moves_text(moves) == (
        "Begun after its planned time: lamp off at most 0 ms, shield cover at most 5.2 ms "
        "(decay-1), door open at most 0 ms."
    )


def test_a_door_that_missed_its_time_is_counted_and_named() -> None:
    said = moves_text([*IN_TIME, move("door", "open", 0.038, "decay-2")])
    assert "door open at most 38 ms (decay-2)" in said
    assert "1 of 4 began more than 20 ms late" in said


@pytest.mark.parametrize("moves", [[], AT_ONCE[:1], [move("lamp", "off", 0.0)]])
def test_a_lamp_alone_that_goes_off_in_time_is_not_worth_a_word(moves: list[ActionRecord]) -> None:
    assert moves_text(moves) == ""


def test_a_lamp_alone_that_goes_off_late_is() -> None:
    assert "lamp off at most 30 ms (decay-1)" in moves_text([move("lamp", "off", 0.03)])
