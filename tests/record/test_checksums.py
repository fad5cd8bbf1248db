"""Frames against the checksums of the journal, read anew only if their files were touched."""

import os
from hashlib import sha256
from pathlib import Path

import pytest

from labrig.record import FrameRecord, damaged_frames

CONTENT = b"what the camera delivered"


@pytest.fixture
def frame(tmp_path: Path) -> FrameRecord:
    path = tmp_path / "frames" / "000001.cr2"
    path.parent.mkdir()
    path.write_bytes(CONTENT)
    return FrameRecord(
        path, sha256(CONTENT).hexdigest(), len(CONTENT), "decay-1", "decay", 1.0, 400, 4.0, 0, 1, 0
    )


def change_unseen(frame: FrameRecord) -> None:
    """Changes a byte, but neither size nor modification time."""
    status = frame.path.stat()
    frame.path.write_bytes(CONTENT.replace(b"w", b"W"))
    os.utime(frame.path, ns=(status.st_atime_ns, status.st_mtime_ns))


def test_a_file_that_looks_untouched_is_trusted_unless_asked(
    frame: FrameRecord, tmp_path: Path
) -> None:
    assert damaged_frames(tmp_path, [frame]) == {}
    change_unseen(frame)
    assert damaged_frames(tmp_path, [frame]) == {}
    assert "checksum" in damaged_frames(tmp_path, [frame], trust=False)[frame]
    # From then on it is known to be damaged, until it is put back.
    assert "checksum" in damaged_frames(tmp_path, [frame])[frame]
    frame.path.write_bytes(CONTENT)
    assert damaged_frames(tmp_path, [frame]) == {}


def test_a_file_with_another_time_or_size_is_read(frame: FrameRecord, tmp_path: Path) -> None:
    assert damaged_frames(tmp_path, [frame]) == {}
    change_unseen(frame)
    os.utime(frame.path, ns=(0, 0))
    assert "checksum" in damaged_frames(tmp_path, [frame])[frame]
    frame.path.unlink()
    assert damaged_frames(tmp_path, [frame]) == {frame: "is missing"}


@pytest.mark.parametrize("content", ["", "[1]", "{", '{"000001.cr2": null}', "\xff"])
def test_a_damaged_list_trusts_nothing(frame: FrameRecord, tmp_path: Path, content: str) -> None:
    damaged_frames(tmp_path, [frame])
    change_unseen(frame)
    (file,) = (tmp_path / "cache").iterdir()
    file.write_text(content, encoding="latin-1")
    assert frame in damaged_frames(tmp_path, [frame])
