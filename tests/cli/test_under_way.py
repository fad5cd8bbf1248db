"""The line that shows long work: on a terminal only, erased before anything else is written."""

import io
import os
import pty
import sys
import time

import pytest

from labrig.cli.under_way import EMPTY_LINE, PATIENCE_S, PERIOD_S, showing_work, work_text
from labrig.foundation.activity import Activity, activity, checking, counted, under_way
from labrig.foundation.clock import Interrupted, VirtualClock


def test_the_line_has_parts_counts_and_the_time_left() -> None:
    work = [
        Activity("processing", began_s=0.0),
        Activity("analysing parts", 9, 4, began_s=1.0),
        Activity("reducing frames", 100, 25, began_s=10.0),
    ]
    line = work_text(work, 20.0)
    assert "analysing parts, 5 of 9" in line
    assert "reducing frames, 25 of 100, 30 s left" in line
    assert line.endswith("20 s so far")


def test_no_time_is_foretold_at_once() -> None:
    assert "left" not in work_text([Activity("reducing", 100, 1, began_s=0.0)], 0.5)


def test_a_pipe_gets_no_line(monkeypatch: pytest.MonkeyPatch) -> None:
    err = io.StringIO()
    monkeypatch.setattr(sys, "stderr", err)
    with showing_work(["process"]):
        assert under_way() == ()
    assert err.getvalue() == ""


def test_a_terminal_gets_a_line_that_makes_room(monkeypatch: pytest.MonkeyPatch) -> None:
    ours, theirs = pty.openpty()
    with os.fdopen(theirs, "w", buffering=1) as err:
        monkeypatch.setattr(sys, "stderr", err)
        with showing_work(["process"]):
            time.sleep(PATIENCE_S + 3 * PERIOD_S)
            print("note: done", file=sys.stderr)
        shown = ""
        while "note: done\r\n" not in shown:  # a terminal gives what it has, in parts
            shown += os.read(ours, 100_000).decode()
    os.close(ours)
    line, _, note = shown.rpartition(EMPTY_LINE)
    assert "labrig process; " in line
    assert note == "note: done\r\n"


def test_work_that_is_counted_can_be_interrupted() -> None:
    clock, read = VirtualClock(), []

    def work() -> None:
        for number in counted(range(100), "reading frames"):
            read.append(number)
            if number == 4:
                clock.interrupt(2)

    with checking(lambda: clock.sleep(0.0)), pytest.raises(Interrupted):
        work()
    assert read == [0, 1, 2, 3, 4]
    assert under_way() == ()


def test_work_that_fails_is_no_longer_under_way() -> None:
    with pytest.raises(ValueError, match="no number"), activity("fitting"):
        raise ValueError("no number")
    assert under_way() == ()
