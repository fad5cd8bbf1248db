"""`labrig material`: what is told, written and refused."""

import csv
import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import OpenEXR
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
    sample = measurement(11, YELLOW)
    write_reradiation(tmp_path / "paper.csv", sample.measured)
    out = tmp_path / "mixture"
    arguments = ("fit", "mixture", tmp_path / "paper.csv", "--components", "2")
    ended = labrig(*arguments, "--json", "--out", out)
    assert ended.code == 0
    fit = json.loads(ended.out)
    assert json.loads((out / "fit.json").read_text()) == fit
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "--components 2 --scale integral" in page
    assert {path.stem for path in (out / "figures").glob("*.svg")} > {"1-measured", "1-mixture"}
    components = fit["components"]
    assert_allclose(sum(part["weight"] for part in components), 1)
    centre = sum(part["weight"] * np.array(part["mean"]) for part in components)
    truth = np.where(sample.truth.is_stokes, sample.truth.reradiation, 0.0)
    expected = [
        np.average(sample.truth.input_nm, weights=truth.sum(axis=0)),
        np.average(sample.truth.output_nm, weights=truth.sum(axis=1)),
    ]
    # The tails are below the noise.
    assert_allclose(centre, expected, atol=15)
    assert fit["masked_mse"] < 1e-5
    assert [row["light"] for row in fit["colours"]] == ["D65", "A", "450nm", "395nm"]
    assert fit["colours"][0]["delta_e"] < 3
    assert "2 components, as asked for" in labrig(*arguments).out


def test_materials_on_other_grids_are_compared(labrig: Labrig, dyed: Path, tmp_path: Path) -> None:
    other = surface().rebinned(np.arange(302.0, 700.0, 6.0), np.arange(400.0, 720.0, 5.0))
    write_reradiation(tmp_path / "other.csv", other)
    ended = labrig("material", "compare", tmp_path / "other.csv", dyed, "--light", "D65", "--json")
    (row,) = json.loads(ended.out)
    assert row["delta_e"] < 1


def test_a_black_reference_is_told(labrig: Labrig, dyed: Path, tmp_path: Path) -> None:
    write_reradiation(tmp_path / "black.csv", surface(0.0, 0.0))
    ended = labrig("material", "compare", dyed, tmp_path / "black.csv", "--light", "450nm")
    assert ended.code == 0
    assert "nan" not in ended.out
    assert "the reference is black" in ended.out


def test_showing_loads_neither_colour_science_nor_matplotlib(dyed: Path) -> None:
    code = (
        "import sys; from labrig.cli import guarded; "
        f"guarded(['material', 'show', {str(dyed)!r}]); "
        "print({'colour', 'matplotlib', 'cv2'} & set(sys.modules))"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ended.stdout.splitlines()[-1] == "set()"


#: Broken files by name: content, and what is told of it.
BROKEN: dict[str, tuple[bytes, str]] = {
    "ragged.csv": (b"out\\in,300,310\n380,0.1\n390,0.1,0.2\n", "line 2: expected 3 cells"),
    "column.csv": (b"out\\in,300\n380,0.1\n390,0.1\n", "two or more wavelengths, got 1"),
    "row.csv": (b"out\\in,300,310\n380,0.1,0.1\n", "two or more wavelengths, got 1"),
    "nan.csv": (b"out\\in,300,310\n380,0.1,nan\n390,0,0\n", "line 2: expected a finite number"),
    "inf.csv": (b"out\\in,300,310\n380,0.1,inf\n390,0,0\n", "line 2: expected a finite number"),
    "empty.csv": (b"", "expected a header"),
    "empty.exr": (b"", "not an OpenEXR image"),
    "empty.ark": (b"", "ART measurement archive"),
    "empty.bfc": (b"", "BFC-450 Matrix File"),
    "empty.txt": (b"", "expected an excitation-emission matrix, got no rows"),
    "empty.yaml": (b"", "got nothing"),
    "binary.csv": (b"\x81\x8d\x00\xfe", "UTF-8"),
    "binary.exr": (b"\x76\x2f\x31\x01\xff\xfe\x00\x81", "not an OpenEXR image"),
    "binary.ark": (b"\x81\x8d\x00\xfe", "UTF-8"),
    "binary.bfc": (b"\x81\x8d\xfe\x00", "BFC-450 Matrix File"),
    "binary.txt": (b"\x81\x8d\x00\xfe", "UTF-8"),
    "binary.yaml": (b"\x81\x8d\xfe\x00", "UTF-8"),
    "lost.yaml": (b"name: a\nkind: fluorescent\nmatrix: a.csv\n", "a.csv, got no such file"),
    "kind.yaml": (b"name: a\nkind: metal\n", "'kind: phosphor'"),
}


def refused_in_one_line(ended: Ended, code: int, message: str) -> None:
    assert (ended.code, len(ended.err.strip().splitlines())) == (code, 1), ended.err
    assert message in ended.err


@pytest.mark.parametrize("name", BROKEN)
def test_broken_files_are_refused(labrig: Labrig, tmp_path: Path, name: str) -> None:
    content, message = BROKEN[name]
    (tmp_path / name).write_bytes(content)
    refused_in_one_line(labrig("material", "show", tmp_path / name), 2, message)


@pytest.mark.parametrize("name", ["a.csv", "a.exr", "a.bfc"])
def test_a_folder_is_no_file(labrig: Labrig, tmp_path: Path, name: str) -> None:
    (tmp_path / name).mkdir()
    refused_in_one_line(labrig("material", "show", tmp_path / name), 2, "a folder")


def test_broken_images_are_refused(labrig: Labrig, dyed: Path, tmp_path: Path) -> None:
    image = tmp_path / "image.exr"
    assert labrig("material", "convert", dyed, image).code == 0
    content = image.read_bytes()
    for broken in (content[:300], content[: len(content) // 2], content[:-300] + bytes(300)):
        image.write_bytes(broken)
        refused_in_one_line(labrig("material", "show", image), 2, "broken")
    OpenEXR.File({}, {"R": np.zeros((2, 2), np.float32)}).write(str(image))
    refused_in_one_line(labrig("material", "show", image), 2, "spectralLayoutVersion")


@pytest.mark.parametrize(
    ("reflectance", "into", "message"),
    [(-0.3, 0.1, "expected a reflectance"), (0.9, 0.5, "expected at most 1.1")],
)
@pytest.mark.parametrize("command", ["show", "convert", "apply", "compare", "mixture"])
def test_what_no_surface_can_do_is_refused(
    labrig: Labrig, dyed: Path, tmp_path: Path, command: str, reflectance: float, into: float,
    message: str,
) -> None:  # fmt: skip
    wrong, out = tmp_path / "wrong.csv", tmp_path / "out.csv"
    write_reradiation(wrong, surface(reflectance, into))
    ended = {
        "show": lambda: labrig("material", "show", wrong),
        "convert": lambda: labrig("material", "convert", wrong, out),
        "apply": lambda: labrig("material", "apply", wrong, "--light", "A", "--out", out),
        "compare": lambda: labrig("material", "compare", dyed, wrong),
        "mixture": lambda: labrig("fit", "mixture", wrong, "--threshold", "0.01"),
    }[command]()
    refused_in_one_line(ended, 4, message)
    assert "wrong.csv" in ended.err
    assert not out.exists()


def test_relative_reradiation_has_no_colour_to_compare(
    labrig: Labrig, dyed: Path, tmp_path: Path
) -> None:
    eem = tmp_path / "eem.csv"
    relative = replace(surface(), unit="relative", reflectance=np.full(len(NM), np.nan))
    write_reradiation(eem, relative)
    refused_in_one_line(labrig("material", "compare", dyed, eem), 2, "got relative re-radiation")


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["--components", "0"], 2, "from 1 on"),
        (["--components=-1"], 2, "from 1 on"),
        (["--components", "many"], 2, "or 'auto'"),
        (["--components", "1000"], 2, "got 1000"),
        (["--threshold", "0"], 2, "above 0"),
        (["--threshold", "nan"], 2, "above 0"),
        (["--threshold", "9"], 4, "lower the threshold"),
        (["--scale", "best"], 2, "--scale"),
        (["--light", "D66"], 2, "D65"),
        (["--pixel", "1"], 2, "--pixel"),
    ],
)
def test_mixtures_that_cannot_be_are_told_in_one_line(
    labrig: Labrig, tmp_path: Path, arguments: list[str], code: int, message: str
) -> None:
    write_reradiation(tmp_path / "paper.csv", measurement(11, YELLOW).measured)
    ended = labrig("fit", "mixture", tmp_path / "paper.csv", *arguments)
    refused_in_one_line(ended, code, message)


def test_a_mixture_needs_a_threshold_where_there_is_no_noise(labrig: Labrig, dyed: Path) -> None:
    refused_in_one_line(labrig("fit", "mixture", dyed), 2, "or a threshold")


@pytest.mark.parametrize(
    "in_the_way",
    [
        "fit.json",
        *(pytest.param(one, marks=pytest.mark.campaign) for one in ("report.html", "figures")),
    ],
)
def test_a_mixture_that_cannot_be_written(labrig: Labrig, tmp_path: Path, in_the_way: str) -> None:
    write_reradiation(tmp_path / "paper.csv", measurement(11, YELLOW).measured)
    fit = ("fit", "mixture", tmp_path / "paper.csv", "--components", "1")
    out = tmp_path / "out"
    if in_the_way == "figures":
        out.mkdir()
        (out / in_the_way).touch()
    else:
        (out / in_the_way).mkdir(parents=True)
    refused_in_one_line(labrig(*fit, "--out", out), 5, "cannot be written")
    (tmp_path / "file").touch()
    refused_in_one_line(labrig(*fit, "--out", tmp_path / "file"), 2, "expected a folder")
    refused_in_one_line(labrig(*fit, "--out", tmp_path / "file" / "deep"), 2, "expected a folder")


@pytest.mark.drawn
@pytest.mark.parametrize(
    "arguments",
    [
        ["show", "DYED", "--picture", "none/x.png"],
        ["show", "blue-paint", "--picture", "none/x.png"],
        ["convert", "DYED", "none/x.csv"],
        ["convert", "DYED", "none/x.exr"],
        ["convert", "DYED", "none/x.yaml"],
        ["apply", "DYED", "--light", "A", "--out", "none/x.csv"],
    ],
)
def test_what_cannot_be_written(
    labrig: Labrig, dyed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    ended = labrig("material", *(dyed if part == "DYED" else part for part in arguments))
    refused_in_one_line(ended, 5, "cannot be written")


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
