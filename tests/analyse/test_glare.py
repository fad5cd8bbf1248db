"""Veiling glare of the simulated lens: measured by a black trap, subtracted, or warned of."""

from pathlib import Path
from typing import Any

import pytest

from labrig.calibration import CAMERA_KIND, CameraFile
from labrig.foundation.errors import UsageError
from labrig.material import read_material
from labrig.process import process_run
from tests.analyse.recorded import record
from tests.warned import of_code

GLARE = 0.01
CALIBRATION: dict[str, Any] = {
    "protocol": "camera_calibration",
    "sample": {"name": "camera"},
    "camera": {"iso": 400, "f_number": 4},
    "isos": [400],
    "f_numbers": [4],
    "card": [0.2, 0.05, 0.75, 0.9],
    "black": [0.02, 0.3, 0.12, 0.4],
    "levels": 3,
    "repeats": 6,
    "cycles": 2,
    "every_nth_shutter_time": 9,
}
DECAY: dict[str, Any] = {
    "protocol": "decay",
    "sample": {"name": "two"},
    "charge": "30 min",
    "every": "5 s",
    "for": "90 s",
    "patches": {"bright": [0.05, 0.1, 0.7, 0.8], "dim": [0.85, 0.3, 0.1, 0.4]},
    "states": 1,
}


def veiled(rig: dict[str, Any]) -> None:
    rig["simulation"] |= {
        "imaging": {"glare": GLARE},
        "black_trap": [0.01, 0.2, 0.15, 0.6],
        "sample": [
            {"material": "blue-paint", "region": [0.03, 0.05, 0.75, 0.9]},
            {"material": "red-paint", "region": [0.82, 0.2, 0.16, 0.6]},
        ],
    }


@pytest.fixture(scope="module")
def camera(tmp_path_factory: pytest.TempPathFactory) -> Any:
    run: Any = process_run(record(tmp_path_factory.mktemp("camera"), CALIBRATION, veiled))
    return run.calibration


@pytest.mark.campaign
def test_the_trap_shows_the_lens_glare(camera: CameraFile) -> None:
    assert camera.glare is not None
    assert abs(camera.glare.fraction - GLARE) < 3 * camera.glare.sigma
    assert camera.glare.sigma < 0.1 * GLARE


@pytest.mark.campaign
def test_calibrated_it_is_subtracted(camera: CameraFile, tmp_path: Path) -> None:
    """Without it the dim patch decays too fast, by three of its σ."""

    def calibrated(rig: dict[str, Any]) -> None:
        veiled(rig)
        CAMERA_KIND.write(tmp_path, camera)
        rig["optics"]["camera_file"] = str(tmp_path / "camera.yaml")

    result: Any = process_run(record(tmp_path / "calibrated", DECAY, calibrated))
    assert result.warnings == ()
    for name, material in (("bright", "blue-paint"), ("dim", "red-paint")):
        (state,), (true,) = result.patches[name].fit.states, read_material(material).states
        assert abs(state.k_r_per_s - true.k_r_per_s) < 2.5 * state.k_r_per_s_sigma


def test_not_calibrated_a_line_names_the_dim_patch(tmp_path: Path) -> None:
    warnings = process_run(record(tmp_path, DECAY, veiled)).warnings
    assert of_code(warnings, "glare-unmeasured").values["patches"] == ("dim",)


def test_a_sample_that_is_most_of_the_light_is_not_veiled(tmp_path: Path) -> None:
    """The lens scatters its light, but with the course of its own."""
    alone = {key: value for key, value in DECAY.items() if key != "patches"}

    def glare(rig: dict[str, Any]) -> None:
        rig["simulation"]["imaging"] = {"glare": GLARE}

    assert process_run(record(tmp_path, alone, glare)).warnings == ()


def test_a_trap_in_the_card_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="expected 'black' beside 'card', got a part of it"):
        record(tmp_path, CALIBRATION | {"black": [0.3, 0.3, 0.1, 0.1]})
