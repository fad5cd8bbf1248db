"""The question at the terminal, and `--yes` where the simulated room's changer does the work."""

import os
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import TextIO

import pytest

from labrig.acquire import (
    LAMP_OFF,
    LAMP_ON,
    ExposureSettings,
    ManualStep,
    ProtocolModel,
    Session,
    TakeFrame,
    Unit,
    plan,
    read_rig_file,
)
from labrig.bench import Recording
from labrig.bench.found_calibrations import FoundCalibrations
from labrig.cli.progress import MAX_AT_ONCE, Terminal, progress
from labrig.foundation.clock import Interrupted
from labrig.foundation.errors import UsageError
from labrig.record import read_run
from tests.frame_middle import middle_dn
from tests.quick_yaml import read_quickly, write_quickly

STEP = ManualStep("put filter 37 in", "its transmission is measured", "filter 37")


def nothing() -> None:
    pass


@pytest.fixture
def typed(monkeypatch: pytest.MonkeyPatch) -> Iterator[TextIO]:
    """The keyboard of the person at the terminal."""
    reading, writing = os.pipe()
    with os.fdopen(reading) as source, os.fdopen(writing, "w", buffering=1) as keyboard:
        monkeypatch.setattr("sys.stdin", source)
        yield keyboard


def test_enter_a_remark_or_a_step_back(typed: TextIO, capfd: pytest.CaptureFixture[str]) -> None:
    terminal = Terminal()
    answers = iter(["\n", "a bit dusty\n", "undo\n"])

    def answer() -> None:
        typed.write(next(answers, ""))

    given = [terminal.ask(STEP, "put filter 36 in", 4000.0, answer) for _ in range(3)]
    assert given == ["", "a bit dusty", None]
    said = capfd.readouterr().err
    assert "by hand: put filter 37 in" in said
    assert "why: its transmission is measured; 1 h 7 min of lab time left" in said
    assert "undo (do again: put filter 36 in)" in said


def test_nothing_to_take_back_is_reported(typed: TextIO, capfd: pytest.CaptureFixture[str]) -> None:
    typed.write("")
    answers = iter(["undo\n", "\n"])
    assert Terminal().ask(STEP, None, 60.0, lambda: void(typed.write(next(answers, "")))) == ""
    assert "nothing to take back" in capfd.readouterr().err


def void(_: object) -> None:
    pass


def test_an_input_that_has_ended_is_reported(typed: TextIO) -> None:
    typed.close()
    terminal = Terminal()
    for _ in range(2):  # the end may have been read before the question
        with pytest.raises(UsageError, match="nobody can answer here"):
            terminal.ask(STEP, None, 60.0, nothing)


def test_ctrl_c_is_answered_while_nobody_types(typed: TextIO) -> None:
    def stop() -> None:
        raise Interrupted(2)

    with pytest.raises(Interrupted):
        Terminal().ask(STEP, None, 60.0, stop)


def test_answers_without_end_neither_pile_up_nor_go_unsaid(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """As of `yes "" | labrig run`: faster than any step."""

    class Endless:
        lines = 0

        def readline(self) -> str:
            self.lines += 1
            return "\n"

    source = Endless()
    monkeypatch.setattr("sys.stdin", source)
    terminal = Terminal()
    for _ in range(MAX_AT_ONCE + 2):
        assert terminal.ask(STEP, None, 60.0, nothing) == ""
    assert source.lines < 10 * MAX_AT_ONCE
    assert capfd.readouterr().err.count("no person does that") == 1


def test_answers_without_end_do_not_keep_a_signal_away(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdin", SimpleNamespace(readline=lambda: "undo\n"))

    def stop() -> None:
        raise Interrupted(2)

    with pytest.raises(Interrupted):
        Terminal().ask(STEP, None, 60.0, stop)


class Piece:
    """A fresh sample, charged for a minute and photographed; it was dark before."""

    def __init__(self, number: int) -> None:
        self.name = f"sample-{number}"
        self.frame = ExposureSettings(1.0, 400, 4.0)

    def run(self, session: Session) -> None:
        session.ask(ManualStep("put a fresh sample in", "it must not glow", "fresh sample", 40.0))
        session.perform(TakeFrame("before", self.frame))
        session.perform(LAMP_ON)
        session.wait(60.0, "charging")
        session.perform(LAMP_OFF)
        session.wait(1.0, "lamp fades")
        session.perform(TakeFrame("after", self.frame))


class Pieces(ProtocolModel):
    """Two samples."""

    def units(self) -> Sequence[Unit]:
        return [Piece(1), Piece(2)]


@pytest.fixture
def recording(make_rig: Callable[..., Path], tmp_path: Path) -> Callable[..., Recording]:
    def make(devices: dict[str, object]) -> Recording:
        path = make_rig()
        content = read_quickly(path.read_text())
        content["devices"] |= devices
        content["devices"]["camera"]["warm_up"] = "0 s"
        content["simulation"]["epoch"] = "2026-01-01T00:00:00Z"
        path.write_text(write_quickly(content))
        protocol, rig = Pieces(protocol="pieces"), read_rig_file(path)
        return Recording(
            protocol,
            rig,
            path,
            tmp_path / "runs",
            plan(protocol, rig, str(path)),
            FoundCalibrations(rig, {}, ()),
        )

    return make


def test_simulated_hands_change_the_sample(recording: Callable[..., Recording]) -> None:
    prepared = recording({"changer": {"driver": "text_changer", "address": "sim://room/changer"}})
    assert prepared.plan.manual_steps == ("put a fresh sample in",) * 2
    folder = prepared.record(partial(progress, yes=True, has_changer=True))
    record = read_run(folder)
    before, after = record.frames("before"), record.frames("after")
    assert [middle_dn(frame.path) for frame in before] == pytest.approx([0, 0], abs=3)
    assert all(middle_dn(frame.path) > 300 for frame in after)
    (asked,) = [a for a in record.completed()["sample-2"].actions if a.is_manual]
    assert asked.end_time - asked.start_time == pytest.approx(40.0, abs=0.1)


def test_yes_without_hands_is_refused_before_anything_moves(
    recording: Callable[..., Recording],
) -> None:
    prepared = recording({})
    with pytest.raises(UsageError) as refusal:
        prepared.record(partial(progress, yes=True, has_changer=False))
    assert "2 steps are done by hand, such as 'put a fresh sample in'" in str(refusal.value)
    assert list(prepared.runs.iterdir()) == []


def test_a_person_at_a_simulated_rig(
    recording: Callable[..., Recording], typed: TextIO, capfd: pytest.CaptureFixture[str]
) -> None:
    prepared = recording({})
    typed.close()
    with pytest.raises(UsageError, match="nobody can answer here"):
        prepared.record(progress)
    (folder,) = prepared.runs.iterdir()
    (attempt,) = read_run(folder).attempts
    assert attempt.exit_status == "fail"
