"""`labrig verify`: a run is as it was recorded, or what was changed is named."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

from labrig.record import own_digest, read_run
from tests.conftest import Ended
from tests.resealed import reseal

Labrig = Callable[..., Ended]


def test_a_run_as_it_was_recorded_is_intact(labrig: Labrig, finished: Path) -> None:
    ended = labrig("verify", finished)
    assert (ended.code, ended.err) == (0, "")
    assert read_run(finished).seal in ended.out
    assert str(len(list((finished / "frames").iterdir()))) in ended.out


def lengthen_an_exposure(journal: Path) -> None:
    lines = journal.read_text(encoding="utf-8").splitlines(keepends=True)
    place = next(n for n, line in enumerate(lines) if '"exposure_s": 1.0' in line)
    lines[place] = lines[place].replace('"exposure_s": 1.0', '"exposure_s": 1.03')
    journal.write_text("".join(lines), encoding="utf-8")


def test_a_changed_line_is_named_by_every_command(labrig: Labrig, finished: Path) -> None:
    lengthen_an_exposure(finished / "journal.jsonl")
    for command in ("verify", "process", "resume"):
        ended = labrig(command, finished)
        assert ended.code == 4
        assert "does not follow line" in ended.err
        assert len(ended.err.splitlines()) == 1


def test_a_journal_that_is_sealed_anew_no_longer_belongs_to_the_result(
    labrig: Labrig, finished: Path
) -> None:
    seal = read_run(finished).seal
    lengthen_an_exposure(finished / "journal.jsonl")
    reseal(finished / "journal.jsonl")
    ended = labrig("verify", finished)
    assert ended.code == 4
    assert "of another journal" in ended.err
    assert seal not in ended.out


def test_a_changed_frame_is_named_though_it_looks_untouched(labrig: Labrig, finished: Path) -> None:
    frame = read_run(finished).frames("decay")[0].path
    content = frame.read_bytes()
    frame.write_bytes(content[:-1] + bytes([content[-1] ^ 1]))
    checked = finished / "cache" / "checked_frames.txt"
    states, status = json.loads(checked.read_text().partition("\n")[2]), frame.stat()
    states[frame.name][:2] = [status.st_size, status.st_mtime_ns]
    text = json.dumps(states)
    checked.write_text(f"{own_digest(text.encode())}\n{text}")
    ended = labrig("verify", finished)
    assert ended.code == 4
    assert frame.name in ended.err


def test_a_run_that_goes_on_is_sealed_at_every_line(labrig: Labrig, finished: Path) -> None:
    journal = finished / "journal.jsonl"
    lines = journal.read_bytes().splitlines(keepends=True)
    journal.write_bytes(b"".join(lines[: len(lines) // 2]))
    shutil.rmtree(finished / "result")
    assert labrig("resume", finished, "--yes").code == 0
    assert labrig("verify", finished).code == 0
