"""The log of a run: in its folder, and at the terminal for who wants to see it."""

import io
import logging
import re
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import pytest

from labrig.bench import logging_to
from labrig.foundation.clock import VirtualClock
from labrig.record import read_run
from tests.conftest import Ended

Labrig = Callable[..., Ended]
Make = Callable[..., Path]

pytestmark = pytest.mark.usefixtures("logged")

LINE = re.compile(
    r"(\d{4}-\d\d-\d\d \d\d:\d\d:\d\d\.\d{3}) (DEBUG|INFO|WARNING|ERROR) +(\S+): (.+)"
)


def lines_of(text: str) -> list[tuple[datetime, str, str, str]]:
    parsed = [LINE.fullmatch(line) for line in text.splitlines()]
    assert all(parsed), text
    return [
        (datetime.fromisoformat(match[1]).replace(tzinfo=UTC), match[2], match[3], match[4])
        for match in parsed
        if match is not None
    ]


def test_the_log_has_every_action_frame_and_command(
    labrig: Labrig, make_rig: Make, make_protocol: Make, tmp_path: Path
) -> None:
    command = ["run", make_protocol(), "--rig", make_rig(), "--runs", tmp_path, "--no-process"]
    ended = labrig(*command, "--verbose")
    assert ended.code == 0, ended.err
    log = (ended.run_folder / "log.txt").read_text(encoding="utf-8")
    told = lines_of(log)
    attempts = read_run(ended.run_folder).completed().values()
    actions = [f"{act.device}: {act.action}" for attempt in attempts for act in attempt.actions]
    logged = [message for _, _, place, message in told if place == "acquire.runner"]
    assert logged == actions
    frames = [frame.path.name for attempt in attempts for frame in attempt.frames]
    assert [message[6:16] for *_, message in told if message.startswith("frame 0")] == frames
    assert any("relay on 0" in message for *_, message in told)
    assert any("RemoteReleaseOn" in message for *_, message in told)
    # on the clock of the rig, as the journal is
    times = [time for time, *_ in told]
    assert times == sorted(times)
    begun = next(iter(attempts)).start["time"]
    assert abs((times[0] - datetime.fromtimestamp(begun, UTC)).total_seconds()) < 5
    # what is printed is what is kept
    assert set(lines_of(log)) >= set(lines_of(ended.err))
    assert len(lines_of(ended.err)) > len(actions) + len(frames)


def test_a_run_that_fails_and_is_resumed_has_one_log(
    labrig: Labrig, make_rig: Make, make_protocol: Make, tmp_path: Path
) -> None:
    rig = make_rig(faults=[{"camera_unplugged": {"at": "30 s"}}])
    ended = labrig("run", make_protocol(), "--rig", rig, "--runs", tmp_path, "--no-process")
    assert ended.code == 3
    (run,) = tmp_path.glob("*/protocol.yaml")
    log = run.with_name("log.txt")
    first = log.read_text(encoding="utf-8")
    assert lines_of(first)[-1][1] == "ERROR"
    labrig("resume", run.parent, "--no-process")
    assert log.read_text(encoding="utf-8").startswith(first)
    assert len(log.read_text(encoding="utf-8")) > len(first)


def test_a_log_that_cannot_be_written_stops_no_run(
    labrig: Labrig, make_rig: Make, make_protocol: Make, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    def full(handler: logging.FileHandler) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(logging.FileHandler, "_open", full)
    ended = labrig("run", make_protocol(), "--rig", make_rig(), "--runs", tmp_path, "--no-process")
    assert ended.code == 0, ended.err
    assert all(line.startswith("[") for line in ended.err.splitlines())


def test_a_library_that_logs_to_the_terminal_does_not_bring_the_log_there() -> None:
    terminal, kept = io.StringIO(), io.StringIO()
    theirs = logging.StreamHandler(terminal)
    logging.getLogger().addHandler(theirs)
    try:
        with logging_to(logging.StreamHandler(kept), VirtualClock()):
            logging.getLogger("labrig.drivers.board").debug("relay off 0")
        logging.getLogger("labrig.drivers.board").warning("after the run")
    finally:
        logging.getLogger().removeHandler(theirs)
    assert "relay off 0" in kept.getvalue()
    assert terminal.getvalue() == "after the run\n"
