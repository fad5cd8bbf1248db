"""`labrig runs trap-depth`: from rooms of several temperatures to the depth of the room's traps."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from labrig.catalogue import trap_depths
from labrig.foundation.errors import FitError, UsageError
from labrig.process import process_run
from labrig.sim.temperature import TRAP_K
from tests.analyse.recorded import record
from tests.conftest import Ended

Labrig = Callable[..., Ended]

DECAY: dict[str, Any] = {
    "protocol": "decay", "charge": "30 s", "first": "1 s", "every": "8 s", "for": "3 min",
    "exposure": "1/4 s", "daylight": False,
}  # fmt: skip
CELSIUS = (14.0, 21.0, 29.0)
#: The room's traps, by Boltzmann's constant in eV/K.
DEPTH_EV = TRAP_K * 8.617333e-5


def recorded_at(folder: Path, celsius: float, thermometer: bool = True) -> Path:
    def change(rig: dict[str, Any]) -> None:
        rig["devices"]["lamp"]["warm_up"] = "30 s"
        rig["devices"]["camera"]["warm_up"] = "5 s"
        rig["simulation"] |= {
            "sensor": {"width": 48, "height": 32},
            "seed": int(celsius),
            "temperature": {"start": celsius},
        }
        if not thermometer:
            del rig["devices"]["thermometer"]

    run = record(folder / f"{celsius:g}", DECAY, change)
    process_run(run)
    return run


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("temperatures")
    return [recorded_at(folder, celsius) for celsius in CELSIUS]


def test_the_depth_of_the_rooms_traps_is_found(
    runs: list[Path], labrig: Labrig, tmp_path: Path
) -> None:
    said = labrig("runs", "trap-depth", *runs, "--out", tmp_path / "depth")
    assert said.code == 0
    content = json.loads((tmp_path / "depth" / "trap_depth.json").read_text())
    for state in content["states"]:
        depth = state["depth_ev"]
        assert depth["sigma"] < 0.06
        assert abs(depth["value"] - DEPTH_EV) < 3 * depth["sigma"]
        assert state["temperature_c"] == pytest.approx(CELSIUS, abs=1.0)
        assert state["warnings"] == []
    page = (tmp_path / "depth" / "report.html").read_text()
    assert "Trap depths" in page
    printed = labrig("runs", "trap-depth", *runs, "--json")
    assert json.loads(printed.out)["states"] == content["states"]


def test_temperatures_of_a_bath_replace_the_thermometers(runs: list[Path]) -> None:
    """A range half as wide makes the trap twice as deep."""
    measured = trap_depths(runs)
    stated = trap_depths(runs, [17.5, 21.0, 25.0])
    for one, other in zip(measured, stated, strict=True):
        ratio = other.depth.depth_ev.value / one.depth.depth_ev.value
        assert ratio == pytest.approx(2.0, rel=0.15)


def test_a_comparison_says_that_temperatures_differ(runs: list[Path], labrig: Labrig) -> None:
    said = labrig("runs", "compare", runs[0], runs[1]).out
    assert "k_r changes by about +" in said
    assert "k_r changes" not in labrig("runs", "compare", runs[0], runs[0]).out


def test_runs_that_tell_no_depth_are_refused(runs: list[Path], tmp_path: Path) -> None:
    with pytest.raises(FitError, match="differ by 2 K or more"):
        trap_depths([runs[0], runs[0]])
    with pytest.raises(UsageError, match="expected 3, one of each run, got 1"):
        trap_depths(runs, [20.0])
    dark = recorded_at(tmp_path, 25.0, thermometer=False)
    with pytest.raises(UsageError, match="expected a temperature of the sample"):
        trap_depths([runs[0], dark])
    assert len(trap_depths([runs[0], dark], [14.0, 25.0])) == len(trap_depths(runs))


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["--temperatures", "15, warm, 30"], "expected numbers in °C"),
        (["--temperature-sigma", "a little"], "--temperature-sigma"),
    ],
)
def test_bad_options_are_one_line(
    runs: list[Path], labrig: Labrig, options: list[str], told: str
) -> None:
    ended = labrig("runs", "trap-depth", *runs, *options)
    assert ended.code == 2
    assert told in ended.err
    assert len(ended.err.splitlines()) == 1
