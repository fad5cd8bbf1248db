"""`labrig verify`: a run is as it was recorded, or what was changed is named."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from labrig.cli import guarded
from labrig.record import read_run
from tests.conftest import Ended, write_short_decay, write_small_rig
from tests.resealed import reseal

Labrig = Callable[..., Ended]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short decay with its result."""
    folder = tmp_path_factory.mktemp("recorded")
    rig, protocol = write_small_rig(folder / "rig.yaml"), folder / "decay.yaml"
    write_short_decay(protocol)
    assert not guarded(["run", str(protocol), "--rig", str(rig), "--runs", str(folder / "runs")])
    (made,) = (folder / "runs").iterdir()
    return made


@pytest.fixture
def run(recorded: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(recorded, tmp_path / "run"))


def test_a_run_as_it_was_recorded_is_intact(labrig: Labrig, run: Path) -> None:
    ended = labrig("verify", run)
    assert (ended.code, ended.err) == (0, "")
    assert read_run(run).seal in ended.out
    assert str(len(list((run / "frames").iterdir()))) in ended.out


def lengthen_an_exposure(journal: Path) -> None:
    lines = journal.read_text().splitlines(keepends=True)
    place = next(n for n, line in enumerate(lines) if '"exposure_s": 1.0' in line)
    lines[place] = lines[place].replace('"exposure_s": 1.0', '"exposure_s": 1.03')
    journal.write_text("".join(lines))


def test_a_changed_line_is_named_by_every_command(labrig: Labrig, run: Path) -> None:
    lengthen_an_exposure(run / "journal.jsonl")
    for command in ("verify", "process", "resume"):
        ended = labrig(command, run)
        assert ended.code == 4
        assert "does not follow line" in ended.err
        assert len(ended.err.splitlines()) == 1


def test_a_journal_that_is_sealed_anew_no_longer_belongs_to_the_result(
    labrig: Labrig, run: Path
) -> None:
    seal = read_run(run).seal
    lengthen_an_exposure(run / "journal.jsonl")
    reseal(run / "journal.jsonl")
    ended = labrig("verify", run)
    assert ended.code == 4
    assert "of another journal" in ended.err
    assert seal not in ended.out


def test_a_changed_frame_is_named_though_it_looks_untouched(labrig: Labrig, run: Path) -> None:
    frame = read_run(run).frames("decay")[0].path
    content = frame.read_bytes()
    frame.write_bytes(content[:-1] + bytes([content[-1] ^ 1]))
    checked = run / "cache" / "checked_frames.json"
    states, status = json.loads(checked.read_text()), frame.stat()
    states[frame.name][:2] = [status.st_size, status.st_mtime_ns]
    checked.write_text(json.dumps(states))
    ended = labrig("verify", run)
    assert ended.code == 4
    assert frame.name in ended.err


def test_a_run_that_goes_on_is_sealed_at_every_line(labrig: Labrig, run: Path) -> None:
    journal = run / "journal.jsonl"
    lines = journal.read_bytes().splitlines(keepends=True)
    journal.write_bytes(b"".join(lines[: len(lines) // 2]))
    shutil.rmtree(run / "result")
    assert labrig("resume", run).code == 0
    assert labrig("verify", run).code == 0
