"""A run folder of somebody else in which something leads elsewhere: nothing there is touched."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.conftest import Ended

Labrig = Callable[..., Ended]
#: Names below a run folder that labrig reads or writes, and some that it does not know.
NAMES = [
    "cache", "cache/checked_frames.txt", ".lock", ".holder", ".process.lock", ".process.holder",
    "journal.jsonl.part", "journal.jsonl", "log.txt", "frames", "frames/000099.dng", "notes.md",
    "result", "result.part", "result/figures", "result/figures/figures.pdf", "result/report.html",
    "result/later", "rig.yaml", "made.txt", "calibrations.yaml", "comparison", "a name of theirs",
]  # fmt: skip
COMMANDS = [
    ("process",), ("resume",), ("figures",), ("runs", "show"), ("note", "RUN", "seen"),
]  # fmt: skip


def planted(kept: Path, folder: Path, name: str, target: Path) -> Path:
    """Return a copy of the run in which `name` is a link to `target`."""
    copy = folder / "run"
    shutil.copytree(kept, copy)
    place = copy / name
    if place.is_dir():
        shutil.rmtree(place)
    place.unlink(missing_ok=True)
    place.parent.mkdir(exist_ok=True)
    place.symlink_to(target)
    return copy


@pytest.mark.parametrize("name", NAMES)
def test_a_link_is_refused_and_what_it_leads_to_stays(
    labrig: Labrig, kept: Path, tmp_path: Path, name: str
) -> None:
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / "mine.txt").write_text("mine")
    target = outside if "." not in name.rpartition("/")[2][1:] else outside / "mine.txt"
    copy = planted(kept, tmp_path, name, target)
    for command, *rest in COMMANDS:
        arguments = [str(copy) if one == "RUN" else one for one in rest]
        ended = labrig(command, *(arguments if "RUN" in rest else [*arguments, copy]))
        assert ended.code == 4, (command, ended)
        assert "got a link" in ended.err
        assert len(ended.err.splitlines()) == 1
    assert [path.name for path in outside.iterdir()] == ["mine.txt"]
    assert (outside / "mine.txt").read_text() == "mine"


def test_a_run_that_is_reached_by_a_link_is_read(
    labrig: Labrig, kept: Path, tmp_path: Path
) -> None:
    (tmp_path / "link").symlink_to(kept)
    assert labrig("runs", "show", tmp_path / "link").code == 0


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
@pytest.mark.parametrize("name", ["protocol.yaml", "rig.yaml", "journal.jsonl", "cache/x"])
def test_a_named_pipe_is_not_waited_for(
    labrig: Labrig, kept: Path, tmp_path: Path, name: str
) -> None:
    copy = tmp_path / "run"
    shutil.copytree(kept, copy)
    (copy / name).unlink(missing_ok=True)
    (copy / name).parent.mkdir(exist_ok=True)
    os.mkfifo(copy / name)
    for command in ("process", "resume", "figures"):
        assert labrig(command, copy).code in (2, 4)
    assert labrig("runs", "list", "--runs", tmp_path).code == 0


def test_a_note_leaves_a_backup_that_shares_the_file_alone(
    labrig: Labrig, kept: Path, tmp_path: Path
) -> None:
    copy, backup = tmp_path / "run", tmp_path / "backup.md"
    shutil.copytree(kept, copy)
    assert labrig("note", copy, "before").code == 0
    os.link(copy / "notes.md", backup)
    shared = backup.read_bytes()
    assert labrig("note", copy, "after").code == 0
    assert backup.read_bytes() == shared
    assert b"after" in (copy / "notes.md").read_bytes()
