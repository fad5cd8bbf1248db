"""Runs that are not finished: what is said of them, and what of a journal that lost lines."""

import json
import shutil
import socket
import threading
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import pytest

from labrig.bench.opening import _Connections
from labrig.bench.serial_ports import SerialPorts
from labrig.catalogue import summarise, unfinished
from labrig.foundation.clock import Interrupted, SystemClock
from labrig.record import read_run
from tests.conftest import Ended
from tests.quick_yaml import read_quickly, write_quickly

Labrig = Callable[..., Ended]
Make = Callable[..., Path]
PATIENCE_S = 20.0


@pytest.fixture
def run(labrig: Labrig, make_rig: Make, make_protocol: Make, tmp_path: Path) -> Path:
    """A run that is recorded."""
    ended = labrig(
        "run", make_protocol(), "--rig", make_rig(), "--runs", tmp_path / "runs", "--no-process"
    )
    assert ended.code == 0, ended.err
    return ended.run_folder


def shorten(run: Path, unit: str, torn: bytes = b"") -> list[str]:
    """Cut the journal at the start of a unit; return the names of frames that lost their lines."""
    lines = (run / "journal.jsonl").read_bytes().splitlines(keepends=True)
    start = next(n for n, line in enumerate(lines) if f'"unit": "{unit}"'.encode() in line)
    kept = b"".join(lines[: start + 1])
    (run / "journal.jsonl").write_bytes(kept + torn)
    return [path.name for path in (run / "frames").iterdir() if path.name.encode() not in kept]


def test_lost_lines_are_named_and_nothing_is_recorded_again_unasked(
    labrig: Labrig, run: Path
) -> None:
    lost = sorted(shorten(run, "decay-1"))
    before = (run / "journal.jsonl").read_bytes()
    refused = labrig("resume", run, "--no-process")
    assert refused.code == 2
    assert f"{len(lost)} frames have no line in it, {lost[0]} to {lost[-1]}" in refused.err
    assert (run / "journal.jsonl").read_bytes() == before
    ended = labrig("resume", run, "--no-process", "--yes")
    assert ended.code == 0, ended.err
    assert "its end was lost" in ended.err
    assert summarise(run).status == "recorded"
    assert {path.name for path in (run / "frames").iterdir()} > set(lost)


def test_a_line_that_a_crash_has_torn_is_said_and_the_run_goes_on(
    labrig: Labrig, run: Path
) -> None:
    for name in shorten(run, "decay-1", torn=b'{"name": "event", "doc": {"ti'):
        (run / "frames" / name).unlink()
    ended = labrig("resume", run, "--no-process")
    assert ended.code == 0, ended.err
    assert "last line is incomplete" in ended.err
    assert not read_run(run).torn


def test_an_unfinished_run_says_why_when_and_how_to_go_on(
    labrig: Labrig, make_rig: Make, make_protocol: Make, tmp_path: Path, run: Path
) -> None:
    assert f"labrig process {run}" in unfinished(summarise(run))[0]
    lost = shorten(run, "decay-1")
    (line,) = unfinished(summarise(run))
    assert f"{len(lost)} frames have no line in it" in line
    assert line.endswith(f"labrig resume {run} --yes")
    for name in lost:
        (run / "frames" / name).unlink()
    (line,) = unfinished(summarise(run))
    assert line.startswith("stopped in decay-1, after 2026-01-01 00:")
    assert "labrig was cut off" in line
    assert line.endswith(f"labrig resume {run}")
    rig = make_rig(faults=[{"relays_unplugged": {"at": "30 s"}}])
    failing = labrig("run", make_protocol(), "--rig", rig, "--runs", tmp_path / "failing")
    assert failing.code == 3
    (failed,) = (tmp_path / "failing").iterdir()
    (line,) = unfinished(summarise(failed))
    assert line.startswith("stopped in dark, at 2026-01-01 00:")
    assert (read_run(failed).attempts[-1].reason) in line
    shown = labrig("runs", "show", failed)
    assert line in shown.out
    about = json.loads(labrig("runs", "show", failed, "--json").out)
    assert about["unfinished"] == [line]


def test_an_edited_protocol_file_does_not_rename_a_run(labrig: Labrig, run: Path) -> None:
    recorded_as = summarise(run).sample
    shutil.copy(run / "protocol.yaml", run / "protocol.yaml.before")
    shorten(run, "decay-1")
    for path in (run / "frames").iterdir():
        if path.name > max(frame.path.name for frame in read_run(run).attempts[0].frames):
            path.unlink()
    content = read_quickly((run / "protocol.yaml").read_text(encoding="utf-8"))
    content["sample"]["name"] = "another paper"
    (run / "protocol.yaml").write_text(write_quickly(content), encoding="utf-8")
    summary = summarise(run)
    assert summary.sample == recorded_as
    assert labrig("resume", run, "--no-process").code == 0
    assert summarise(run).sample == recorded_as
    assert {attempt.start["sample"] for attempt in read_run(run).attempts} == {recorded_as}


def test_a_connection_that_nobody_answers_is_interrupted_at_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A host that drops everything keeps the system's own call for seconds."""
    clock, ended = SystemClock(), threading.Event()

    def connect(*arguments: object) -> socket.socket:
        clock.interrupt(2)
        ended.wait(PATIENCE_S)
        raise TimeoutError

    monkeypatch.setattr("socket.create_connection", connect)
    connections = _Connections(clock, None, ExitStack(), SerialPorts())
    began_s = clock.now()
    with pytest.raises(Interrupted):
        connections.tcp("ptpip://192.0.2.1", 15740)
    assert clock.now() - began_s < 1.0
    ended.set()
