"""The run folder: frames before lines, attempts that count, crashes that do not."""

import hashlib
import itertools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import event_model
import pytest

from labrig.foundation.errors import DataError, DiskError, UsageError
from labrig.record import ActionRecord, FrameRecord, RunFolder, TemperatureRecord, read_run
from labrig.record.attempt import AttemptWriter
from labrig.record.journal import read_journal
from tests.resealed import reseal

STARTED = 1_767_225_600.0


@pytest.fixture
def wall() -> Callable[[], float]:
    ticks = itertools.count()
    return lambda: STARTED + next(ticks)


def make(runs: Path, seed: int | None = 1) -> RunFolder:
    return RunFolder.create(
        runs, "decay_blue paint/1", STARTED, {"protocol.yaml": "a: 1\n", "rig.yaml": ""}, seed
    )


def photograph(writer: AttemptWriter, data: bytes, role: str = "decay") -> FrameRecord:
    return writer.frame(
        data,
        ".cr2",
        role=role,
        exposure_s=1.0,
        iso=400,
        f_number=4.0,
        start_time=STARTED,
        end_time=STARTED + 1,
        late_s=0.0,
    )


def test_names_say_when_and_what_and_never_collide(tmp_path: Path) -> None:
    names = []
    for _ in range(3):
        with make(tmp_path) as folder:
            names.append(folder.path.name)
    base = "2026-01-01T00-00-00_decay_blue-paint-1"
    assert names == [base, f"{base}-2", f"{base}-3"]


def test_a_completed_attempt_is_read_back_and_fits_event_model(
    tmp_path: Path, wall: Callable[[], float]
) -> None:
    with make(tmp_path) as folder:
        writer = folder.attempt("dark", wall, {"rig": "sim"})
        frame = photograph(writer, b"raw data", "dark")
        writer.action(ActionRecord("dark", "lamp", "on", STARTED, STARTED + 0.1, 0.0))
        warmth = TemperatureRecord("dark", STARTED + 0.5, 21.25)
        writer.temperature(warmth)
        writer.stop("success")
        record = folder.read()
    assert frame.path.read_bytes() == b"raw data"
    assert frame.sha256 == hashlib.sha256(b"raw data").hexdigest()
    assert record.frames("dark") == [frame]
    assert record.completed()["dark"].actions[0].action == "on"
    assert record.temperatures() == [warmth]
    for name, doc in read_journal(folder.path / "journal.jsonl").documents:
        event_model.schema_validators[event_model.DocumentNames[name]].validate(doc)


@pytest.mark.parametrize("written", ["1e999", "-3000", "null", '"warm"'])
def test_a_temperature_that_cannot_be_is_refused(
    tmp_path: Path, wall: Callable[[], float], written: str
) -> None:
    with make(tmp_path) as folder:
        writer = folder.attempt("dark", wall, {})
        writer.temperature(TemperatureRecord("dark", STARTED, 21.25))
    path = folder.path / "journal.jsonl"
    path.write_text(
        path.read_text().replace('"temperature_c": 21.25', f'"temperature_c": {written}')
    )
    reseal(path)
    with pytest.raises(DataError, match="was changed after the run"):
        read_run(folder.path)


@pytest.mark.parametrize(
    "name",
    [
        "/dev/zero",
        "../../x.cr2",
        "frames/../../x.cr2",
        "frames/000001.cr2/../../x",
        "",
        "frames/..",
    ],
)
def test_a_frame_outside_of_the_run_is_refused(
    tmp_path: Path, wall: Callable[[], float], name: str
) -> None:
    with make(tmp_path) as folder:
        photograph(folder.attempt("dark", wall, {}), b"x")
    path = folder.path / "journal.jsonl"
    path.write_text(path.read_text().replace("frames/000001.cr2", name))
    reseal(path)
    with pytest.raises(DataError, match="was changed after the run"):
        read_run(folder.path)


def test_a_frame_that_is_a_link_or_a_device_is_refused(
    tmp_path: Path, wall: Callable[[], float]
) -> None:
    with make(tmp_path) as folder:
        frame = photograph(folder.attempt("dark", wall, {}), b"x")
    frame.path.unlink()
    assert len(read_run(folder.path).attempts[0].frames) == 1  # missing: processing says so
    frame.path.symlink_to("/dev/zero")
    with pytest.raises(DataError, match="got a link"):
        read_run(folder.path)


def test_half_a_surrogate_pair_in_a_journal_is_refused(
    tmp_path: Path, wall: Callable[[], float]
) -> None:
    with make(tmp_path) as folder:
        folder.attempt("dark", wall, {"where": "C:\\udo"})
    assert len(read_run(folder.path).attempts) == 1
    path = folder.path / "journal.jsonl"
    path.write_text(path.read_text().replace('"dark"', '"\\ud800"'))
    reseal(path)
    with pytest.raises(DataError, match="was changed after the run"):
        read_run(folder.path)


def test_only_success_counts_and_the_last_success_wins(
    tmp_path: Path, wall: Callable[[], float]
) -> None:
    with make(tmp_path) as folder:
        for status, data in [("fail", b"1"), ("success", b"2"), ("abort", b"3")]:
            writer = folder.attempt("decay-1", wall, {})
            photograph(writer, data)
            writer.stop(status, "because")
        frames = folder.read().frames("decay")
    assert [frame.path.read_bytes() for frame in frames] == [b"2"]


def test_a_dead_attempt_is_closed_and_its_frames_do_not_count(
    tmp_path: Path, wall: Callable[[], float]
) -> None:
    with make(tmp_path) as folder:
        writer = folder.attempt("decay-1", wall, {})
        photograph(writer, b"before the crash")
    (folder.path / "frames" / "000002.cr2").write_bytes(b"renamed, but its line never came")
    (folder.path / "frames" / "000003.cr2.part").write_bytes(b"half")
    with RunFolder(folder.path, 1) as again:
        assert again.close_open_attempts(wall, "abort", "crash") == ["decay-1"]
        assert again.close_open_attempts(wall, "abort", "crash") == []
        record = again.read()
        assert record.frames("decay") == []
        assert [attempt.exit_status for attempt in record.attempts] == ["abort"]
        writer = again.attempt("decay-1", wall, {})
        assert photograph(writer, b"redone").path.name == "000004.cr2"
        writer.stop("success")
        assert len(again.read().frames("decay")) == 1
    for name, doc in read_journal(folder.path / "journal.jsonl").documents:
        event_model.schema_validators[event_model.DocumentNames[name]].validate(doc)
    uids = [doc["uid"] for _, doc in read_journal(folder.path / "journal.jsonl").documents]
    assert len(set(uids)) == len(uids)


@pytest.mark.parametrize(("seed", "alike"), [(7, True), (None, False)])
def test_a_seed_makes_the_bytes_repeatable(tmp_path: Path, seed: int | None, alike: bool) -> None:
    journals = []
    for name in ("a", "b"):
        ticks = itertools.count()
        with make(tmp_path / name, seed) as folder:
            writer = folder.attempt("dark", lambda ticks=ticks: STARTED + next(ticks), {})  # type: ignore[misc]
            photograph(writer, b"x")
            writer.stop("success")
        journals.append((folder.path / "journal.jsonl").read_bytes())
    assert (journals[0] == journals[1]) is alike


def test_a_second_writer_is_refused(tmp_path: Path) -> None:
    with make(tmp_path) as folder, pytest.raises(UsageError, match="another labrig"):
        RunFolder(folder.path)


def test_a_full_disk_leaves_no_half_frame(
    tmp_path: Path, wall: Callable[[], float], monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    with make(tmp_path) as folder:
        writer = folder.attempt("dark", wall, {})
        monkeypatch.setattr("os.fsync", full)
        with pytest.raises(DiskError, match="No space left"):
            photograph(writer, b"x")
        monkeypatch.undo()
        assert list((folder.path / "frames").iterdir()) == []
        assert read_run(folder.path).attempts[0].frames == []
