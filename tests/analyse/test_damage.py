"""Frames and journals that are not as they were recorded: one line, nothing counted wrongly."""

import json
import math
import re
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings, strategies as st

from labrig.analyse.frame_times import timing_warnings
from labrig.analyse.frames import IntactFrames, intact_frames
from labrig.analyse.overrides import Overrides
from labrig.foundation.errors import DataError, LabrigError
from labrig.record import read_run
from tests.conftest import Ended
from tests.resealed import reseal
from tests.warned import codes

Labrig = Callable[..., Ended]
RECORDED = Path(__file__).parent / "data" / "decay"
LINES = (RECORDED / "journal.jsonl").read_text(encoding="utf-8").splitlines()


@pytest.fixture
def run(tmp_path: Path) -> Path:
    return Path(shutil.copytree(RECORDED, tmp_path / "run"))


def one_line(ended: Ended, code: int, *said: str) -> None:
    assert ended.code == code, ended.err
    assert ended.err.count("\n") == 1, ended.err
    for text in said:
        assert text in ended.err


def change(frame: Path) -> None:
    content = bytearray(frame.read_bytes())
    content[-1] ^= 1
    frame.write_bytes(content)


def test_damaged_frames_are_named_and_the_others_can_be_used(labrig: Labrig, run: Path) -> None:
    dark, decay = run / "frames" / "000002.dng", run / "frames" / "000009.dng"
    change(dark)
    decay.unlink()
    one_line(
        labrig("process", run), 4,
        "000002.dng was changed", "checksum", "000009.dng is missing",
        "--exclude 000002.dng --exclude 000009.dng",
    )  # fmt: skip
    one_line(labrig("process", run, "--exclude", "2"), 4, "000009.dng is missing")
    ended = labrig("process", run, "--exclude", "2", "--exclude", "000009.dng")
    assert ended.code == 0, ended.err
    assert "frames decay: 12 → 11" in ended.out
    assert "frames dark: 4 → 3" in ended.out
    assert "000009" not in (run / "result" / "series.csv").read_text()


def test_of_many_damaged_frames_some_are_named(labrig: Labrig, run: Path) -> None:
    shutil.rmtree(run / "frames")
    one_line(labrig("process", run), 4, "000001.dng is missing", "and 12 more")


def test_a_report_does_without_a_damaged_photograph(run: Path) -> None:
    photograph = read_run(run).frames("daylight")[1].path
    change(photograph)
    frames = intact_frames(read_run(run), Overrides())
    assert photograph.name not in [frame.path.name for frame in frames.daylight]
    assert len(frames.daylight) >= 3
    (warning,) = frames.warnings
    assert (warning.code, warning.values["file"]) == ("photograph-damaged", photograph.name)


def frames_of(run: Path, lines: list[str], end: str = "\n", sealed: bool = False) -> IntactFrames:
    journal = run / "journal.jsonl"
    journal.write_text("\n".join(lines) + end, encoding="utf-8")
    if sealed:
        reseal(journal)
    return intact_frames(read_run(run), Overrides())


def test_a_torn_last_line_does_not_count_and_is_reported(run: Path) -> None:
    decay_only = LINES[: next(i for i, line in enumerate(LINES) if '"daylight"' in line)]
    assert len(frames_of(run, [*decay_only, LINES[0][:100]], end="").decay) == 12
    assert codes(timing_warnings(read_run(run))) == ["journal-torn"]


def test_lines_taken_out_or_doubled_are_noticed(run: Path) -> None:
    whole = frames_of(run, LINES)
    assert (len(whole.decay), len(whole.dark)) == (12, 4)
    for number, line in enumerate(LINES):
        if '"event"' not in line[:20]:
            continue
        for edited in ([], [line, line]):
            lines = [*LINES[:number], *edited, *LINES[number + 1 :]]
            with pytest.raises(DataError, match=r"line \d+: does not follow line \d+ as"):
                frames_of(run, lines)
            with pytest.raises(DataError, match=r"line \d+: a '(stop|event)' document"):
                frames_of(run, lines, sealed=True)


def test_a_value_that_was_changed_is_noticed(run: Path) -> None:
    for number, line in enumerate(LINES[:-1]):
        for key in ("exposure_s", "iso", "f_number", "start_time", "end_time", "sha256", "time"):
            edited = re.sub(rf'("{key}": "?)(\d)', lambda m: m[1] + str((int(m[2]) + 1) % 10), line)
            if edited != line:
                with pytest.raises(DataError, match=rf"line {number + 2}: does not follow"):
                    frames_of(run, [*LINES[:number], edited, *LINES[number + 1 :]])


def places(content: Any, above: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Every key and index in nested content."""
    pairs = content.items() if isinstance(content, dict) else enumerate(content)
    for key, inner in pairs:
        yield (*above, key)
        if isinstance(inner, (dict, list)):
            yield from places(inner, (*above, key))


ODD: tuple[object, ...] = (None, "x", -1, math.inf, math.nan, 1e300, [], {}, True)


@pytest.fixture(scope="module")
def edited_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return Path(shutil.copytree(RECORDED, tmp_path_factory.mktemp("edited") / "run"))


@settings(max_examples=30)
@given(data=st.data())
def test_an_edited_journal_is_one_line_or_still_makes_sense(
    edited_run: Path, data: st.DataObject
) -> None:
    number = data.draw(st.integers(0, len(LINES) - 1))
    document = json.loads(LINES[number])
    *above, key = data.draw(st.sampled_from(list(places(document))))
    inner = document
    for step in above:
        inner = inner[step]
    if data.draw(st.booleans()):
        del inner[key]
    else:
        inner[key] = data.draw(st.sampled_from(ODD))
    lines = [*LINES[:number], json.dumps(document), *LINES[number + 1 :]]
    try:
        frames = frames_of(edited_run, lines, sealed=True)
    except LabrigError as error:
        assert str(edited_run) in str(error)
        assert "\n" not in str(error)
    else:
        assert all(math.isfinite(frame.t_s) for frame in frames.decay)
