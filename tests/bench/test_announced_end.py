"""The end that the clock of the plan announces when a run that was cut off goes on."""

import random
import shutil
from pathlib import Path

import pytest

from labrig.acquire import runner
from labrig.bench import resume_run
from labrig.record import read_run
from tests.acceptance.announced_end import LARGEST_S, Listener, as_planned, cut, listening, recorded

CUTS = 3


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run with a warm-up of 20 min, steps by hand, and a lamp that burns from unit to unit."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(runner._Recorder, "decide", as_planned)
        return recorded(tmp_path_factory.mktemp("ends"), "blank", {})


def resumed(run: Path, copy: Path, seed: int) -> tuple[Path, Listener]:
    """The run after a cut at a random moment, and what was announced in it."""
    listeners: list[Listener] = []
    folder = cut(run, copy, random.Random(seed))
    resume_run(folder, listening(listeners))
    return folder, listeners[0]


@pytest.mark.parametrize("seed", range(CUTS))
def test_the_announced_end_is_the_true_one(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    monkeypatch.setattr(runner._Recorder, "decide", as_planned)
    folder, listener = resumed(run, tmp_path / "run", seed)
    assert listener.ends_s
    assert max(map(abs, listener.late_ends_s(folder))) < LARGEST_S
    assert listener.late_hands_s
    assert max(map(abs, listener.late_hands_s)) < LARGEST_S


def test_devices_warm_up_again_after_a_resume(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(runner._Recorder, "decide", as_planned)
    copy = shutil.copytree(run, tmp_path / "run")
    lines = (copy / "journal.jsonl").read_bytes().splitlines(keepends=True)
    stop = next(n for n, line in enumerate(lines) if b'"success"' in line)
    (copy / "journal.jsonl").write_bytes(b"".join(lines[: stop + 1]))
    (first,) = read_run(copy).completed().values()
    for frame in set((copy / "frames").iterdir()) - {each.path for each in first.files}:
        frame.unlink()
    listeners: list[Listener] = []
    resume_run(copy, listening(listeners))
    first_left_s = listeners[0].ends_s[0]
    assert first_left_s > 20 * 60.0, "the warm-up of the camera counts"
    assert abs(listeners[0].late_ends_s(copy)[0]) < LARGEST_S


def test_frames_are_counted_over_all_units(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(runner._Recorder, "decide", as_planned)
    folder, listener = resumed(run, tmp_path / "run", 2)
    clock = listener.plan_clock
    completed = read_run(folder).completed().values()
    assert clock.frames == clock.most_frames == sum(len(each.frames) for each in completed)
