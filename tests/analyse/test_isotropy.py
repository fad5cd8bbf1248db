"""Isotropy of a simulated sample against the truth."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from labrig.foundation.errors import DataError
from labrig.process import process_and_report
from labrig.protocols.isotropy.analysis import analyse
from labrig.protocols.isotropy.result import IsotropyResult
from tests.analyse.recorded import part_of
from tests.analyse.small_runs import ISOTROPY
from tests.analyse.spectral_bench import record
from tests.results.made import assert_read_back
from tests.warned import codes


@pytest.mark.parametrize("anisotropy", [0.0, 0.15])
def test_what_the_sample_loses_to_the_side_is_found(tmp_path: Path, anisotropy: float) -> None:
    part = part_of(record(tmp_path, ISOTROPY, anisotropy=anisotropy))
    result = analyse(part)
    (glow,) = result.patches.values()
    true = 1 - anisotropy * (1 - np.cos(np.radians(glow.angle_deg)))
    assert glow.angle_deg.tolist() == [40, 80]
    assert (np.abs(glow.ratio - true) < 3 * glow.ratio_sigma).all()
    assert (glow.ratio_sigma < 0.02).all()
    warned = "emission-anisotropic" in codes(result.warnings)
    assert warned == (anisotropy > 0)
    assert glow.worst_angle_deg == 80 or not warned
    assert_read_back(result)
    attempts = [attempt for attempt in part.run.attempts if attempt.unit != "angle-after"]
    with pytest.raises(DataError, match="between two straight ones"):
        analyse(replace(part, run=replace(part.run, attempts=attempts)))


def test_around_a_whole_sample_the_cosine_is_divided_out(tmp_path: Path) -> None:
    done = process_and_report(record(tmp_path, ISOTROPY | {"patch": "around"}))
    assert isinstance(done.result, IsotropyResult)
    (glow,) = done.result.patches.values()
    assert glow.ratio * np.cos(np.radians(glow.angle_deg)) == pytest.approx(1.0, abs=0.03)
    rows = (done.report.parent / "isotropy.csv").read_text().splitlines()
    assert len(rows) == 1 + 2
    line, budget = done.lines
    assert budget.startswith("budget of ")
    assert f"(at {glow.worst_angle_deg}°: " in line
    page = done.report.read_text()
    assert "here divided by the cosine" in page
    assert "Glow at an angle relative to the straight view" in page


def test_the_report_tells_how_late_shield_and_door_were(tmp_path: Path) -> None:
    page = process_and_report(record(tmp_path, ISOTROPY | {"angles": [80]})).report.read_text()
    assert "shield cover at most" in page
    assert "door open at most 0 ms" in page
