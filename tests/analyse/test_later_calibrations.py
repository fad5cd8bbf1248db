"""Calibrations that a person names once the run is recorded."""

from collections.abc import Callable
from pathlib import Path

import pytest

from labrig.analyse.overrides import Overrides
from labrig.calibration import BLANK_KIND
from labrig.foundation.errors import UsageError
from labrig.process import process_run
from tests.analyse.recorded import record
from tests.calibration.blanks import BLANK
from tests.conftest import Ended
from tests.quick_yaml import read_quickly
from tests.warned import codes, of_code

DECAY = {"protocol": "decay", "sample": {"name": "test"}, "charge": "60 s", "for": "40 s",
         "first": "3 s", "exposure": "1 s"}  # fmt: skip


def test_one_that_came_later_is_used_and_recorded(tmp_path: Path) -> None:
    run, file = record(tmp_path, DECAY), tmp_path / "blank.yaml"
    leaking = {"channels": ("R", "G", "B"), "ambient_dn_per_s": (0.0, 3.0, 0.0)}
    three = {
        "rate_dn_per_s": ((0.0,) * 3,) * 2,
        "sigma_dn_per_s": ((1.0,) * 3,) * 2,
        "constant_dn_per_s": (0.0,) * 3,
        "constant_dn_per_s_sigma": (1.0,) * 3,
        "ambient_dn_per_s_sigma": (0.1,) * 3,
    }
    BLANK_KIND.write(tmp_path, BLANK.model_copy(update=three | leaking))
    assert "stray-light" not in codes(process_run(run).warnings)
    result = process_run(run, Overrides.parse([], [], optics=[f"blank={file}"]))
    assert of_code(result.warnings, "stray-light").values["channel"] == "G"
    made_with = read_quickly((run / "result" / "provenance.yaml").read_text())
    assert made_with["optics"] == {"blank": str(file)}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("blank", "expected KEY=PATH"),
        ("blnk=x.yaml", "did you mean 'blank'"),
        ("=x.yaml", "expected KEY=PATH"),
    ],
)
def test_what_is_no_calibration_is_one_clear_line(text: str, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        Overrides.parse([], [], optics=[text])


@pytest.mark.parametrize(
    ("protocol", "missing"),
    [("excitation", "irradiance"), ("emission_spectrum", "lvf_calibration"), ("phosphor", None)],
)
def test_what_is_still_to_be_measured_is_reported_before_anything_begins(
    protocol: str, missing: str | None, labrig: Callable[..., Ended]
) -> None:
    ended = labrig("plan", protocol, "--rig", "sim-phosphor")
    assert ended.code == 0
    notes = [
        line
        for line in ended.err.splitlines()
        if line.startswith("note: ") and "calibrate the bench" not in line
    ]
    assert len(notes) == (missing is not None)
    assert all(f"needs {missing}" in note and "--optics" in note for note in notes)
