"""Files are written whole, and never through what somebody planted in their place."""

import os
from pathlib import Path

import pytest

from labrig.foundation.errors import DiskError, UsageError
from labrig.foundation.file_lock import plain_lock
from labrig.foundation.output_file import make_folder_in, replaced, write_durably, write_text


def by_replacing(path: Path, data: bytes) -> None:
    with replaced(path) as draft:
        draft.write_bytes(data)


WRITERS = [write_durably, by_replacing]


@pytest.fixture
def mine(tmp_path: Path) -> Path:
    path = tmp_path / "outside" / "mine.txt"
    path.parent.mkdir()
    path.write_bytes(b"mine")
    return path


@pytest.mark.parametrize("write", WRITERS)
def test_a_link_is_replaced_and_what_it_leads_to_stays(write: object, mine: Path) -> None:
    assert callable(write)
    link = mine.parents[1] / "theirs.txt"
    link.symlink_to(mine)
    write(link, b"ours")
    assert (mine.read_bytes(), link.read_bytes(), link.is_symlink()) == (b"mine", b"ours", False)


@pytest.mark.parametrize("write", WRITERS)
def test_a_hard_link_keeps_its_content(write: object, mine: Path) -> None:
    assert callable(write)
    other = mine.with_name("backup.txt")
    os.link(mine, other)
    write(mine, b"ours")
    assert (mine.read_bytes(), other.read_bytes()) == (b"ours", b"mine")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
@pytest.mark.parametrize("write", WRITERS)
def test_a_pipe_or_a_folder_is_not_replaced(write: object, tmp_path: Path) -> None:
    assert callable(write)
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    for name in ("pipe", "folder"):
        with pytest.raises(DiskError, match="expected a file or nothing"):
            write(tmp_path / name, b"ours")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["folder", "pipe"]


@pytest.mark.parametrize("write", WRITERS)
def test_data_are_synced_before_the_name_is_theirs(
    write: object, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert callable(write)
    path, at_sync = tmp_path / "new.txt", []
    monkeypatch.setattr(os, "fsync", lambda handle: at_sync.append(path.exists()))
    write(path, b"ours")
    assert at_sync == [False, True], "first the file, then the folder with its name"


def test_what_fails_leaves_what_was_there(mine: Path) -> None:
    def fill(draft: Path) -> None:
        draft.write_bytes(b"half")
        raise OSError(28, "No space left on device")

    with pytest.raises(DiskError, match="cannot be written"), replaced(mine) as draft:
        fill(draft)
    assert [path.name for path in mine.parent.iterdir()] == ["mine.txt"]
    assert mine.read_bytes() == b"mine"


def test_a_name_of_any_length_that_the_disk_has_can_be_written(tmp_path: Path) -> None:
    write_text(tmp_path / ("n" * 251 + ".txt"), "long")
    assert len(list(tmp_path.iterdir())) == 1


def test_a_folder_or_a_lock_is_no_link(tmp_path: Path, mine: Path) -> None:
    (tmp_path / "figures").symlink_to(mine.parent)
    with pytest.raises(DiskError, match="got a link"):
        make_folder_in(tmp_path, "figures")
    (tmp_path / ".lock").symlink_to(mine)
    with pytest.raises(UsageError, match="expected a file"):
        plain_lock(tmp_path / ".lock")
    assert mine.read_bytes() == b"mine"
