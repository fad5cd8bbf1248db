"""A folder of runs: found, filtered, shown, noted, compared."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml
from filelock import FileLock

from labrig.catalogue import compare_runs, list_runs, summarise
from labrig.catalogue.listing import Wanted
from labrig.cli.ending import guarded
from tests.conftest import Ended

Labrig = Callable[..., Ended]


@pytest.fixture(scope="module")
def week(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four runs: twice the same paint on different days, another paint, one that was cut off."""
    folder = tmp_path_factory.mktemp("week")
    for day, sample, seed, keys in (
        (2, "blue-paint", 1, {}),
        (3, "blue-paint", 2, {"repeats": 2}),
        (4, "green-paint", 3, {}),
    ):
        rig = yaml.safe_load((Path(__file__).parents[2] / "config" / "sim.yaml").read_text())
        rig["simulation"] |= {
            "sensor": {"width": 192, "height": 128},
            "epoch": f"2026-01-0{day}T00:00:00Z",
            "initial": {"lamp": "off"},
            "sample": sample,
            "seed": seed,
        }
        protocol = {
            "protocol": "decay",
            "sample": {"name": sample},
            "charge": "10 min",
            "for": "60 s",
            "exposure": "1 s",
            **keys,
        }
        for name, content in (("rig.yaml", rig), ("protocol.yaml", protocol)):
            (folder / name).write_text(yaml.safe_dump(content))
        place = [str(folder / "protocol.yaml"), "--rig", str(folder / "rig.yaml")]
        assert guarded(["run", *place, "--runs", str(folder / "runs")]) == 0
    cut = folder / "runs" / "2026-01-05T00-00-00_decay_blue-paint"
    (cut / "frames").mkdir(parents=True)
    (cut / "protocol.yaml").write_text((folder / "protocol.yaml").read_text())
    return folder / "runs"


@pytest.mark.parametrize(
    ("options", "days"),
    [
        ([], [2, 3, 4, 5]),
        (["--sample", "Blue*"], [2, 3]),
        (["--sample", "green-paint"], [4, 5]),
        (["--since", "2026-01-03"], [3, 4]),
        (["--since", "2026-01-03", "--until", "2026-01-03"], [3]),
        (["--state", "unfinished"], [5]),
        (["--protocol", "emission"], []),
    ],
)
def test_the_wanted_runs_are_listed_oldest_first(
    week: Path, labrig: Labrig, options: list[str], days: list[int]
) -> None:
    ended = labrig("runs", "list", "--runs", week, "--json", *options)
    assert ended.code == 0, ended.err
    found = [Path(run["folder"]).name[8:10] for run in json.loads(ended.out)]
    assert found == [f"0{day}" for day in days]


def test_a_person_reads_one_line_a_run(week: Path, labrig: Labrig) -> None:
    said = labrig("runs", "list", "--runs", week).out
    (paint,) = (line for line in said.splitlines() if "2026-01-03" in line)
    assert "blue-paint" in paint
    assert "processed" in paint
    assert "3 of 3" in paint
    assert "0.03" in paint
    assert "±" in paint


def test_a_run_that_is_being_written_or_damaged_says_so(week: Path, tmp_path: Path) -> None:
    (folder, *_) = (run.folder for run in list_runs(week, Wanted(sample="blue-paint")))
    with FileLock(folder / ".lock"):
        assert summarise(folder).state == "running"
    assert summarise(folder).state == "processed"
    damaged = tmp_path / "damaged"
    damaged.mkdir()
    (damaged / "protocol.yaml").write_text((folder / "protocol.yaml").read_text())
    (damaged / "journal.jsonl").write_text("{]\n{}\n")
    assert summarise(damaged).state == "damaged"


def test_runs_are_called_by_the_beginning_of_their_name(week: Path, labrig: Labrig) -> None:
    shown = labrig("runs", "show", "2026-01-04", "--runs", week)
    assert "green-paint" in shown.out
    assert "report.html" in shown.out
    assert "0 of 2" in labrig("runs", "show", "last", "--runs", week).out
    for name, said in (("2026", "4 runs begin so"), ("2027", "no such run")):
        refused = labrig("runs", "show", name, "--runs", week)
        assert (refused.code, len(refused.err.splitlines())) == (2, 1)
        assert said in refused.err


def test_notes_are_added_and_shown(week: Path, labrig: Labrig) -> None:
    for text in ("the door was ajar", "* one\n* two"):
        assert labrig("note", "2026-01-02", text, "--runs", week).code == 0
    shown = labrig("runs", "show", "2026-01-02", "--runs", week).out
    assert shown.index("the door was ajar") < shown.index("* one\n* two")
    assert shown.count(" UTC\n\n") == 2
    assert labrig("note", "2026-01-02", " ", "--runs", week).code == 2


def test_the_same_paint_on_two_days_agrees_and_another_one_differs(
    week: Path, labrig: Labrig
) -> None:
    first, again, other, _ = (run.folder for run in list_runs(week, Wanted()))
    same = compare_runs(first, again)
    assert same.asked == (("repeats", 1, 2),)
    assert same.patches[0].p_value > 0.01
    # another seed is another camera: rates agree, amplitudes need not
    assert all(abs(one.pull) < 3 for one in same.patches[0].differences if one.unit == "1/s")
    different = compare_runs(first, other)
    assert different.patches[0].p_value < 1e-6
    said = labrig("runs", "compare", first, other).out
    assert "asked differently: sample.name: blue-paint | green-paint" in said
    assert "the rates differ" in said
    assert "the rates agree" in labrig("runs", "compare", first, again).out


def test_a_reference_ties_the_amplitudes_of_two_days_together(tmp_path: Path) -> None:
    for run, gain in (("a", 1.0), ("b", 0.8)):
        for patch, amplitude in (("lamp", 100.0), ("paint", 50.0)):
            place = tmp_path / run / "result" / patch
            place.mkdir(parents=True)
            state = {
                "k_r_per_s": 0.01,
                "k_r_sigma_per_s": 1e-4,
                "amplitude": amplitude * gain,
                "amplitude_sigma": 0.5,
            }
            (place / "fit.json").write_text(json.dumps({"states": [state], "warnings": []}))
        (tmp_path / run / "protocol.yaml").write_text("protocol: decay\n")
    a, b = tmp_path / "a", tmp_path / "b"
    (free,) = (p for p in compare_runs(a, b).patches if p.patch == "paint")
    assert free.differences[1].pull < -10
    (tied,) = compare_runs(a, b, reference="lamp").patches
    assert tied.differences[1].b.value == pytest.approx(50.0)
    assert tied.differences[1].b.sigma > 0.5
    assert abs(tied.differences[1].pull) < 0.1


def test_what_cannot_be_compared_is_said_in_a_line(week: Path, labrig: Labrig) -> None:
    first, *_, cut = (run.folder for run in list_runs(week, Wanted()))
    ended = labrig("runs", "compare", first, cut)
    assert (ended.code, len(ended.err.splitlines())) == (4, 1)
    assert "labrig process" in ended.err
    ended = labrig("runs", "compare", first, first, "--reference", "lamp")
    assert (ended.code, len(ended.err.splitlines())) == (2, 1)
