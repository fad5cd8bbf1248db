"""Isotropy of a simulated sample against the truth."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from labrig.analyse.isotropy import View, process
from labrig.analyse.part import Part
from labrig.errors import DataError
from labrig.process import process_run
from labrig.report import figure_style
from tests.analyse.spectral_bench import record, stage_of

QUICK = {"protocol": "isotropy", "charge": "2 min", "frames": 2, "angles": [40, 80],
         "first": "30 s"}  # fmt: skip


def views(part: Part) -> dict[int, View]:
    rows = (part.folder / "isotropy.csv").read_text().splitlines()[1:]
    found = [row.split(",") for row in rows]
    return {int(angle): View(int(angle), float(r), float(s)) for _, angle, r, s in found}


@pytest.mark.parametrize("anisotropy", [0.0, 0.15])
def test_what_the_sample_loses_to_the_side_is_found(tmp_path: Path, anisotropy: float) -> None:
    part = stage_of(record(tmp_path, QUICK, anisotropy=anisotropy), tmp_path)
    with figure_style():
        result = process(part)
    for angle, view in views(part).items():
        true = 1 - anisotropy * (1 - np.cos(np.radians(angle)))
        assert abs(view.ratio - true) < 3 * view.sigma
        assert view.sigma < 0.02
    told = any("not isotropic" in warning for warning in result.warnings)
    assert told == (anisotropy > 0)
    assert ("at 80°" in result.lines[0]) or not told
    assert len(result.sections[0].figures) == 1
    attempts = [attempt for attempt in part.run.attempts if attempt.unit != "angle-after"]
    with pytest.raises(DataError, match="between two straight ones"):
        process(replace(part, run=replace(part.run, attempts=attempts)))


def test_around_a_whole_sample_the_cosine_is_divided_out(tmp_path: Path) -> None:
    part = stage_of(record(tmp_path, QUICK | {"patch": "around"}), tmp_path)
    with figure_style():
        process(part)
    for angle, view in views(part).items():
        assert view.ratio * np.cos(np.radians(angle)) == pytest.approx(1.0, abs=0.03)


def test_the_report_tells_how_late_shield_and_door_were(tmp_path: Path) -> None:
    page = process_run(record(tmp_path, QUICK | {"angles": [80]})).report.read_text()
    assert "shield cover at most" in page
    assert "door open at most 0 ms" in page
