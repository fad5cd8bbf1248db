"""A folder of runs: found, filtered, shown, noted, compared."""

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from labrig.catalogue import RunFilter, compare_runs, list_runs, summarise
from labrig.cli.exit_codes import guarded
from labrig.results import SAMPLE_PICTURE, write_fitted_decay
from tests.analyse.recorded import processed_once
from tests.analyse.small_runs import RECORD
from tests.conftest import Ended
from tests.quick_yaml import read_quickly, write_quickly
from tests.results.made import decay_result

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
        rig = read_quickly((Path(__file__).parents[2] / "config" / "sim.yaml").read_text())
        rig["simulation"] |= {
            "sensor": {"width": 96, "height": 64},
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
            (folder / name).write_text(write_quickly(content))
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
        (["--status", "interrupted"], [5]),
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


def test_a_person_reads_a_table_of_samples(week: Path, labrig: Labrig) -> None:
    said = labrig("runs", "list", "--runs", week).out
    lines = said.splitlines()
    assert [line for line in lines if line[0] != " "] == ["blue-paint", "green-paint"]
    first, second = lines[1:3]
    assert "2026-01-02" in first
    assert "2026-01-03" in second
    assert "processed" in second
    assert re.search(r"k_r 0\.03\d+ ± 0\.\d+ 1/s$", second)
    assert "2026-01-05" in lines[-1]
    (blue, *_) = list_runs(week, RunFilter(sample="blue-paint"))
    assert (blue.folder / "result" / SAMPLE_PICTURE).read_bytes()[1:4] == b"PNG"
    assert labrig("runs", "--runs", week).out == said
    assert "interrupted, 0 of 2" in labrig("runs", "--status=interrupted", "--runs", week).out


def test_a_damaged_run_says_so(week: Path, tmp_path: Path) -> None:
    (folder, *_) = (run.folder for run in list_runs(week, RunFilter(sample="blue-paint")))
    damaged = tmp_path / "damaged"
    damaged.mkdir()
    (damaged / "protocol.yaml").write_text((folder / "protocol.yaml").read_text())
    (damaged / "journal.jsonl").write_text("{]\n{}\n")
    assert summarise(damaged).status == "damaged"


def test_runs_are_called_by_the_beginning_of_their_name(week: Path, labrig: Labrig) -> None:
    shown = labrig("runs", "show", "2026-01-04", "--runs", week)
    assert "green-paint" in shown.out
    assert "report.html" in shown.out
    assert "0 of 2" in labrig("runs", "show", "last", "--runs", week).out
    last = "2026-01-05T00-00-00_decay_blue-paint"
    for name, said in (
        ("2026", "4 runs begin so"),
        ("2027", "there is no such run"),
        (last.replace("blue", "bleu"), f"did you mean '{last}'?"),
    ):
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
    first, again, other, _ = (run.folder for run in list_runs(week, RunFilter()))
    same = compare_runs(first, again)
    assert same.protocol_differences == (("repeats", 1, 2),)
    assert same.patches[0].p_value > 0.01
    # another seed is another camera: rates agree, amplitudes need not
    assert all(abs(one.pull) < 3 for one in same.patches[0].differences if one.unit == "1/s")
    different = compare_runs(first, other)
    assert different.patches[0].p_value < 1e-6
    said = labrig("runs", "compare", first, other).out
    assert "asked differently: sample.name: blue-paint | green-paint" in said
    assert "the rates differ" in said
    assert "the rates agree" in labrig("runs", "compare", first, again).out


def test_runs_that_cannot_be_compared_say_why(week: Path, tmp_path: Path, labrig: Labrig) -> None:
    decay, *_, cut = (run.folder for run in list_runs(week, RunFilter()))
    blank = RECORD["blank"](tmp_path)
    waiting = labrig("runs", "compare", decay, blank)
    assert (waiting.code, len(waiting.err.splitlines())) == (4, 1)
    assert f"labrig process {blank}" in waiting.err
    processed_once(blank)
    other = Path(shutil.copytree(blank, tmp_path / "other"))
    for pair in ((decay, blank), (blank, decay), (blank, other)):
        refused = labrig("runs", "compare", *pair)
        assert (refused.code, len(refused.err.splitlines())) == (2, 1)
        assert "not comparable" in refused.err
        assert ("both are runs of blank" in refused.err) == (pair == (blank, other))
    stacked = labrig("runs", "stack", blank)
    assert (stacked.code, len(stacked.err.splitlines())) == (2, 1)
    assert "got one of blank" in stacked.err
    unfinished = labrig("runs", "compare", decay, cut)
    assert (unfinished.code, len(unfinished.err.splitlines())) == (4, 1)
    assert f"labrig resume {cut}" in unfinished.err


@pytest.fixture
def two_days(tmp_path: Path) -> tuple[Path, Path]:
    """A paint and two sources that stay: a phosphor and a steady one.

    B's camera gives 0.8 of A's signal in R and 0.5 in G. The paint is brightest in R, the others
    in G.
    """
    rng = np.random.default_rng(1)
    for run, of_r, of_g in (("a", 1.0, 1.0), ("b", 0.8, 0.5)):
        for patch, r, g in (
            ("sticker", 60.0, 100.0),
            ("paint", 50.0, 20.0),
            ("diode", 30.0, 300.0),
        ):
            place = tmp_path / run / "result" / patch
            place.mkdir(parents=True)
            signal = np.array([r * of_r, g * of_g])
            frames = np.outer(1 + 0.007 * rng.standard_normal(40), signal)
            rows = [f"{5 * n},1,{frame[0]},0.1,{frame[1]},0.1" for n, frame in enumerate(frames)]
            table = "\n".join(["t_s,exposure_s,R,R_sigma,G,G_sigma", *rows])
            (place / "series.csv").write_text(table)
            if patch == "diode":
                continue
            weights = dict(zip("RG", signal / signal.max(), strict=True))
            fit = decay_result((0.01, float(signal.max())), sigma=0.004, weights=weights)
            write_fitted_decay(place / "fit.json", fit)
        (tmp_path / run / "protocol.yaml").write_text("protocol: decay\n")
    return tmp_path / "a", tmp_path / "b"


@pytest.mark.parametrize("reference", ["sticker", "diode"])
def test_a_reference_ties_the_amplitudes_of_two_days_together(
    two_days: tuple[Path, Path], labrig: Labrig, reference: str
) -> None:
    (free,) = (p for p in compare_runs(*two_days).patches if p.patch == "paint")
    assert free.differences[1].pull < -10
    tied = compare_runs(*two_days, reference)
    (paint,) = (p for p in tied.patches if p.patch == "paint")
    assert reference not in [patch.patch for patch in tied.patches]
    assert paint.differences[1].b.value == pytest.approx(50.0, rel=0.01)
    assert paint.differences[1].b.sigma > 0.2
    assert abs(paint.differences[1].pull) < 2
    assert abs(paint.gain.value - 1.25) < 3 * paint.gain.sigma
    assert 0.001 < paint.gain.sigma < 0.02
    said = labrig("runs", "compare", *two_days, "--reference", reference).out
    assert "a of run B is multiplied by 1.2" in said


def test_what_is_no_reference_is_reported_in_a_line(
    two_days: tuple[Path, Path], labrig: Labrig
) -> None:
    a, b = two_days
    ended = labrig("runs", "compare", a, b, "--reference", "diod")
    assert (ended.code, len(ended.err.splitlines())) == (2, 1)
    assert "did you mean 'diode'?" in ended.err
    (b / "result" / "sticker" / "fit.json").unlink()
    ended = labrig("runs", "compare", a, b, "--reference", "sticker")
    assert (ended.code, len(ended.err.splitlines())) == (2, 1)
    assert "steady in the other" in ended.err
    (b / "result" / "diode" / "series.csv").write_text("t_s,exposure_s,G\n0,1,0\n1,1,0\n")
    ended = labrig("runs", "compare", a, b, "--reference", "diode")
    assert (ended.code, len(ended.err.splitlines())) == (4, 1)


def test_one_patch_is_compared_with_one_patch_whatever_it_is_called(
    week: Path, tmp_path: Path
) -> None:
    first, again, *_ = (run.folder for run in list_runs(week, RunFilter()))
    renamed = shutil.copytree(again, tmp_path / "renamed")
    protocol = read_quickly((renamed / "protocol.yaml").read_text())
    protocol["patches"] = {"paint": protocol["patches"]["sample"]}
    (renamed / "protocol.yaml").write_text(write_quickly(protocol))
    compared = compare_runs(first, renamed)
    assert [patch.patch for patch in compared.patches] == ["sample"]
    assert compared.missing == ()
    assert compared.protocol_differences == (("repeats", 1, 2),)


def test_results_are_shown_with_what_they_were_made_with(
    week: Path, tmp_path: Path, labrig: Labrig
) -> None:
    run = shutil.copytree(week / "2026-01-04T00-00-00_decay_green-paint", tmp_path / "again")
    refit = labrig("process", "again", "--runs", tmp_path, "--states", "1", "--exclude", "10")
    assert refit.code == 0, refit.err
    assert refit.out.splitlines()[-1] == str(run)
    shown = labrig("runs", "show", run).out
    for line in ("states: auto → 1", "excluded: none → "):
        assert line in shown, shown
    _, new, old = re.split(r"^  result.*:$", shown, flags=re.M)
    rates = [re.findall(r"^    \d      (0\.\d+)\(", text, re.M) for text in (new, old)]
    assert [float(rate[0]) for rate in rates] == pytest.approx([0.22, 0.22], rel=0.1)


def test_a_reference_that_is_no_patch_is_reported_in_a_line(week: Path, labrig: Labrig) -> None:
    first, *_ = (run.folder for run in list_runs(week, RunFilter()))
    ended = labrig("runs", "compare", first, first, "--reference", "lamp")
    assert (ended.code, len(ended.err.splitlines())) == (2, 1)
