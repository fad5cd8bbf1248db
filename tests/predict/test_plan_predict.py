"""`labrig plan --predict` as a person uses it: after a run, without one, and when it cannot."""

import contextlib
import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from labrig.cli.exit_codes import guarded
from labrig.foundation import resources
from labrig.material import read_material
from labrig.predict.reference import read_reference
from labrig.record import read_run
from tests.conftest import Ended
from tests.quick_yaml import read_quickly, write_quickly

Labrig = Callable[..., Ended]
Make = Callable[..., Path]


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with protocol.yaml, rig.yaml and a run of them."""
    folder = tmp_path_factory.mktemp("measured")
    rig = read_quickly((resources.folder("config") / "sim.yaml").read_text())
    rig["simulation"] |= {
        "sensor": {"width": 96, "height": 64},
        "epoch": "2026-01-01T00:00:00Z",
        "initial": {"lamp": "off"},
        # Frames of some seeds look by chance as if they drifted, which is in the fit's σ.
        "seed": 4,
    }
    protocol = {"protocol": "decay", "charge": "15 min", "for": "100 s", "every": "4 s"}
    (folder / "rig.yaml").write_text(write_quickly(rig))
    (folder / "protocol.yaml").write_text(write_quickly(protocol))
    quiet = io.StringIO()
    with contextlib.redirect_stdout(quiet), contextlib.redirect_stderr(quiet):
        code = guarded(
            ["run", str(folder / "protocol.yaml"), "--rig", str(folder / "rig.yaml"),
             "--runs", str(folder / "runs")]
        )  # fmt: skip
    assert code == 0, quiet.getvalue()
    return folder


def run_in(measured: Path) -> Path:
    (run,) = (measured / "runs").iterdir()
    return run


def predicted(labrig: Labrig, measured: Path, *more: object, **keys: object) -> dict[str, Any]:
    """JSON of a prediction for the measured material, the protocol changed as told."""
    protocol = read_quickly((measured / "protocol.yaml").read_text()) | keys
    path = measured / "changed.yaml"
    path.write_text(write_quickly(protocol))
    material = run_in(measured) / "result" / "material.yaml"
    ended = labrig(
        "plan", path, "--rig", measured / "rig.yaml", "--predict", material, *more, "--json"
    )
    assert ended.code == 0, ended.err
    said: dict[str, Any] = json.loads(ended.out)
    return said


def sigma(said: dict[str, Any]) -> float:
    (patch,) = said["patches"].values()
    return float(patch["states"][0]["rate_per_s_sigma"])


def test_the_run_that_follows_finds_what_was_predicted(labrig: Labrig, measured: Path) -> None:
    said = predicted(labrig, measured)
    run = run_in(measured)
    taken = [frame.exposure_s for frame in read_run(run).frames("decay")]
    assert said["exposures_s"] == pytest.approx(taken, rel=0.27), "within a third of a stop"
    (found,) = json.loads((run / "result" / "fit.json").read_text())["states"]
    (state,) = said["patches"]["sample"]["states"]
    assert 1 / 1.2 < found["k_r_per_s_sigma"] / state["rate_per_s_sigma"] < 1.2
    assert 1 / 1.2 < found["amplitude_sigma"] / state["amplitude_dn_per_s_sigma"] < 1.2
    assert said["patches"]["sample"]["brightness_known"]
    assert sum(state["noise"].values()) == pytest.approx(1)


def test_a_run_tells_gain_and_read_noise_of_its_camera(measured: Path) -> None:
    """Those of the simulated sensor at ISO 400: 1.05 electrons a DN, 8.1 electrons."""
    camera = read_reference(run_in(measured) / "result").camera
    assert camera.electrons_per_dn == pytest.approx(1.05, rel=0.1)
    assert camera.read_noise_electrons == pytest.approx(8.1, rel=0.1)
    assert (camera.width, camera.height) == (96, 64)
    assert camera.channel_fractions == {"R": 0.25, "G": 0.5, "B": 0.25}


def test_remedies_are_what_the_changed_protocol_itself_is_predicted_to_know(
    labrig: Labrig, measured: Path
) -> None:
    base = predicted(labrig, measured, exposure="20 ms")
    remedies = {remedy["change"]: remedy for remedy in base["remedies"]}
    for change, keys in (
        ("exposure: grow", {"exposure": "grow"}),
        ("repeats: 4", {"repeats": 4}),
        ("for: 3 min 20 s", {"for": "200 s"}),
        ("iso: 800", {"camera": {"iso": 800}}),
    ):
        itself = predicted(labrig, measured, **{"exposure": "20 ms", **keys})
        assert sigma(itself) == pytest.approx(sigma(remedies[change]))
        assert remedies[change]["gain"] == pytest.approx(sigma(itself) / sigma(base))
    gains = [remedy["gain"] for remedy in base["remedies"]]
    assert gains == sorted(gains)
    assert remedies["exposure: grow"]["gain"] < 0.4
    assert 0.5 <= remedies["repeats: 4"]["gain"] < 0.75, "dark frames are not taken anew"
    assert remedies["repeats: 4"]["extra_time_s"] == pytest.approx(3 * (900 + 104), rel=0.02)


def test_an_earlier_run_lends_its_camera_to_other_materials(labrig: Labrig, measured: Path) -> None:
    alone, like = (
        json.loads(
            labrig(
                "plan", measured / "protocol.yaml", "--rig", measured / "rig.yaml",
                "--predict", "double-wide", "--metered", "0.5 s", *more, "--json",
            ).out
        )
        for more in ([], ["--like", run_in(measured)])
    )  # fmt: skip
    assert alone["exposures_s"][0] == like["exposures_s"][0] == pytest.approx(0.5, rel=0.01)
    assert "96 x 64 pixels" in like["notes"][0]
    assert not like["patches"]["sample"]["brightness_known"]
    assert len(like["patches"]["sample"]["states"]) == 2
    few, many = (said["patches"]["sample"]["states"][0]["noise"] for said in (like, alone))
    assert few["photons"] == pytest.approx(many["photons"], rel=0.5), (
        "the rig tells the sensor, too"
    )


def test_a_glow_too_dim_for_the_time_between_frames_is_known_less_well(labrig: Labrig) -> None:
    dim, dimmer = (
        json.loads(
            labrig(
                "plan", "decay", "--rig", "sim", "--predict", "bottle", "--metered", metered,
                "--json",
            ).out
        )
        for metered in ("3 s", "30 s")
    )  # fmt: skip
    assert dim["exposures_s"] == dimmer["exposures_s"]
    assert sigma(dimmer) > 1.5 * sigma(dim)


@pytest.mark.campaign
@pytest.mark.parametrize("columns", [80, 120])
def test_the_tables_fit_the_terminal(
    labrig: Labrig, monkeypatch: pytest.MonkeyPatch, columns: int, tmp_path: Path
) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    close = tmp_path / "close.yaml"
    close.write_text(
        "name: close\nkind: phosphor\n"
        "states: [{k_r_per_s: 0.1, amplitude: 1}, {k_r_per_s: 0.09, amplitude: 1}]\n"
    )
    ended = labrig("plan", "decay", "--rig", "sim", "--predict", close)
    assert ended.code == 0, ended.err
    assert max(map(len, ended.out.splitlines())) <= columns
    for text in ("σ of amplitude", "flicker", "repeats: 4", "may not resolve these 2 states"):
        assert text in " ".join(ended.out.split())


def test_frames_that_clip_are_left_out_and_reported(labrig: Labrig, measured: Path) -> None:
    said = predicted(labrig, measured, exposure="2 s")
    clipped = said["patches"]["sample"]["clipped_frames"]
    assert 0 < clipped < 25
    itself = {remedy["change"]: remedy for remedy in said["remedies"]}
    assert itself["exposure: auto"]["patches"]["sample"]["clipped_frames"] == 0


def test_each_patch_has_its_material(labrig: Labrig) -> None:
    ended = labrig(
        "plan", "decay-eleven", "--rig", "sim-eleven", "--predict", "bottle=bottle",
        "--predict", "red-paint=red-paint", "--json",
    )  # fmt: skip
    patches = json.loads(ended.out)["patches"]
    assert {name: patch["material"] for name, patch in patches.items()} == {
        "bottle": "bottle", "red-paint": "red-paint"
    }  # fmt: skip


def test_a_plan_without_a_material_is_the_timeline_for_programs_too(labrig: Labrig) -> None:
    said = json.loads(labrig("plan", "decay", "--rig", "sim", "--json").out)
    assert said["units"] == ["dark", "meter", "decay-1", "daylight"]
    assert said["frames"] == sum(step["device"] == "camera" for step in said["steps"])


@pytest.mark.parametrize(
    ("material", "more", "said"),
    [
        ("states: []", [], "states"),
        ("states: [{k_r_per_s: 0.1}, {k_r_per_s: 0.01}]", [], "'amplitude' or 'reradiation'"),
        ("states: [{k_r_per_s: 0.1}, {k_r_per_s: 0.1}]", [], "same rate"),
        ("power-law", [], "no decay resolves so many"),
        ("blu-paint", [], "did you mean 'blue-paint'?"),
        ("smaple=blue-paint", [], "did you mean 'sample'?"),
        ("blue-paint", ["--predict", "red-paint"], "one material for each patch"),
        ("blue-paint", ["--like", "nowhere"], "a run with a fit"),
        ("blue-paint", ["--metered", "3"], "unit"),
        (None, ["--metered", "3 s"], "name the material"),
    ],
)
def test_what_cannot_be_predicted_is_one_line(
    labrig: Labrig, tmp_path: Path, material: str | None, more: list[str], said: str
) -> None:
    if material is not None and ":" in material:
        (tmp_path / "mine.yaml").write_text(f"name: mine\nkind: phosphor\n{material}\n")
        material = str(tmp_path / "mine.yaml")
    asked = [] if material is None else ["--predict", material]
    ended = labrig("plan", "decay", "--rig", "sim", *asked, *more)
    assert ended.code == 2
    assert len(ended.err.splitlines()) == 1
    assert said in ended.err


def test_several_patches_want_names(labrig: Labrig) -> None:
    ended = labrig("plan", "decay-eleven", "--rig", "sim-eleven", "--predict", "blue-paint")
    assert ended.code == 2
    assert "--predict blue-paint=blue-paint" in ended.err


@pytest.mark.parametrize(
    "name", ["bottle", "orange-paint", pytest.param("double-wide-slow", marks=pytest.mark.campaign)]
)
def test_materials_from_a_paper_can_be_predicted(labrig: Labrig, name: str) -> None:
    ended = labrig("plan", "decay", "--rig", "sim", "--predict", name, "--json")
    assert ended.code == 0, ended.err
    states = json.loads(ended.out)["patches"]["sample"]["states"]
    assert len(states) == len(read_material(name).states)
    assert all(0 < state["rate_per_s_sigma"] < state["rate_per_s"] for state in states)


def test_a_kinetic_order_bends_the_decay_that_is_predicted(labrig: Labrig, tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(
        "name: mine\nkind: phosphor\nbands_nm: [400, 700]\n"
        "irradiance_norm: {kind: vector_length, value: 1}\n"
        "states: [{k_r_per_s: 0.1, kinetic_order: 1.5, k_e_per_s: [0.1], reradiation: [1]}]\n"
    )
    ended = labrig("plan", "decay", "--rig", "sim", "--predict", path, "--json")
    (state,) = json.loads(ended.out)["patches"]["sample"]["states"]
    # r∞ is the root of (1 − r) κ = k rᵇ for κ = k: r = 0.56984.
    assert state["rate_per_s"] == pytest.approx(1.5 * 0.1 * 0.56984**0.5, rel=1e-3)
    assert state["kinetic_order"] == pytest.approx(1.5)
    assert 0 < state["kinetic_order_sigma"] < 0.02
    shown = labrig("plan", "decay", "--rig", "sim", "--predict", path).out
    assert "order b" in shown
