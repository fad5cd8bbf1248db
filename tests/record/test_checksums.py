"""Frames against the checksums of the journal, read anew only if their files were touched."""

import json
import os
from hashlib import sha256
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from labrig.record import FrameRecord, damaged_frames, own_digest

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


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.binary(max_size=60)
    | st.recursive(
        st.none() | st.integers() | st.text(max_size=3),
        lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner),
    ).map(lambda content: json.dumps({"000001.cr2": content}).encode())
)
def test_no_malformed_list_is_a_fault_or_trusted(
    frame: FrameRecord, tmp_path: Path, content: bytes
) -> None:
    frame.path.write_bytes(CONTENT)
    damaged_frames(tmp_path, [frame])
    change_unseen(frame)
    (file,) = (tmp_path / "cache").iterdir()
    for digest in (own_digest(content), sha256(content).hexdigest(), ""):
        file.write_bytes(digest.encode() + b"\n" + content)
        assert frame in damaged_frames(tmp_path, [frame])


def test_a_list_that_somebody_else_wrote_trusts_nothing(frame: FrameRecord, tmp_path: Path) -> None:
    damaged_frames(tmp_path, [frame])
    change_unseen(frame)
    (file,) = (tmp_path / "cache").iterdir()
    text = file.read_bytes().partition(b"\n")[2]
    file.write_bytes(sha256(text).hexdigest().encode() + b"\n" + text)
    assert frame in damaged_frames(tmp_path, [frame])


@pytest.mark.parametrize("content", ["", "[1]", "{", '{"000001.cr2": null}', "\xff"])
def test_a_damaged_list_trusts_nothing(frame: FrameRecord, tmp_path: Path, content: str) -> None:
    damaged_frames(tmp_path, [frame])
    change_unseen(frame)
    (file,) = (tmp_path / "cache").iterdir()
    file.write_text(content, encoding="latin-1")
    assert frame in damaged_frames(tmp_path, [frame])
