"""`labrig fit luminance`: what a luminance meter logged, and what a standard asks of it."""

import json
from pathlib import Path

import numpy as np
import pytest

from labrig.cli.exit_codes import guarded

T_MIN = np.geomspace(1, 600, 60)
LIGHT = 290 * (1 + T_MIN) ** -1.1


def logged(path: Path, head: str, factor: float = 1.0, minutes: float = 1.0) -> Path:
    rows = [
        f"{t * minutes:.6g};{light * factor:.6g}" for t, light in zip(T_MIN, LIGHT, strict=True)
    ]
    path.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("head", "factor", "minutes", "options"),
    [
        ("t_s;luminance_mcd", 1.0, 60.0, []),
        ("Zeit [min];L [cd/m²]", 1e-3, 1.0, []),
        ("time / h;L / mcd/m2", 1.0, 1 / 60, []),
        ("t_s;L", 1e-3, 60.0, ["--unit", "cd/m²"]),
        ("t_s;L", 1e3, 60.0, ["--unit", "ucd/m2"]),
    ],
)
def test_the_marking_does_not_depend_on_units(
    head: str,
    factor: float,
    minutes: float,
    options: list[str],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    table = logged(tmp_path / "log.csv", head, factor, minutes)
    arguments = ["fit", "luminance", str(table), "--colours", "K-W", "--json", *options]
    assert guarded([*arguments, "--require", "20 mcd/m2 at 10 min"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["marking"] == "20.7/3.15-516-K-W"
    assert [each["verdict"] for each in result["requirements"]] == ["pass"]


def test_times_count_from_lamp_off(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = tmp_path / "log.csv"
    rows = [f"{60 * t + 500:.6g},{light:.6g}" for t, light in zip(T_MIN, LIGHT, strict=True)]
    table.write_text("\n".join(["t_s,L", "400,9", *rows]) + "\n")
    assert guarded(["fit", "luminance", str(table), "--off", "500", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["marking"] == "20.7/3.15-516"


@pytest.mark.parametrize(
    "options",
    [
        ["--unit", "lx"],
        ["--require", "20 at 10 min"],
        ["--require", "20 lx at 10 min"],
        ["--require", "20 mcd/m2 at ten"],
        ["--require", "-1 mcd/m2 at 10 min"],
        ["--scale-sigma", "4"],
        ["--column", "M"],
    ],
)
def test_options_that_cannot_be_are_one_line(
    options: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = logged(tmp_path / "log.csv", "t_s;L")
    assert guarded(["fit", "luminance", str(table), *options]) == 2
    assert capsys.readouterr().err.count("\n") == 1
