"""The command `labrig plan`: what it refuses, and what it says of time, hands, frames and disk."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from labrig.acquire import DOOR, plan, planned_rig, read_protocol, read_rig_file
from labrig.foundation.yaml_file import read_yaml
from labrig.record import RunSize, read_run
from tests.conftest import Ended
from tests.quick_yaml import read_quickly, write_quickly

Labrig = Callable[..., Ended]
Make = Callable[..., Path]


def written(folder: Path, **keys: Any) -> Path:
    path = folder / "protocol.yaml"
    path.write_text(write_quickly(keys))
    return path


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"protocol": "decay", "patches": {"a": [90, 60, 20, 10]}}, "patches.a: region"),
        ({"protocol": "decay", "patches": {"a": [0.5, 0.5, 0.6, 0.2]}}, "1.1 of its width"),
        ({"protocol": "decay", "dark": "background", "background": [0, 60, 90, 5]}, "background"),
        ({"protocol": "blank", "region": [90, 0, 8, 8]}, "region: region"),
        ({"protocol": "fade", "card": [90, 0, 8, 8]}, "card: region"),
        ({"protocol": "excitation", "sites": [0, 60, 90, 5]}, "sites: region"),
        ({"protocol": "phosphor", "parts": [{"protocol": "fade", "card": [90, 0, 8, 8]}]}, "fade"),
        ({"protocol": "decay", "sample": "blue-paint"}, "sample: {name: blue-paint}"),
        ({"protocol": "decay", "sample": None}, "sample: {name: blue-paint}"),
    ],
)
def test_what_cannot_work_is_refused_before_anything_moves(
    labrig: Labrig, make_rig: Make, tmp_path: Path, keys: dict[str, Any], said: str
) -> None:
    protocol, rig, runs = written(tmp_path, **keys), make_rig(), tmp_path / "runs"
    for command in ("plan", "run"):
        ended = labrig(command, protocol, "--rig", rig, "--runs", runs)
        assert ended.code == 2
        assert said in ended.err
        assert ended.err.count("\n") == 1
    assert not runs.exists()


@pytest.mark.parametrize(
    ("simulation", "optics", "said"),
    [
        ({"sample": "blu-paint"}, {}, "did you mean 'blue-paint'?"),
        ({"sensr": {}}, {}, "did you mean 'sensor'?"),
        ({}, {"lamp": "halogen"}, "halogen"),
        ({}, {"grey_card": "./my-card.csv"}, "my-card.csv"),
        ({}, {"irradiance": "./my-irradiance.yaml"}, "my-irradiance.yaml"),
    ],
)
def test_a_rig_whose_parts_are_unknown_is_refused(
    labrig: Labrig, make_rig: Make, simulation: Any, optics: Any, said: str
) -> None:
    path = make_rig(**simulation)
    rig = read_quickly(path.read_text())
    path.write_text(write_quickly(rig | {"optics": rig["optics"] | optics}))
    ended = labrig("plan", "decay", "--rig", path)
    assert (ended.code, ended.err.count("\n")) == (2, 1)
    assert said in ended.err


def test_a_camera_that_contradicts_its_simulation_is_refused(
    labrig: Labrig, make_rig: Make
) -> None:
    path = make_rig()
    rig = read_quickly(path.read_text())
    rig["devices"]["camera"]["frame_pixels"] = [5634, 3752]
    path.write_text(write_quickly(rig))
    ended = labrig("plan", "decay", "--rig", path)
    assert ended.code == 2
    assert "frame_pixels [96, 64]" in ended.err


@pytest.mark.parametrize("exposure", ["auto", "0.5 s", "3 s"])
def test_the_shortest_time_between_frames_that_is_advised_works(
    labrig: Labrig, make_rig: Make, tmp_path: Path, exposure: str
) -> None:
    keys = {"protocol": "decay", "exposure": exposure, "every": "0.5 s", "for": "60 s"}
    ended = labrig("plan", written(tmp_path, **keys), "--rig", make_rig())
    assert ended.code == 2
    (advised,) = re.findall(r"\(every: (.*?)\)", ended.err)
    ended = labrig("plan", written(tmp_path, **keys | {"every": advised}), "--rig", make_rig())
    assert ended.code == 0, ended.err


@pytest.mark.parametrize("rig", ["sim", "sim-phosphor"])
def test_the_first_frame_of_a_shipped_decay_is_after_the_door_is_open(
    labrig: Labrig, rig: str
) -> None:
    ended = labrig("plan", "decay", "--rig", rig, "--json")
    assert ended.code == 0, ended.err
    steps = [step for step in json.loads(ended.out)["steps"] if step["unit"] == "decay-1"]
    off_s = next(s["at_s"] for s in steps if (s["device"], s["action"]) == ("lamp", "off"))
    first_s = next(s["at_s"] for s in steps if s["action"].startswith("decay frame")) - off_s
    assert first_s == pytest.approx(0.5 if rig == "sim" else 0.72, abs=0.011)


def test_planned_devices_take_the_time_of_their_driver() -> None:
    from labrig.foundation import resources

    rig = read_rig_file(resources.find("config", "rig", "sim-phosphor"))
    assert planned_rig(rig, "rig")[DOOR].travel_s() == 0.3
    assert list(planned_rig(rig, "rig", ("lamp",)).devices) == ["lamp"]


def test_units_that_samples_have_in_turn_are_one_line(labrig: Labrig, tmp_path: Path) -> None:
    path = tmp_path / "turns.yaml"
    parts = [{"protocol": "excitation", "at_most": 3, "refine": 0, "direct": ["3 s", "1 min"]}]
    samples = {"samples": ["blue-paint", "green-paint"]}
    path.write_text(write_quickly({"protocol": "phosphor", **samples, "parts": parts}))
    folded = labrig("plan", path, "--rig", "sim-samples").out
    assert folded.count("excitation of blue-paint, green-paint in turn") == 1
    assert "3 × strip-1 … strip-3: " in folded
    laid_out = json.loads(labrig("plan", path, "--rig", "sim-samples", "--json").out)
    counted = sum(int(n) for n in re.findall(r"(\d+)\s+(?:[\w-]+)\s+frames?\s+of", folded))
    assert counted == laid_out["frames"]
    assert len([unit for unit in laid_out["units"] if "/strip-" in unit]) == 2 * (1 + 3)


def test_repeats_are_folded_and_nothing_is_lost(
    labrig: Labrig, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "120")
    folded, every_step, as_json = (
        labrig("plan", "phosphor", "--rig", "sim-phosphor", *options).out
        for options in ([], ["--all"], ["--json"])
    )
    laid_out = json.loads(as_json)
    assert len(folded.splitlines()) < 120
    assert len(every_step.splitlines()) > len(laid_out["steps"])
    counted = sum(int(n) for n in re.findall(r"(\d+)\s+(?:[\w-]+)\s+frames?\s+of", folded))
    assert counted == laid_out["frames"]
    units = [int(n) for n in re.findall(r"(\d+) × [a-z]", folded)]
    lines = re.findall(r"^ +\d+:\d\d:\d\d ", folded, re.M)
    assert sum(units) + len(lines) - len(units) == len(laid_out["units"])
    for text in (folded, every_step):
        assert f"{laid_out['manual_steps']} steps" in text
        assert f"at most {laid_out['frames']} of 384 × 64 pixels" in text


def test_growing_exposures_are_planned_to_grow(make_protocol: Make, make_rig: Make) -> None:
    protocol = make_protocol(exposure="grow", grow_at_most=8)
    laid_out = plan(read_protocol(protocol), read_rig_file(make_rig()), "rig")
    exposures_s = [s.exposure_s for s in laid_out.steps if s.action.startswith("decay frame")]
    assert exposures_s == sorted(exposures_s, key=lambda exposure_s: exposure_s or 0.0)
    assert exposures_s[0]
    assert exposures_s[-1]
    assert exposures_s[-1] / exposures_s[0] == pytest.approx(8, rel=0.01)


def test_a_run_takes_the_disk_space_that_its_plan_says(
    labrig: Labrig, make_rig: Make, make_protocol: Make, tmp_path: Path
) -> None:
    protocol, rig = make_protocol(), make_rig(sensor={"width": 704, "height": 468})
    expected = json.loads(labrig("plan", protocol, "--rig", rig, "--json").out)
    folder = labrig("run", protocol, "--rig", rig, "--runs", tmp_path / "runs").run_folder
    size = RunSize.measured(folder)
    sizes = [frame.size_bytes for frame in read_run(folder).frames("decay")]
    assert set(sizes) == {expected["frames_bytes"] / expected["frames"]}
    assert (size.frames, size.frames_bytes) == (expected["frames"], expected["frames_bytes"])
    assert size.frames_bytes < size.total_bytes < expected["size_bytes"]


def test_a_disk_that_is_too_small_is_refused_by_plan_run_and_resume(
    labrig: Labrig, make_rig: Make, make_protocol: Make, tmp_path: Path
) -> None:
    rig = make_rig(faults=[{"relays_unplugged": {"at": "30 s"}}])
    assert labrig("run", make_protocol(), "--rig", rig, "--runs", tmp_path / "runs").code == 3
    (folder,) = (tmp_path / "runs").iterdir()
    content = read_yaml(folder / "rig.yaml")
    content["devices"]["camera"]["frame_size"] = "90000 GB"
    for path in (rig, folder / "rig.yaml"):
        path.write_text(write_quickly(content))
    for arguments in (
        ("plan", make_protocol(), "--rig", rig),
        ("run", make_protocol(), "--rig", rig, "--runs", tmp_path / "runs"),
        ("resume", folder, "--edited"),
    ):
        ended = labrig(*arguments)
        assert (ended.code, ended.err.count("labrig: ")) == (5, 1)
        assert "are free" in ended.err
