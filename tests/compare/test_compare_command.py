"""`labrig reproduce` of a run on the simulated rig."""

import contextlib
import io
import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import pytest

from labrig.calibration import LVF_KIND, LvfFile
from labrig.calibration.lvf_file import CurveColumns
from labrig.cli.exit_codes import guarded
from labrig.foundation import resources
from labrig.optics import read_camera
from labrig.protocols.phosphor.result import PhosphorResult
from labrig.results import RunResult
from tests.analyse.spectral_bench import true_lvf_file
from tests.conftest import Ended
from tests.quick_yaml import read_quickly, write_quickly
from tests.resealed import reseal

Labrig = Callable[..., Ended]


@dataclass(frozen=True, eq=False, kw_only=True)
class Calibrated(RunResult):
    """A calibration of a filter of which nothing but its file matters."""

    kind: ClassVar[str] = "calibrated"
    file: LvfFile

    def provides(self) -> dict[str, LvfFile]:
        return {"lvf": self.file}


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A decay of a phosphor with two states, processed."""
    folder = tmp_path_factory.mktemp("compared")
    rig = read_quickly((resources.folder("config") / "sim.yaml").read_text())
    rig["simulation"] |= {
        "sensor": {"width": 96, "height": 64},
        "epoch": "2026-01-01T00:00:00Z",
        "initial": {"lamp": "off"},
        "sample": "double-wide",
    }
    protocol = {
        "protocol": "decay",
        "sample": {"name": "double-wide"},
        "charge": "10 min",
        "for": "90 s",
    }
    (folder / "rig.yaml").write_text(write_quickly(rig))
    (folder / "protocol.yaml").write_text(write_quickly(protocol))
    quiet = io.StringIO()
    with contextlib.redirect_stdout(quiet), contextlib.redirect_stderr(quiet):
        code = guarded(
            ["run", str(folder / "protocol.yaml"), "--rig", str(folder / "rig.yaml"),
             "--runs", str(folder / "runs")]
        )  # fmt: skip
    assert code == 0, quiet.getvalue()
    (found,) = (folder / "runs").iterdir()
    return found


def as_edited(run: Path) -> None:
    """Let the result of a run be one for which the edits of its files were taken."""
    path = run / "result" / "provenance.yaml"
    path.write_text(path.read_text().replace("given: []", "given: [--edited]"))


def compared(labrig: Labrig, run: Path, *more: object) -> dict[str, Any]:
    ended = labrig("reproduce", run, "--json", *more)
    assert (ended.code, ended.err) == (0, "")
    said: dict[str, Any] = json.loads(ended.out)
    return said


def test_two_states_are_nearer_to_the_photographs_than_one(labrig: Labrig, run: Path) -> None:
    said = compared(labrig, run, "--material", "double-wide")
    glow = said["glow"]["double-wide"]
    assert glow["mean"]["1 state"] > 5 * glow["mean"]["2 states"]
    assert glow["mean"]["2 states"] < 2 * glow["noise"]
    assert glow["max"]["1 state"] > 5
    # The simulated camera's curves are not quite those it is said to have.
    assert 0.3 < glow["mean"]["material"] < 10
    for ratios in said["residuals"]:
        assert 0 < ratios["rms"]["2"] < 0.2
    (table,) = said["material_comparisons"]
    assert [row["quantity"] for row in table["rows"]] == ["k_r 1", "k_r 2"]
    assert all(abs(row["in_sigma"]) < 5 for row in table["rows"])
    assert len(said["spectra"]) == 12
    for stated in ("white D65", "one factor", "EOS 5D Mark II"):
        assert stated in said["description"]


def test_white_and_normalisation_are_used_and_reported(labrig: Labrig, run: Path) -> None:
    said = compared(labrig, run, "--white", "D50", "--normalise", "each")
    assert "white D50" in said["description"]
    assert "a factor of its own" in said["description"]
    glow = said["glow"]["double-wide"]
    assert glow["mean"] != compared(labrig, run)["glow"]["double-wide"]["mean"]


@pytest.mark.drawn
def test_it_tells_a_person_and_draws(labrig: Labrig, run: Path, tmp_path: Path) -> None:
    ended = labrig("reproduce", run, "--material", "double-wide", "--out", tmp_path / "drawn")
    assert (ended.code, ended.err) == (0, "")
    for said in ("CIEDE2000", "5.46 (10.64)", "The paper does not say", "k_e was not measured"):
        assert said in " ".join(ended.out.split())
    drawn = sorted(path.name for path in (tmp_path / "drawn").iterdir())
    assert drawn == ["glow.pdf", "glow.png", "spectra.pdf", "spectra.png"]
    assert not (run / "comparison").exists()


@pytest.mark.parametrize(
    ("options", "code", "said"),
    [
        (["--white", "D66"], 2, "did you mean 'D65'"),
        (["--normalise", "both"], 2, "expected 'all' or 'each'"),
        (["--material", "blue-pain"], 2, "did you mean 'blue-paint'?"),
        (["--material", "x=blue-paint"], 2, "no patch is called 'x'"),
        (["--camera", "kodak"], 2, "kodak"),
    ],
)
def test_bad_input_is_one_clear_line(
    labrig: Labrig, run: Path, options: list[str], code: int, said: str
) -> None:
    ended = labrig("reproduce", run, *options)
    assert (ended.code, len(ended.err.splitlines())) == (code, 1)
    assert said in ended.err


def test_a_run_without_a_sound_result_is_one_clear_line(
    labrig: Labrig, run: Path, tmp_path: Path
) -> None:
    assert labrig("reproduce", tmp_path / "nothing").code == 2
    copy = tmp_path / "copy"
    shutil.copytree(run, copy)
    (copy / "result" / "fit.json").write_text('{"offsets": 3}')
    damaged = labrig("reproduce", copy)
    assert (damaged.code, len(damaged.err.splitlines())) == (4, 1)
    assert "labrig process" in damaged.err
    shutil.rmtree(copy / "result")
    bare = labrig("reproduce", copy)
    assert (bare.code, len(bare.err.splitlines())) == (4, 1)
    assert "labrig process" in bare.err


@pytest.mark.parametrize(
    "found_by",
    [pytest.param("an earlier run", marks=pytest.mark.campaign), "a part of the chain"],
)
def test_curves_that_a_calibration_found_go_before_the_rigs(
    labrig: Labrig, run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, found_by: str
) -> None:
    known = read_camera("canon_eos_5d_mark_ii")
    found = replace(known, wavelength_nm=known.wavelength_nm + 4.0)
    lvf = true_lvf_file().model_copy(update={"camera": CurveColumns.of(found)})
    copy = Path(shutil.copytree(run, tmp_path / "copy"))
    of_rig = compared(labrig, copy)
    if found_by == "an earlier run":
        LVF_KIND.write(tmp_path, lvf)
        rig = read_quickly((copy / "rig.yaml").read_text())
        rig["optics"]["lvf"] = str(tmp_path / "lvf.yaml")
        (copy / "rig.yaml").write_text(write_quickly(rig))
        as_edited(copy)
    else:
        calibration = Calibrated(file=lvf)
        chain = PhosphorResult(parts={"lvf_calibration": calibration}, failed={}, materials={})
        monkeypatch.setattr("labrig.compare.run.read_result", lambda folder: chain)
    said = compared(labrig, copy)
    assert "as the filter's calibration found them" in said["description"]
    table = [[nm, *row] for nm, row in zip(found.wavelength_nm, found.sensitivity, strict=True)]
    lines = ["wavelength_nm,R,G,B", *(",".join(map(repr, map(float, row))) for row in table)]
    (tmp_path / "found.csv").write_text("\n".join(lines))
    asked = compared(labrig, copy, "--camera", tmp_path / "found.csv")
    assert said["glow"] == asked["glow"] != of_rig["glow"]


def test_without_camera_curves_it_says_so_and_does_the_rest(
    labrig: Labrig, run: Path, tmp_path: Path
) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(run, copy)
    rig = read_quickly((copy / "rig.yaml").read_text())
    del rig["optics"]
    (copy / "rig.yaml").write_text(write_quickly(rig))
    as_edited(copy)
    journal = copy / "journal.jsonl"
    journal.write_text(journal.read_text().replace("Canon EOS 5D Mark II", "Acme One"))
    reseal(journal)
    said = compared(labrig, copy)
    assert "linear sRGB" in said["description"]
    assert said["spectra"] == {}
    assert said["left_out"][0]["code"] == "camera-curves-missing"
