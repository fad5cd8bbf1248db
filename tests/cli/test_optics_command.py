"""`labrig optics show`."""

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.conftest import Ended

Labrig = Callable[..., Ended]


@pytest.mark.drawn
def test_a_shipped_camera(labrig: Labrig, tmp_path: Path) -> None:
    picture = tmp_path / "camera.svg"
    ended = labrig("optics", "show", "canon_eos_5d_mark_ii", "--picture", picture)
    assert ended.code == 0
    assert "Canon EOS 5D Mark II: 3 curves" in ended.out
    assert "G  380-780 nm, step 5; 0.000163 to 1, highest at 520 nm" in ended.out
    assert "█" in ended.out
    assert picture.read_text(encoding="utf-8").count("<path") > 3


def test_one_curve_of_many(labrig: Labrig, tmp_path: Path) -> None:
    names = [f"led{k}" for k in range(20)]
    rows = [f"{nm}," + ",".join(["1"] * 20) for nm in (400, 500, 601)]
    path = tmp_path / "leds.csv"
    path.write_text("\n".join([",".join(["wavelength_nm", *names]), *rows]))
    every = labrig("optics", "show", path)
    assert "20 curves" in every.out
    assert "and 8 more" in every.out
    one = labrig("optics", "show", path, "--curve", "led7")
    assert "one curve" in one.out
    assert "400-601 nm, 3 points" in one.out


@pytest.mark.drawn
@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (["nope"], 2, "no shipped camera is called 'nope'"),
        (["none.csv"], 2, "none.csv: no such file"),
        (["bad.csv"], 2, "something is not a number"),
        (["twice.csv"], 2, "a wavelength stands twice"),
        (["canon_eos_5d_mark_ii", "--curve", "X"], 2, "no curve is called 'X'"),
        (
            ["canon_eos_5d_mark_ii", "--picture", "x.bmp"],
            2,
            "expected a file name that ends in .png",
        ),
        (["canon_eos_5d_mark_ii", "--picture", "none/x.png"], 5, "cannot be written"),
    ],
)
def test_what_is_wrong_is_one_line(
    labrig: Labrig,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    code: int,
    said: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("bad.csv").write_text("wavelength_nm,a\n400,1\n500,x\n", encoding="utf-8")
    Path("twice.csv").write_text("wavelength_nm,a\n400,1\n400,2\n500,2\n", encoding="utf-8")
    ended = labrig("optics", "show", *arguments)
    assert ended.code == code
    assert said in ended.err
    assert ended.err.count("\n") == 1


def test_the_largest_number_is_drawn(labrig: Labrig, tmp_path: Path) -> None:
    path = tmp_path / "large.csv"
    path.write_text("wavelength_nm,value\n400,0\n500,1e308\n600,0\n")
    ended = labrig("optics", "show", path)
    assert ended.code == 0
    assert "▁" in ended.out
    assert ended.err == ""


def test_all_that_is_shipped_is_listed(labrig: Labrig) -> None:
    ended = labrig("optics", "list")
    assert ended.code == 0
    lines = [" ".join(line.split()) for line in ended.out.splitlines()]
    assert "canon_eos_600d Canon EOS 600D" in lines
    assert "nikon_d5100 Nikon D5100 every channel scaled to 1" in lines
    assert any(line.startswith("halogen_3000k A halogen lamp") for line in lines)
    assert "bandpass-425" in ended.out
