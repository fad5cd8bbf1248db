"""Journals that were edited and chained anew: documents no longer agree with each other."""

import json
from collections.abc import Callable
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

import pytest

from labrig.foundation.errors import DataError
from labrig.record import ActionRecord, RunFolder, TemperatureRecord, read_run
from tests.resealed import reseal

STARTED = 1_767_225_600.0
Entry = dict[str, Any]


@pytest.fixture
def journal(tmp_path: Path) -> Path:
    """A journal with two attempts, each with a frame, two actions and a temperature."""
    ticks = count(1)

    def wall() -> float:
        return STARTED + next(ticks)

    with RunFolder.create(tmp_path, "test", STARTED, {"protocol.yaml": "a: 1\n"}, 1) as folder:
        for unit in ("dark", "decay-1"):
            writer = folder.attempt(unit, wall, {"devices": {"lamp": "a relay"}, "guard": "none"})
            for action in ("on", "off"):
                writer.action(ActionRecord(unit, "lamp", action, STARTED, STARTED + 0.1, 0.0))
            writer.temperature(TemperatureRecord(unit, STARTED, 20.0))
            writer.frame(
                b"x", ".dng", role="decay", exposure_s=1.0, iso=400, f_number=4.0,
                start_time=STARTED - 1, end_time=STARTED, late_s=0.0,
            )  # fmt: skip
            writer.stop("success")
    return folder.path / "journal.jsonl"


def edit(journal: Path, change: Callable[[list[Entry]], list[Entry] | None]) -> None:
    entries = [json.loads(line) for line in journal.read_text(encoding="utf-8").splitlines()]
    entries = change(entries) or entries
    journal.write_text("".join(f"{json.dumps(entry)}\n" for entry in entries), encoding="utf-8")
    reseal(journal)


#: Changes of the first document of a kind.
CHANGES: list[tuple[str, str, Any]] = [
    ("start", "devices", {"lamp": None}),
    ("start", "guard", 1),
    ("start", "unit", None),
    ("start", "uid", None),
    ("descriptor", "name", "pictures"),
    ("descriptor", "data_keys", {"iso": {"source": "labrig", "dtype": "string", "shape": []}}),
    ("descriptor", "configuration", {"camera": {}}),
    ("descriptor", "run_start", "x"),
    ("event", "seq_num", 2),
    ("event", "time", STARTED + 100),
    ("event", "timestamps", {}),
    ("event", "filled", {"frame": True}),
    ("event", "descriptor", "x"),
    ("event", "data", {}),
    ("stop", "num_events", {}),
    ("stop", "num_events", {"actions": 2, "temperatures": 1, "frames": 2}),
    ("stop", "exit_status", "done"),
    ("stop", "reason", None),
    ("stop", "run_start", "x"),
]


@pytest.mark.parametrize(("kind", "key", "value"), CHANGES)
def test_a_document_that_does_not_fit_the_others_is_refused(
    journal: Path, kind: str, key: str, value: Any
) -> None:
    def change(entries: list[Entry]) -> None:
        next(entry for entry in entries if entry["name"] == kind)["doc"][key] = value

    assert len(read_run(journal.parent).completed()) == 2
    edit(journal, change)
    with pytest.raises(DataError, match=r"line \d+: a '\w+' document that does not fit") as refused:
        read_run(journal.parent)
    assert len(str(refused.value).splitlines()) == 1


@pytest.mark.parametrize("late", ["start_time", "end_time"])
def test_an_event_does_not_end_before_it_begins_or_after_it_is_written(
    journal: Path, late: str
) -> None:
    def change(entries: list[Entry]) -> None:
        frame = next(entry for entry in entries if "exposure_s" in entry["doc"].get("data", {}))
        frame["doc"]["data"][late] = STARTED + (0.5 if late == "start_time" else 1000)

    edit(journal, change)
    with pytest.raises(DataError, match="end"):
        read_run(journal.parent)


def without_or_twice(entries: list[Entry], *, number: int, twice: bool) -> list[Entry]:
    return [*entries[: number + twice], *entries[number + (not twice) :]]


def test_every_line_that_is_removed_or_doubled_is_noticed(journal: Path) -> None:
    sound = journal.read_text(encoding="utf-8")
    lines = len(sound.splitlines())
    ends = [n for n, line in enumerate(sound.splitlines()) if '"name": "stop"' in line]
    for number in range(lines):
        for doubled in (False, True):
            journal.write_text(sound, encoding="utf-8")
            edit(journal, partial(without_or_twice, number=number, twice=doubled))
            if number in ends and not doubled:
                # A unit that was not committed is done again.
                assert len(read_run(journal.parent).completed()) == 1
            else:
                with pytest.raises(DataError, match="does not fit"):
                    read_run(journal.parent)
