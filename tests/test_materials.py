"""Shipped materials through the whole simulated pipeline, on a smaller sensor.

Table 1 in one charge, the two kinds of other materials by themselves. Every material by itself, on
the full sensor: `python -m tests.acceptance.decays_of_all_materials`.
"""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from labrig.foundation import resources
from labrig.foundation.result_warning import as_warnings
from labrig.material import read_material
from tests.conftest import Ended
from tests.warned import codes

Labrig = Callable[..., Ended]
Make = Callable[..., Path]
EXPONENTIAL = [name for name in resources.names("config/materials") if name != "power-law"]
#: Small, yet large enough that flicker and not the pixels' noise rules, as on a real sensor.
SENSOR = {"width": 384, "height": 256}
#: Of 20 comparisons with a σ that is right: at 3 σ every twentieth change of the room's random
#: numbers would fail one, at 4 σ one of 800. How often rates are within 1 and 2 σ, over many seeds:
#: `python -m tests.acceptance.coverage_pipeline` and `tests.acceptance.decays_of_all_materials`.
MAX_SIGMAS = 4.0
TABLE_1 = [name for name in EXPONENTIAL if not name.startswith("double-")]


def fit_of(folder: Path, patch: str = "") -> dict[str, Any]:
    content: dict[str, Any] = json.loads((folder / "result" / patch / "fit.json").read_text())
    return content


def measured(labrig: Labrig, tmp_path: Path, rig: Path, protocol: str) -> Path:
    ended = labrig("run", protocol, "--rig", rig, "--runs", tmp_path / rig.stem)
    assert ended.code == 0, ended.err
    return ended.run_folder


def check(fit: dict[str, Any], name: str) -> None:
    """Every rate is within its σ, and the states are as many as there are."""
    true = sorted((state.k_r_per_s for state in read_material(name).states), reverse=True)
    assert fit["n_states"] == len(true), name
    for state, k_r_per_s in zip(fit["states"], true, strict=True):
        assert abs(state["k_r_per_s"] - k_r_per_s) < MAX_SIGMAS * state["k_r_per_s_sigma"], name
        assert state["k_r_per_s_sigma"] < 0.1 * k_r_per_s, "a σ of nothing proves nothing"


@pytest.mark.campaign
@pytest.mark.parametrize(
    "name",
    ["double-close-uneven", pytest.param("double-medium-faint", marks=pytest.mark.campaign)],
)
def test_two_states_are_distinguished(
    labrig: Labrig, make_rig: Make, tmp_path: Path, name: str
) -> None:
    rig = make_rig(sample=name, sensor=SENSOR)
    check(fit_of(measured(labrig, tmp_path, rig, "decay")), name)


def test_a_power_law_is_flagged(labrig: Labrig, make_rig: Make, tmp_path: Path) -> None:
    fit = fit_of(
        measured(
            labrig,
            tmp_path,
            make_rig(sample="power-law", sensor={"width": 192, "height": 128}),
            "decay",
        )
    )
    assert fit["law"] != "exponentials"
    assert "rates-descriptive" in codes(as_warnings(fit["warnings"]))


@pytest.mark.campaign
def test_eleven_patches_in_one_charge_give_the_rates_of_one_by_one(
    labrig: Labrig, make_rig: Make, tmp_path: Path
) -> None:
    together = measured(
        labrig, tmp_path, make_rig("all.yaml", "sim-eleven", sensor=SENSOR), "decay-eleven"
    )
    for name in TABLE_1:
        check(fit_of(together, name), name)
    name = TABLE_1[0]
    alone = measured(labrig, tmp_path, make_rig(sample=name, sensor=SENSOR), "decay")
    check(fit_of(alone), name)
    (one,), (other,) = fit_of(alone)["states"], fit_of(together, name)["states"]
    sigma = (one["k_r_per_s_sigma"] ** 2 + other["k_r_per_s_sigma"] ** 2) ** 0.5
    assert abs(one["k_r_per_s"] - other["k_r_per_s"]) < MAX_SIGMAS * sigma
