"""A bench is calibrated once, in the simulated room, and samples are measured with that."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from labrig.foundation import resources
from labrig.material import read_material
from labrig.process import process_run
from labrig.protocols.calibration.result import CalibrationResult
from labrig.protocols.calibration_check.result import CalibrationCheckResult
from labrig.protocols.phosphor.result import PhosphorResult
from tests.acceptance.whole_phosphor import errors
from tests.analyse.recorded import record
from tests.analyse.small_runs import IRRADIANCE, LVF_CALIBRATION, calibration, small_bench
from tests.quick_yaml import read_quickly
from tests.results.made import assert_read_back

SPECTRUM = {"protocol": "emission_spectrum", "times": ["2 s", "10 s"], "longest": "10 s",
            "charge": "3 min"}  # fmt: skip


@pytest.mark.campaign
def test_what_a_calibration_finds_is_used_by_the_next_run(tmp_path: Path) -> None:
    calibrated = process_run(calibration(tmp_path))
    assert isinstance(calibrated, CalibrationResult)
    assert list(calibrated.parts) == ["lvf_calibration", "irradiance"]
    assert calibrated.reference.lens == "EF75mm, 75 mm"
    assert_read_back(calibrated)
    chain = {"protocol": "phosphor", "sample": {"name": "blue-paint"}}
    run = record(tmp_path, chain | {"parts": [LVF_CALIBRATION, IRRADIANCE, SPECTRUM]}, small_bench)
    result = process_run(run)
    assert isinstance(result, PhosphorResult)
    assert list(result.parts) == ["calibration_check", "emission_spectrum"]
    check = result.parts["calibration_check"]
    assert isinstance(check, CalibrationCheckResult)
    assert check.change.brightness.value == pytest.approx(1, abs=0.03)
    assert not check.warnings
    optics = read_quickly((run / "rig.yaml").read_text())["optics"]
    assert "calibrations" in Path(optics["lvf"]).parts
    assert "Age when the run began" in (run / "result" / "report.html").read_text()


@pytest.mark.campaign
def test_two_paints_with_one_calibration_are_as_good_as_with_their_own(tmp_path: Path) -> None:
    def wide(rig: dict[str, Any]) -> None:
        rig["simulation"]["sensor"] = {"width": 384, "height": 64}

    calibration = read_quickly(resources.find("protocols", "protocol", "calibration").read_text())
    process_run(record(tmp_path, calibration, wide))
    chain = read_quickly(resources.find("protocols", "protocol", "phosphor").read_text())
    for name in ("blue-paint", "green-paint"):

        def painted(rig: dict[str, Any], name: str = name) -> None:
            wide(rig)
            rig["simulation"]["sample"] = [{"material": name, "region": [0.03, 0.1, 0.94, 0.8]}]

        run = record(tmp_path, chain | {"sample": {"name": name}}, painted)
        result = process_run(run)
        assert isinstance(result, PhosphorResult)
        assert list(result.parts) == [
            "calibration_check", "emission_spectrum", "decay", "excitation"
        ]  # fmt: skip
        found = read_material(run / "result" / "material.yaml")
        (one,) = errors(found, read_material(name), brightness=1.0)
        assert np.abs(one.k_e_percent).max() < 10
        assert np.abs([*one.k_e, one.k_r, one.r0_off]).max() < 3
