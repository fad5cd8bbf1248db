"""`labrig material`: what is told, written and refused."""

import csv
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from labrig.material import ReradiationMatrix, read_reradiation, write_reradiation
from tests.conftest import Ended
from tests.material.reradiation.synthetic import YELLOW, measurement

Labrig = Callable[..., Ended]
NM = np.arange(300.0, 781.0, 10.0)


def surface(reflectance: float = 0.4, into: float = 0.1) -> ReradiationMatrix:
    """A grey surface with a dye that turns 400 nm to 450 nm into 520 nm."""
    values = np.diag(np.full(len(NM), reflectance))
    values[22, 10:16] = into
    return ReradiationMatrix.from_bands("dyed grey", NM, NM, values)


@pytest.fixture
def dyed(tmp_path: Path) -> Path:
    write_reradiation(tmp_path / "dyed.csv", surface())
    return tmp_path / "dyed.csv"


@pytest.mark.drawn
def test_a_fluorescent_material_is_shown(labrig: Labrig, dyed: Path, tmp_path: Path) -> None:
    picture = tmp_path / "dyed.png"
    ended = labrig("material", "show", dyed, "--picture", picture)
    assert ended.code == 0
    assert "dyed grey: fluorescent" in ended.out
    assert "10 % of 400 nm" in ended.out
    assert all(f"under {light}" in ended.out for light in ("D65", "A", "450nm"))
    assert picture.read_bytes().startswith(b"\x89PNG")


@pytest.mark.drawn
def test_a_phosphor_is_shown(labrig: Labrig, tmp_path: Path) -> None:
    ended = labrig("material", "show", "blue-paint", "--picture", tmp_path / "paint.svg")
    assert ended.code == 0
    assert "0.032" in ended.out
    assert (tmp_path / "paint.svg").stat().st_size > 5000


@pytest.mark.parametrize("ending", [".csv", ".ark", ".exr", ".yaml"])
def test_a_matrix_is_converted(labrig: Labrig, dyed: Path, tmp_path: Path, ending: str) -> None:
    out = tmp_path / f"other{ending}"
    assert labrig("material", "convert", dyed, out).code == 0
    shown = labrig("material", "show", out, "--light", "D65")
    assert shown.code == 0
    assert (
        shown.out.splitlines()[1:]
        == labrig("material", "show", dyed, "--light", "D65").out.splitlines()[1:]
    )
    if ending == ".yaml":
        matrix = read_reradiation(tmp_path / "other.csv")
        assert_allclose(matrix.reradiation, surface().reradiation)


def test_the_light_that_comes_back(labrig: Labrig, dyed: Path, tmp_path: Path) -> None:
    light = tmp_path / "even.csv"
    light.write_text("wavelength_nm,value\n250,2\n850,2\n")
    ended = labrig("material", "apply", dyed, "--light", light)
    assert ended.code == 0
    rows = {float(row["wavelength_nm"]): row for row in csv.DictReader(ended.out.splitlines())}
    assert_allclose([float(row["reflected"]) for row in rows.values()], 0.8)
    # Six bands of the same width each give a tenth of their light.
    assert_allclose(float(rows[520.0]["reradiated"]), 2 * 6 * 0.1)
    assert_allclose(float(rows[520.0]["total"]), 0.8 + 1.2)
    out = tmp_path / "seen.csv"
    assert labrig("material", "apply", dyed, "--light", light, "--out", out).code == 0
    assert out.read_text().splitlines() == ended.out.splitlines()


def test_two_materials_are_compared(labrig: Labrig, dyed: Path, tmp_path: Path) -> None:
    write_reradiation(tmp_path / "plain.csv", surface(into=0.0))
    ended = labrig(
        "material", "compare", tmp_path / "plain.csv", dyed, "--light", "A", "--light", "450nm",
        "--json",
    )  # fmt: skip
    assert ended.code == 0
    rows = json.loads(ended.out)
    assert [(row["light"], row["white"]) for row in rows] == [("A", "light"), ("450nm", "D65")]
    assert 0.5 < rows[0]["delta_e"] < rows[1]["delta_e"]
    same = json.loads(labrig("material", "compare", dyed, dyed, "--json").out)
    assert [row["delta_e"] for row in same] == [0.0] * 3


@pytest.mark.drawn
def test_the_materials_of_a_folder(labrig: Labrig, dyed: Path, tmp_path: Path) -> None:
    write_reradiation(tmp_path / "plain.csv", surface(into=0.0))
    (tmp_path / "broken.csv").write_text("out_nm\\in_nm,300,310\n380,0.1\n")
    ended = labrig("material", "list", tmp_path, "--picture", tmp_path / "sheet.png")
    assert ended.code == 0
    assert "10 % of 400 nm" in ended.out
    assert "broken.csv" in ended.err
    assert (tmp_path / "sheet.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.drawn
def test_a_mixture_stands_for_a_matrix(labrig: Labrig, tmp_path: Path) -> None:
    one = measurement(11, YELLOW)
    write_reradiation(tmp_path / "paper.csv", one.measured)
    out = tmp_path / "mixture"
    arguments = ("fit", "mixture", tmp_path / "paper.csv", "--components", "2")
    ended = labrig(*arguments, "--json", "--out", out)
    assert ended.code == 0
    fit = json.loads(ended.out)
    assert json.loads((out / "fit.json").read_text()) == fit
    assert (out / "mixture.svg").stat().st_size > 10_000
    components = fit["components"]
    assert_allclose(sum(part["weight"] for part in components), 1)
    centre = sum(part["weight"] * np.array(part["mean"]) for part in components)
    truth = np.where(one.truth.is_stokes, one.truth.reradiation, 0.0)
    expected = [
        np.average(one.truth.input_nm, weights=truth.sum(axis=0)),
        np.average(one.truth.output_nm, weights=truth.sum(axis=1)),
    ]
    # The tails are below the noise.
    assert_allclose(centre, expected, atol=15)
    assert fit["masked_mse"] < 1e-5
    assert {row["light"] for row in fit["colours"]} == {"D65", "A", "450nm"}
    assert fit["colours"][0]["delta_e"] < 3
    assert "2 components, as asked for" in labrig(*arguments).out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["show", "blue-pain"], "blue-paint"),
        (["show", "missing.csv"], "no such file"),
        (["show", "DYED", "--light", "D66"], "D65"),
        (["show", "DYED", "--picture", "a.bmp"], ".png"),
        (["apply", "blue-paint", "--light", "D65"], "expected a fluorescent material"),
        (["convert", "DYED", "a.xyz"], "CSV"),
        (["list", "."], "."),
        (["show", "DYED", "--pixel", "1,2"], "image"),
        (["list", "missing"], "missing"),
    ],
)
def test_what_cannot_be_done_is_told_in_one_line(
    labrig: Labrig,
    dyed: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    message: str,
) -> None:
    (tmp_path / "empty").mkdir()
    monkeypatch.chdir(tmp_path / "empty")
    ended = labrig("material", *(dyed if part == "DYED" else part for part in arguments))
    assert ended.code == 2
    assert message in ended.err
    assert len(ended.err.strip().splitlines()) == 1
