"""What the journal tells besides its frames, and how it comes to be in the report."""

from collections.abc import Callable
from html import unescape
from pathlib import Path

import pytest

from labrig.record import ActionRecord, Attempt, FrameRecord, RunRecord
from labrig.record.history import charge_durations_s, interruptions
from labrig.report.run_sections import lamp_sections
from tests.conftest import Ended

Labrig = Callable[..., Ended]
Make = Callable[..., Path]


def lamp(action: str, time: float) -> ActionRecord:
    """Switched in a transaction of 20 ms, in its middle."""
    return ActionRecord("decay-1", "lamp", action, time - 0.01, time + 0.01, 0.0)


def taken(role: str, time: float) -> FrameRecord:
    return FrameRecord(
        Path(f"{time}.dng"), "", 1, "decay-1", role, 1.0, 400, 4.0, time, time + 1, 0.0
    )


def attempt(
    frames: list[FrameRecord], actions: list[ActionRecord], status: str | None = "success"
) -> Attempt:
    start = {"unit": "decay-1", "time": 1767225600.0}
    reason = "" if status is None else "unplugged"
    return Attempt("uid", "decay-1", start, status, reason, frames, actions)


def run_of(*attempts: Attempt) -> RunRecord:
    return RunRecord(Path("run"), list(attempts), torn=False, last_time=0.0)


def test_looks_at_the_glow_are_no_charge() -> None:
    plateau = attempt(
        [taken("plateau", 301.0), taken("decay", 700.0), taken("decay", 705.0)],
        [lamp("on", 0), lamp("off", 300), lamp("on", 302), lamp("off", 699), lamp("on", 800)],
    )
    assert charge_durations_s(run_of(plateau)) == pytest.approx([300 + 397])


def test_a_lamp_that_is_switched_on_twice_has_burnt_since_the_first_time() -> None:
    twice = attempt([taken("decay", 301.0)], [lamp("on", 0), lamp("on", 100), lamp("off", 300)])
    assert charge_durations_s(run_of(twice)) == pytest.approx([300])


def test_a_relay_switches_in_the_middle_of_its_transaction() -> None:
    slow = ActionRecord("decay-1", "lamp", "off", 299.0, 301.0, 0.0)
    assert slow.middle_time == 300
    one = attempt([taken("decay", 301.0)], [lamp("on", 0), slow])
    assert charge_durations_s(run_of(one)) == pytest.approx([300])


def test_units_without_a_decay_and_failed_ones_have_no_charge() -> None:
    dark = attempt([taken("dark", 0.0)], [lamp("off", 0)])
    failed = attempt([taken("decay", 11.0)], [lamp("on", 0), lamp("off", 10)], "fail")
    assert charge_durations_s(run_of(dark, failed)) == ()


def test_attempts_that_did_not_count_are_reported() -> None:
    told = interruptions(run_of(attempt([], [], "fail"), attempt([], []), attempt([], [], None)))
    assert [one.reason for one in told] == ["unplugged", "labrig was cut off"]
    assert {(one.unit, one.began) for one in told} == {("decay-1", "2026-01-01 00:00:00 UTC")}


@pytest.mark.parametrize(
    ("reads_back", "said"),
    [(True, "nothing else had switched it"), (False, "does not report its state"), (None, "")],
)
def test_whether_the_lamp_was_read_back_is_reported(reads_back: bool | None, said: str) -> None:
    charged = attempt([taken("decay", 11.0)], [lamp("on", 0), lamp("off", 10)])
    charged.start["lamp_reads_back"] = reads_back
    told = [text for section in lamp_sections(run_of(charged)) for text in section.text]
    assert len(told) == (reads_back is not None)
    assert all(said in text for text in told)


def test_without_a_lamp_nothing_is_reported_of_it() -> None:
    dark = attempt([taken("dark", 0.0)], [])
    dark.start["lamp_reads_back"] = True
    assert lamp_sections(run_of(dark)) == ()


def test_the_report_says_what_was_done(
    labrig: Labrig, make_rig: Make, make_protocol: Make, tmp_path: Path
) -> None:
    ended = labrig("run", make_protocol(), "--rig", make_rig(), "--runs", tmp_path / "runs")
    run = ended.run_folder
    assert labrig("note", run, "the door was <open>").code == 0
    assert labrig("process", run, "--states", "1").code == 0
    text = unescape((run / "result" / "report.html").read_text(encoding="utf-8"))
    for expected in (
        "the door was <open>",
        # Asked for were 10 min; the lamp takes 15 min to warm up.
        "was charged under the lamp for 15 min.",
        "took 12 RAW frames, each exposed for 1 s, at random times, one every 5 s in the mean",
        "averaged over a region of the frame of 48 × 32 pixels",
        "(4 dark frames of 1 s, taken before the decay)",
        "The number of states was set to 1.",
        "The lamp's relay was read back about once a minute",
    ):
        assert expected in text
