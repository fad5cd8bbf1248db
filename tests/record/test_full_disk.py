"""A disk that takes part of what it is given: nothing acknowledged is lost, nothing torn kept."""

import errno
import itertools
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

import pytest
from hypothesis import given, settings, strategies as st

from labrig.foundation.errors import DiskError
from labrig.record import RunFolder, read_run, sealed_line
from labrig.record.attempt import AttemptWriter
from labrig.record.journal import Journal, read_journal

STARTED = 1_767_225_600.0


class SmallDisk:
    """Has room for so many bytes, and for any number again when somebody has made room."""

    def __init__(self, room: float) -> None:
        self.room = room

    def write(self, file: BinaryIO, data: bytes) -> None:
        fits = int(min(self.room, len(data)))
        file.write(data[:fits])
        self.room -= fits
        if fits < len(data):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def photograph(writer: AttemptWriter, data: bytes) -> None:
    writer.frame(
        data, ".dng", role="decay", exposure_s=1.0, iso=400, f_number=4.0,
        start_time=STARTED - 1, end_time=STARTED, late_s=0.0,
    )  # fmt: skip


class FailingDisk:
    """Fails at one write, of which so many bytes arrive nevertheless; None: at no more."""

    def __init__(self) -> None:
        self.fails_in: int | None = None
        self.arriving = 0

    def write(self, file: BinaryIO, data: bytes) -> None:
        if self.fails_in is not None:
            self.fails_in -= 1
        fails = self.fails_in == -1
        file.write(data[: self.arriving] if fails else data)
        if fails:
            raise OSError(errno.EIO, os.strerror(errno.EIO))


def times_until_full(act: Callable[[int], None]) -> int:
    for number in itertools.count():
        try:
            act(number)
        except DiskError as error:
            assert "No space left" in str(error)
            return number
    raise AssertionError


@given(room=st.integers(0, 300))
def test_a_line_that_was_cut_off_does_not_spoil_the_next(
    tmp_path_factory: pytest.TempPathFactory, room: int
) -> None:
    path = tmp_path_factory.mktemp("run") / "journal.jsonl"
    disk = SmallDisk(room)
    with Journal(path, disk) as journal:
        written = times_until_full(lambda number: journal.append("event", {"number": number}))
        assert len(read_journal(path).documents) == written
        disk.room = 1e9
        journal.append("stop", {})
    content = read_journal(path)
    assert [name for name, _ in content.documents] == ["event"] * written + ["stop"]
    assert not content.torn


@settings(max_examples=25)
@given(room=st.integers(0, 9000))
def test_wherever_the_disk_fills_up_the_run_can_be_resumed(
    tmp_path_factory: pytest.TempPathFactory, room: int
) -> None:
    runs = tmp_path_factory.mktemp("runs")
    clock = itertools.count(int(STARTED))
    disk = SmallDisk(1e9)
    with RunFolder.create(runs, "test", STARTED, {"protocol.yaml": "a: 1\n"}, 1, disk) as folder:
        disk.room = room
        writers: list[AttemptWriter] = []

        def go_on(number: int) -> None:
            if number == 0:
                writers.append(folder.attempt("decay-1", lambda: next(clock), {}))
            else:
                photograph(writers[0], bytes(700))

        done = times_until_full(go_on)
    assert list((folder.path / "frames").glob("*.part")) == []
    with RunFolder(folder.path, 1) as again:
        again.close_open_attempts(lambda: next(clock), "abort", "full")
        writer = again.attempt("decay-1", lambda: next(clock), {})
        photograph(writer, b"redone")
        writer.stop("success")
    record = read_run(folder.path)
    cut_off = [len(attempt.frames) for attempt in record.attempts if not attempt.completed]
    assert cut_off == ([done - 1] if done else [])
    assert [frame.path.read_bytes() for frame in record.frames("decay")] == [b"redone"]
    uids = [doc["uid"] for _, doc in read_journal(folder.path / "journal.jsonl").documents]
    assert len(set(uids)) == len(uids)


@pytest.mark.parametrize("arriving", [0, 50, 10**9])
@pytest.mark.parametrize("fails_in", range(10))
def test_what_was_never_acknowledged_is_not_read_back(
    tmp_path: Path, fails_in: int, arriving: int
) -> None:
    clock = itertools.count(int(STARTED))
    disk = FailingDisk()
    acknowledged = 0
    with RunFolder.create(
        tmp_path, "test", STARTED, {"protocol.yaml": "a: 1\n"}, 1, disk
    ) as folder:
        disk.fails_in, disk.arriving = fails_in, arriving
        with suppress(DiskError):
            for unit in ("decay-1", "decay-2"):
                writer = folder.attempt(unit, lambda: next(clock), {})
                photograph(writer, bytes(700))
                acknowledged += 1
                writer.stop("success")
        assert disk.fails_in < 0
        now = folder.read()
        assert sum(len(attempt.frames) for attempt in now.attempts) == acknowledged
        folder.close_open_attempts(lambda: next(clock), "fail", "disk")
    record = read_run(folder.path)
    assert sum(len(attempt.frames) for attempt in record.attempts) == acknowledged
    with RunFolder(folder.path, 1) as again:
        again.close_open_attempts(lambda: next(clock), "abort", "crash")
        for unit in ("decay-1", "decay-2"):
            if unit not in again.read().completed():
                writer = again.attempt(unit, lambda: next(clock), {})
                photograph(writer, b"redone")
                writer.stop("success")
    record = read_run(folder.path)
    assert list(record.completed()) == ["decay-1", "decay-2"]
    assert len(record.attempts) <= 3


def test_a_run_is_read_back_when_its_disk_is_gone(tmp_path: Path) -> None:
    with RunFolder.create(tmp_path, "test", STARTED, {}, 1) as folder:
        photograph(folder.attempt("decay-1", lambda: STARTED, {}), b"x")
        (folder.path / "journal.jsonl").unlink()
        assert [len(attempt.frames) for attempt in folder.read().attempts] == [1]


def test_what_an_earlier_process_wrote_is_on_the_disk_before_it_is_relied_upon(
    tmp_path: Path,
) -> None:
    path = tmp_path / "journal.jsonl"
    line = sealed_line("start", {}, "")
    path.write_bytes(line + b'{"name": "ev')  # written, but perhaps never synced
    written: list[bytes] = []

    class Noted(SmallDisk):
        def write(self, file: BinaryIO, data: bytes) -> None:
            written.append(data)
            super().write(file, data)

    with Journal(path, Noted(1e9)):
        assert written == [line]
        assert path.read_bytes() == line


def test_a_dead_disk_is_no_missing_journal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "journal.jsonl"
    path.write_bytes(b"")

    def dead(*_: object) -> int:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr(os, "open", dead)
    with pytest.raises(DiskError, match="Input/output"):
        read_journal(path)


@pytest.mark.skipif(sys.platform != "linux", reason="asks /proc which folder was synced")
def test_every_folder_that_has_something_new_is_synced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: set[Path] = set()
    monkeypatch.setattr(os, "fsync", lambda fd: synced.add(Path(f"/proc/self/fd/{fd}").readlink()))
    runs = tmp_path / "deep" / "runs"
    with RunFolder.create(runs, "test", STARTED, {"protocol.yaml": "a: 1\n"}, 1) as folder:
        photograph(folder.attempt("decay-1", lambda: STARTED, {}), b"x")
    made = [tmp_path, runs.parent, runs, folder.path, folder.path / "frames"]
    assert {path.resolve() for path in made} <= synced


def test_no_half_made_run_folder_is_left(tmp_path: Path) -> None:
    with pytest.raises(DiskError, match="a run folder cannot be made there"):
        RunFolder.create(tmp_path, "test", STARTED, {"protocol.yaml": "a: 1\n"}, 1, SmallDisk(3))
    assert list(tmp_path.iterdir()) == []


def test_how_long_the_disk_took_is_recorded(tmp_path: Path) -> None:
    now_s = [STARTED]

    class SlowDisk(SmallDisk):
        def write(self, file: BinaryIO, data: bytes) -> None:
            now_s[0] += 2.5
            super().write(file, data)

    disk = SlowDisk(1e9)
    with RunFolder.create(tmp_path, "test", STARTED, {}, 1, disk) as folder:
        photograph(folder.attempt("decay-1", lambda: now_s[0], {}), b"x")
        (attempt,) = folder.read().attempts
    assert [frame.disk_s for frame in attempt.frames] == [2.5]
