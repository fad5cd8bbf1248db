"""A queue of measurements: added, run one after another, interrupted, gone on with."""

import csv
import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

from labrig.acquire import PlanClock, RigFile, RunObserver, read_protocol, read_rig_file
from labrig.bench import Recording, Watch
from labrig.fit import fit_power_law
from labrig.foundation.clock import Clock, Interrupted
from labrig.foundation.errors import DataError, UsageError
from labrig.queue import (
    Queue,
    QueuedRun,
    change_queue,
    combinations,
    entries,
    read_queue,
    run_queue,
)
from labrig.record import FrameRecord, read_run
from labrig.results import Measured
from tests.acquire.fakes import Watching
from tests.analyse.luminance_bench import luminance_after, write_rig
from tests.conftest import Ended
from tests.quick_yaml import read_quickly, write_quickly

Labrig = Callable[..., Ended]
Make = Callable[..., Path]


class Person(Watching):
    """Whoever attends a queue in these tests, who leaves at a frame of a run."""

    def __init__(self, folder: Path, leaves: tuple[int, int] | None = None) -> None:
        super().__init__()
        self._folder, self._leaves = folder, leaves
        self._run, self._frames = 0, 0
        self.samples: list[tuple[str, str]] = []

    def prepare(self, queued: QueuedRun) -> Recording:
        assert queued.rig is not None
        return Recording.prepare(
            self._folder / queued.protocol, self._folder / queued.rig, self._folder / "runs",
            queued.changes,
        )  # fmt: skip

    def watch(self, rig: RigFile) -> Watch:
        self._run, self._frames = self._run + 1, 0
        return self._watched

    @contextmanager
    def _watched(self, plan_clock: PlanClock, clock: Clock) -> Iterator[RunObserver]:
        yield self

    def frame(self, record: FrameRecord) -> None:
        self._frames += 1
        if (self._run, self._frames) == self._leaves:
            raise Interrupted(2)

    def change_sample(self, before: str, after: str) -> None:
        self.samples.append((before, after))

    def tell(self, text: str) -> None:
        self.told.append(text)


def queued(**changes: object) -> QueuedRun:
    return QueuedRun(protocol="protocol.yaml", rig="rig.yaml", set=changes)


def with_runs(path: Path, *runs: QueuedRun) -> Path:
    change_queue(path, lambda queue: Queue(runs=(*queue.runs, *runs)))
    return path


def test_a_sweep_is_added_run_and_shown(
    labrig: Labrig, make_rig: Make, make_protocol: Make, tmp_path: Path
) -> None:
    queue, runs = ("--queue", tmp_path / "night.yaml"), ("--runs", tmp_path / "runs")
    rig, protocol = make_rig(), make_protocol()
    added = labrig(
        "queue", "add", protocol, "--rig", rig, "--set", "sample.name=paint", *queue,
        "--sweep", "charge=[16 min, 20 min, 30 min]",
    )  # fmt: skip
    assert added.code == 0, added.err
    ended = labrig("queue", "run", *queue, *runs)
    assert ended.code == 0, ended.err
    assert ended.run_folder == tmp_path / "night-results" / "report.html"
    page = ended.run_folder.read_text("utf-8")
    with (tmp_path / "night-results/results.csv").open(encoding="utf-8", newline="") as table:
        rows = list(csv.DictReader(table))
    assert [row["charge"] for row in rows] == ["16 min", "20 min", "30 min"]
    for row in rows:
        k, sigma = float(row["k_r_per_s"]), float(row["k_r_per_s_sigma"])
        assert abs(k - 0.0322) < 4 * sigma
        assert f'href="../runs/{row["run"]}/result/report.html"' in page
    made: list[Any] = [
        read_protocol(tmp_path / "runs" / row["run"] / "protocol.yaml") for row in rows
    ]
    assert [(one.charge, one.sample.name) for one in made] == [
        (960, "paint"), (1200, "paint"), (1800, "paint")
    ]  # fmt: skip
    assert (tmp_path / "night-results/figures").is_dir()
    assert "Amplitudes at lamp off, state 1, over charge" in page
    listed = json.loads(labrig("queue", "list", *queue, *runs, "--json").out)
    assert [entry["status"] for entry in listed] == ["processed"] * 3
    assert listed[1]["states"][0]["k_r_per_s"] == float(rows[1]["k_r_per_s"])
    assert labrig("queue", "run", *queue, *runs).err == "", "nothing is left to do"


@pytest.mark.campaign
def test_luminances_after_several_excitations_are_a_charge_dose_curve(
    labrig: Labrig, tmp_path: Path
) -> None:
    protocol = tmp_path / "short.yaml"
    keys = {"protocol": "luminance", "excitation": {"preset": "own", "time": "1 min"},
            "until": "3 min", "longest": "10 s"}  # fmt: skip
    protocol.write_text(write_quickly(keys))
    rig = write_rig(tmp_path, sample=[{"material": "power-law", "brightness": 12.0}])
    queue, runs = ("--queue", tmp_path / "dose.yaml"), ("--runs", tmp_path / "runs")
    sweep = ("--sweep", "excitation.time=[4 s, 8 s, 16 s]")
    assert labrig("queue", "add", protocol, "--rig", rig, *queue, *sweep).code == 0
    ended = labrig("queue", "run", *queue, *runs, "--yes")
    assert ended.code == 0, ended.err
    assert "Luminances at times after lamp off over excitation.time" in ended.run_folder.read_text()
    with (tmp_path / "dose-results/results.csv").open(encoding="utf-8", newline="") as table:
        rows = [row for row in csv.DictReader(table) if row["t_s"] == "120.0"]
    assert [row["excitation.time"] for row in rows] == ["4 s", "8 s", "16 s"]
    light = [
        Measured(float(row["luminance_mcd_per_m2"]), 0.01 * float(row["luminance_mcd_per_m2"]))
        for row in rows
    ]
    slope = fit_power_law([4.0, 8.0, 16.0], light).exponent
    room = [
        luminance_after(read_rig_file(rig), [120.0], 300.0, 600.0, lit_s)[0, 0]
        for lit_s in (4.0, 8.0, 16.0)
    ]
    true = np.log(room[2] / room[0]) / np.log(4)
    assert slope.value == pytest.approx(true, abs=0.01)


def test_what_was_interrupted_goes_on(make_rig: Make, make_protocol: Make, tmp_path: Path) -> None:
    make_rig(), make_protocol()
    path = with_runs(tmp_path / "queue.yaml", queued(charge="20 min"), queued(charge="25 min"))
    with pytest.raises(Interrupted):
        run_queue(path, tmp_path / "runs", Person(tmp_path, leaves=(2, 10)))
    first, second = entries(read_queue(path), tmp_path / "runs")
    assert (first.status, second.status) == ("processed", "interrupted")
    assert second.summary is not None
    begun = second.summary.folder
    kept = set(read_run(begun).completed())
    assert kept
    # Meanwhile somebody adds a measurement before all others.
    change_queue(path, lambda queue: Queue(runs=(queued(charge="15 min"), *queue.runs)))
    run_queue(path, tmp_path / "runs", Person(tmp_path))
    now = entries(read_queue(path), tmp_path / "runs")
    assert [entry.status for entry in now] == ["processed"] * 3
    assert [entry.summary.folder for entry in now if entry.summary][2] == begun
    assert len(list((tmp_path / "runs").glob("*_decay_*"))) == 3
    assert kept < set(read_run(begun).completed())


def test_before_anything_moves_all_measurements_are_checked(
    make_rig: Make, make_protocol: Make, tmp_path: Path
) -> None:
    make_rig(), make_protocol()
    path = with_runs(tmp_path / "queue.yaml", queued(), queued(charge="long"))
    with pytest.raises(UsageError, match=r"queue\.yaml, no\. 2: .*charge: expected"):
        run_queue(path, tmp_path / "runs", Person(tmp_path))
    assert not (tmp_path / "runs").exists()


def test_a_run_that_cannot_be_fitted_does_not_stop_the_others(
    make_rig: Make, make_protocol: Make, tmp_path: Path
) -> None:
    make_rig(sample="stickers"), make_protocol()
    bright = queued(exposure="3.2 s", camera={"iso": 1600, "f_number": 4})
    path = with_runs(tmp_path / "queue.yaml", bright, queued(exposure="auto"))
    person = Person(tmp_path)
    with pytest.raises(DataError, match=r"1 of 2 runs .*no\. 1"):
        run_queue(path, tmp_path / "runs", person)
    assert [entry.status for entry in entries(read_queue(path), tmp_path / "runs")][
        1
    ] == "processed"


@pytest.mark.campaign
def test_another_sample_is_asked_for(make_rig: Make, make_protocol: Make, tmp_path: Path) -> None:
    make_rig(), make_protocol()
    names = ("red", "red", "blue")
    path = with_runs(tmp_path / "queue.yaml", *(queued(**{"sample.name": name}) for name in names))
    person = Person(tmp_path)
    run_queue(path, tmp_path / "runs", person)
    assert person.samples == [("red", "blue")]


def test_a_sample_changer_brings_the_samples_that_it_has(
    make_rig: Make, make_protocol: Make, tmp_path: Path
) -> None:
    rig, _ = make_rig(), make_protocol()
    content = read_quickly(rig.read_text())
    content["devices"]["sample_changer"] = {
        "driver": "maestro", "address": "sim://room/servo", "channel": 5,
        "travel": "1 s", "away": "1000 us", "samples": {"red": "1300 us", "blue": "1600 us"},
    }  # fmt: skip
    content["simulation"] |= {"epoch": "2026-01-01T00:00:00Z", "initial": {"lamp": "off"}}
    rig.write_text(write_quickly(content))
    names = ("red", "blue", "green")
    path = with_runs(tmp_path / "queue.yaml", *(queued(**{"sample.name": name}) for name in names))
    person = Person(tmp_path)
    run_queue(path, tmp_path / "runs", person)
    assert person.samples == [("blue", "green")]
    runs = [
        one.summary.folder for one in entries(read_queue(path), tmp_path / "runs") if one.summary
    ]
    told = [read_run(run).attempts[0].start["devices"]["sample_changer"] for run in runs]
    assert [text.split("pulse ")[1] for text in told] == ["1300.00 µs", "1600.00 µs", "1000.00 µs"]
    assert any("has no sample 'green'" in text for text in person.told)


def test_a_queue_that_runs_is_not_run_twice(
    make_rig: Make, make_protocol: Make, tmp_path: Path
) -> None:
    make_rig(), make_protocol()
    path = with_runs(tmp_path / "queue.yaml", queued())

    class Second(Person):
        def prepare(self, queued: QueuedRun) -> Recording:
            run_queue(path, tmp_path / "runs", Person(tmp_path))
            raise AssertionError

    with pytest.raises(UsageError, match="another labrig runs this queue"):
        run_queue(path, tmp_path / "runs", Second(tmp_path))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["add", "decay", "--set", "charge"], "expected KEY=VALUE"),
        (["add", "decay", "--set", "charg=5 min"], "did you mean 'charge'"),
        (["add", "decay", "--set", "charge=5 min", "--sweep", "charge=1 min"], "every key once"),
        (["add", "decay", "--set", "charge.at=5 min"], "expected keys below 'charge'"),
        (["add", "decay", "--sweep", "charge=[1 min"], "expected a value in YAML"),
        (["add", "decai"], "did you mean 'decay'"),
        (["run"], "no such queue"),
        (["list"], "no such queue"),
    ],
)
def test_what_cannot_be_is_one_line(
    labrig: Labrig, tmp_path: Path, arguments: list[str], said: str
) -> None:
    ended = labrig("queue", *arguments, "--queue", tmp_path / "queue.yaml")
    assert ended.code == 2
    (line,) = ended.err.splitlines()
    assert said in line
    assert not (tmp_path / "queue.yaml").exists()


@pytest.mark.parametrize("command", [["list"], ["run"], ["add", "decay", "--rig", "sim"]])
@pytest.mark.parametrize("text", ["runs: [{protocol: decay, sett: {}}]", "name: decay", None])
def test_what_is_no_queue_is_one_line_and_nothing_is_made_beside_it(
    labrig: Labrig, tmp_path: Path, command: list[str], text: str | None
) -> None:
    path = tmp_path / "theirs" / "queue.yaml"
    path.parent.mkdir()
    path.mkdir() if text is None else path.write_text(text)
    ended = labrig("queue", *command, "--queue", path)
    assert (ended.code, len(ended.err.splitlines())) == (2, 1)
    assert "queue.yaml" in ended.err
    assert list(path.parent.iterdir()) == [path]


values = st.lists(
    st.integers(0, 9) | st.sampled_from(["1 min", "a b", "x.y"]), min_size=1, max_size=4
)


@given(st.dictionaries(st.sampled_from(["a", "b.c", "d"]), values, min_size=1))
def test_all_combinations_are_run(sweeps: dict[str, list[Any]]) -> None:
    typed = [f"{key}={', '.join(map(str, listed))}" for key, listed in sweeps.items()]
    found = combinations(["z=1"], typed)
    number = 1
    for listed in sweeps.values():
        number *= len(listed)
    assert len(found) == number
    assert all(changes["z"] == 1 for changes in found)
    for key, listed in sweeps.items():
        assert {changes[key] for changes in found} == set(listed)
