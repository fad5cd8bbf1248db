"""Frames are reduced while their run is recorded, by a process on which nothing depends."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from labrig.foundation.errors import DataError
from labrig.process import process_run, reduced_ahead
from labrig.process.run import process_so_far
from labrig.record import RunSize, read_run
from labrig.reduce import WORTHWHILE_BYTES, RawFrame, read_raw
from tests.analyse.recorded import recorded, shipped_rig
from tests.conftest import SHORT_DECAY
from tests.lit_bench import started_with
from tests.replayed import Replay

PATIENCE_S = 60.0
#: Dark frames and most of the glow: 12 of 16 frames.
BEGUN = 12
#: A run that is worth a process, and one that is not.
LARGE, SMALL = (RunSize(10, size_bytes, 0) for size_bytes in (WORTHWHILE_BYTES, 1_000_000))


@pytest.fixture
def run(tmp_path: Path) -> Path:
    return recorded(tmp_path / "bench", SHORT_DECAY, shipped_rig("sim"))


def decoded(monkeypatch: pytest.MonkeyPatch, act: Callable[[], object]) -> set[str]:
    """Names of the frames that are decoded meanwhile."""
    names: list[str] = []

    def read(path: Path) -> RawFrame:
        names.append(path.name)
        return read_raw(path)

    with monkeypatch.context() as patched:
        patched.setattr("labrig.reduce.workers.pool.read_raw", read)
        act()
    return set(names)


def test_only_the_last_frames_are_left_to_reduce(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    replay = Replay(run, tmp_path / "again" / run.name)
    replay.go_on(BEGUN)
    begun = {path.name for path in (replay.folder / "frames").iterdir()}
    attempts = read_run(replay.folder).attempts
    process_so_far(replay.folder)
    assert read_run(replay.folder).attempts == attempts
    assert attempts[-1].exit_status is None
    assert not (replay.folder / "result").exists()

    replay.go_on()
    # Which frames are shown depends on the whole run; no other one is decoded twice.
    shown = decoded(monkeypatch, lambda: process_run(replay.folder)) & begun
    all_of_it = decoded(monkeypatch, lambda: process_run(run))
    assert len(shown) <= 3 < len(all_of_it & begun)
    result = "result/result.json"
    assert (replay.folder / result).read_bytes() == (run / result).read_bytes()


def test_a_run_of_which_there_is_too_little(run: Path, tmp_path: Path) -> None:
    replay = Replay(run, tmp_path / "again" / run.name)
    replay.go_on(3)
    with pytest.raises(DataError, match="no decay is complete"):
        process_so_far(replay.folder)
    replay.go_on()
    assert process_run(replay.folder).failures() == ()


@pytest.mark.skipif(sys.platform != "linux", reason="finds processes in /proc")
def test_it_ends_however_the_run_ends_and_loses_nothing(run: Path, tmp_path: Path) -> None:
    replay = Replay(run, tmp_path / "again" / run.name)
    replay.go_on(BEGUN)
    script = (
        "import time; from pathlib import Path; from labrig.process import reduced_ahead; "
        "from labrig.record import RunSize\n"
        "with reduced_ahead() as begun:\n"
        f"    begun(Path({str(replay.folder)!r}), {LARGE!r})\n"
        f"    time.sleep({PATIENCE_S})\n"
    )
    recording = subprocess.Popen([sys.executable, "-c", script])
    wait_until(lambda: any((replay.folder / "cache").glob("MeasureRegions-*")))
    (ahead,) = processes_of(replay.folder) - {recording.pid}
    assert os.getpriority(os.PRIO_PROCESS, ahead) == 19
    recording.send_signal(signal.SIGKILL)
    recording.wait()
    wait_until(lambda: not processes_of(replay.folder))
    replay.go_on()
    result = process_run(replay.folder)
    assert result.to_json() == process_run(run).to_json()


@pytest.mark.parametrize(("wanted", "size"), [(False, LARGE), (True, SMALL)])
def test_no_process_where_it_is_not_wanted_or_not_worth_it(
    run: Path, *, wanted: bool, size: RunSize
) -> None:
    with reduced_ahead(wanted=wanted) as begun:
        begun(run, size)
        assert not processes_of(run)


def test_a_run_goes_on_where_the_system_starts_no_process(
    run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_room(*_: object, **__: object) -> None:
        raise BlockingIOError("Resource temporarily unavailable")

    monkeypatch.setattr("labrig.foundation.own_process.subprocess.Popen", no_room)
    with reduced_ahead() as begun:
        begun(run, LARGE)


def wait_until(is_so: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not is_so():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def processes_of(run: Path) -> set[int]:
    """Processes, other than this one, whose command line names a run."""
    return {int(process.name) for process in started_with(bytes(run))} - {os.getpid()}
