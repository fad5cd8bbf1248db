"""Every shipped material through the whole simulated pipeline, on a smaller sensor.

Figures on the full sensor: `python -m tests.acceptance.decays_of_all_materials`.
"""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from labrig import shipped
from labrig.material import read_material
from tests.conftest import Ended

Labrig = Callable[..., Ended]
Make = Callable[..., Path]
EXPONENTIAL = [name for name in shipped.names("config/materials") if name != "power-law"]
#: Small, yet large enough that flicker and not the pixels' noise rules, as on a real sensor.
SENSOR = {"width": 384, "height": 256}
#: Of 45 comparisons with a σ that is right: at 3 σ every eighth change of the room's random numbers
#: would fail one, at 4 σ one of 350. How often rates are within 1 and 2 σ, over many seeds:
#: `python -m tests.acceptance.coverage_pipeline` and `tests.acceptance.decays_of_all_materials`.
MOST_SIGMAS = 4.0
TABLE_1 = [name for name in EXPONENTIAL if not name.startswith("double-")]


def fit_of(folder: Path, patch: str = "") -> dict[str, Any]:
    content: dict[str, Any] = json.loads((folder / "result" / patch / "fit.json").read_text())
    return content


def measured(labrig: Labrig, tmp_path: Path, rig: Path, protocol: str) -> Path:
    ended = labrig("run", protocol, "--rig", rig, "--runs", tmp_path / rig.stem)
    assert ended.code == 0, ended.err
    return ended.run_folder


@pytest.fixture(scope="module")
def fits() -> dict[str, dict[str, Any]]:
    """Of materials that were measured one by one, each once."""
    return {}


@pytest.fixture
def alone(
    labrig: Labrig, make_rig: Make, tmp_path: Path, fits: dict[str, dict[str, Any]]
) -> Callable[[str], dict[str, Any]]:
    """The fit of a material that was measured by itself."""

    def fit(name: str) -> dict[str, Any]:
        if name not in fits:
            rig = make_rig(f"{name}.yaml", sample=name, sensor=SENSOR)
            fits[name] = fit_of(measured(labrig, tmp_path, rig, "decay"))
        return fits[name]

    return fit


@pytest.mark.parametrize("name", EXPONENTIAL)
def test_every_rate_is_within_its_sigma_and_the_states_are_as_many_as_there_are(
    alone: Callable[[str], dict[str, Any]], name: str
) -> None:
    fit = alone(name)
    true = sorted((state.k_r_per_s for state in read_material(name).states), reverse=True)
    assert fit["n_states"] == len(true)
    for state, k_r_per_s in zip(fit["states"], true, strict=True):
        assert abs(state["k_r_per_s"] - k_r_per_s) < MOST_SIGMAS * state["k_r_sigma_per_s"]
        assert state["k_r_sigma_per_s"] < 0.1 * k_r_per_s, "a σ of nothing proves nothing"


def test_a_power_law_is_flagged(labrig: Labrig, make_rig: Make, tmp_path: Path) -> None:
    fit = fit_of(measured(labrig, tmp_path, make_rig(sample="power-law", sensor=SENSOR), "decay"))
    assert any("power law" in warning for warning in fit["warnings"])


def test_eleven_patches_in_one_charge_give_the_rates_of_one_by_one(
    labrig: Labrig, make_rig: Make, tmp_path: Path, alone: Callable[[str], dict[str, Any]]
) -> None:
    together = measured(
        labrig, tmp_path, make_rig("all.yaml", "sim-eleven", sensor=SENSOR), "decay-eleven"
    )
    for name in TABLE_1:
        (one,), (other,) = alone(name)["states"], fit_of(together, name)["states"]
        (true,) = read_material(name).states
        sigma = (one["k_r_sigma_per_s"] ** 2 + other["k_r_sigma_per_s"] ** 2) ** 0.5
        assert abs(one["k_r_per_s"] - other["k_r_per_s"]) < MOST_SIGMAS * sigma, name
        error = abs(other["k_r_per_s"] - true.k_r_per_s)
        assert error < MOST_SIGMAS * other["k_r_sigma_per_s"], name
