"""`labrig reproduce --rendered`: the dark room rendered beside the simulated photographs."""

import contextlib
import io
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike

from labrig.acquire import read_rig_file
from labrig.calibration import FADE_KIND
from labrig.cli.exit_codes import guarded
from labrig.compare.glow import glow_sigma, state_signals
from labrig.compare.photographed_room import PhotographedRoom
from labrig.compare.rendered import charging_warnings
from labrig.foundation import resources
from labrig.foundation.arrays import FloatArray
from labrig.foundation.result_warning import Misfit
from labrig.material import (
    SEEN_FACTOR,
    Albedo,
    Material,
    ScaleFactor,
    State,
    read_material,
    write_material,
)
from labrig.protocols.phosphor.result import PhosphorResult
from labrig.reproduce import Renderer, load_scene
from labrig.results import Series, read_result
from labrig.sim.lamp import BURNING_K, WAVELENGTH_NM, filament_spectrum
from labrig.sim.optics import REFLECTED, emission
from labrig.sim.phosphor import band_cells
from tests.acceptance.trap_models import true_fade
from tests.conftest import Ended
from tests.quick_yaml import read_quickly, write_quickly
from tests.results.made_excitation import excitation_result


def made_series(t_s: FloatArray, exposure_s: FloatArray) -> Series:
    """Photographs of which only the times matter."""
    n = len(t_s)
    return Series(
        t_s=t_s, exposure_s=exposure_s, values=np.ones((n, 3)), sigma=np.ones((n, 3)),
        dark_sigma=np.zeros(3), channels=("R", "G", "B"), iso=np.full(n, 100.0),
        f_number=np.full(n, 4.0), frame=("",) * n, unit=("decay-1",) * n, flag=("",) * n,
    )  # fmt: skip


Labrig = Callable[..., Ended]
SAMPLE = "double-wide"
#: Of the room's lamp, in multiples of the irradiance to which the material's rates belong.
LAMP = 4.0


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A decay of two states and the sample under the lamp, in a room with its own kinetics."""
    folder = tmp_path_factory.mktemp("rendered")
    rig = read_quickly((resources.folder("config") / "sim.yaml").read_text())
    rig["simulation"] |= {
        "sensor": {"width": 96, "height": 64, "curves": "canon_eos_5d_mark_ii"},
        "epoch": "2026-01-01T00:00:00Z",
        "initial": {"lamp": "off"},
        "sample": SAMPLE,
        "seed": 61,
    }
    FADE_KIND.write(folder, true_fade())
    rig["optics"] |= {"lamp": "halogen_3000k", "fade": str(folder / "fade.yaml")}
    protocol = {
        "protocol": "decay",
        "sample": {"name": SAMPLE},
        "charge": "10 min",
        "for": "90 s",
        "daylight": True,
    }
    (folder / "rig.yaml").write_text(write_quickly(rig))
    (folder / "protocol.yaml").write_text(write_quickly(protocol))
    quiet = io.StringIO()
    with contextlib.redirect_stdout(quiet), contextlib.redirect_stderr(quiet):
        code = guarded(
            ["run", str(folder / "protocol.yaml"), "--rig", str(folder / "rig.yaml"),
             "--runs", str(folder / "runs")]
        )  # fmt: skip
    assert code == 0, quiet.getvalue()
    (recorded,) = (folder / "runs").iterdir()
    return recorded


def of_the_room() -> Material:
    """The room's material as a chain without error would measure it, relative to the lamp."""
    true = read_material(SAMPLE)
    assert true.bands_nm is not None
    edges = np.array(true.bands_nm)
    cells, lamp = band_cells(edges), filament_spectrum(BURNING_K)
    inside = (edges[0] < WAVELENGTH_NM) & (edges[-1] > WAVELENGTH_NM)
    mean = np.pi * REFLECTED * LAMP * lamp[inside].mean()
    emitted = emission(true) @ cells.T / cells.sum(axis=1) / mean
    states = tuple(
        state.model_copy(
            update={
                "k_e_per_s": tuple(LAMP * np.array(state.k_e_per_s)),
                "reradiation": tuple(each.tolist()),
            }
        )
        for state, each in zip(true.states, emitted, strict=True)
    )
    # What the room takes for a sample of which nothing is said.
    albedo = Albedo(wavelength_nm=(400.0, 700.0), value=(0.5, 0.5))
    return true.model_copy(update={"states": states, "scale": "relative", "albedo": albedo})


@pytest.fixture
def measured(run: Path) -> Path:
    """The run, with the material that a whole chain would have made of it."""
    write_material(run / "result" / "material.yaml", of_the_room())
    return run


def rendered(labrig: Labrig, run: Path, *more: object) -> dict[str, Any]:
    ended = labrig("reproduce", run, "--rendered", "--json", *more)
    assert (ended.code, ended.err) == (0, "")
    comparison: dict[str, Any] = json.loads(ended.out)["rendered"]
    return comparison


def test_the_glow_over_reflected_light_is_the_photographs(labrig: Labrig, measured: Path) -> None:
    comparison = rendered(labrig, measured)
    patch = comparison["patches"][SAMPLE]
    ratio = patch["glow_over_reflected"]
    assert ratio["reflected_by"] == "the sample"
    photographed, own = np.array(ratio["photographed"]), np.array(ratio["rendered"]["measured"])
    assert 5 < photographed[0] / photographed[-1] < 100
    np.testing.assert_allclose(own.mean() / photographed.mean(), 1, atol=0.03)
    sigma = np.array(ratio["photographed_sigma"])
    assert (np.abs(own - photographed) < 3 * sigma).all()
    # The shutter was not calibrated: one of 2 ms may be off by a tenth.
    assert 0.09 < (sigma / photographed).min() < 0.12
    assert patch["mean"]["measured"] < 2
    assert patch["mean"]["1 state"] > 2 * patch["mean"]["measured"]
    assert patch["mean_one_exposure"]["measured"] < 2
    assert patch["mean"]["2 states"] < 2 * patch["noise"] + 1
    # A factor of each channel leaves the noise of a material that decays as it should.
    assert patch["noise"] == pytest.approx(np.mean(patch["delta_e_noise"]))
    assert patch["mean_matched"]["measured"] < 2 * patch["noise"]
    assert patch["mean_matched"]["1 state"] > 4 * patch["noise"]
    # Laws without states are shown, too: one spectrum of rates has both of these, one trap has not.
    assert patch["mean_matched"]["spectrum"] < 2 * patch["noise"]
    assert patch["mean_matched"]["one trap"] > 2 * patch["noise"]
    assert comparison["notes"] == comparison["warnings"] == []


@pytest.mark.parametrize("is_same_camera", [False, True])
def test_the_sigma_of_the_glow_is_that_of_scale_amplitudes_and_rates(is_same_camera: bool) -> None:
    rng = np.random.default_rng(62)
    t_s = np.arange(1.0, 120.0, 12.0)
    series = made_series(t_s, np.full_like(t_s, 0.5))
    scale, amplitude, rate = 0.02, (0.03, 0.01), (0.02, 0.004)

    def material(factors: ArrayLike, rates: ArrayLike, common: float) -> Material:
        states = tuple(
            State(
                k_r_per_s=k_r * shift,
                k_r_per_s_sigma=k_r * sigma,
                amplitude=common * factor,
                amplitude_sigma=float(np.hypot(own, scale)),
                r0=0.5,
            )
            for k_r, sigma, own, factor, shift in zip(
                (0.1, 0.02), rate, amplitude, np.array(factors), np.array(rates), strict=True
            )
        )
        factor = ScaleFactor(name=SEEN_FACTOR, value=1.0, sigma=scale)
        return Material(
            name="drawn", kind="phosphor", states=states, scale="relative", scale_factors=(factor,)
        )

    drawn = [
        state_signals(
            material(
                1 + np.array(amplitude) * rng.standard_normal(2),
                1 + np.array(rate) * rng.standard_normal(2),
                1.0 if is_same_camera else 1 + scale * rng.standard_normal(),
            ),
            series,
        ).sum(axis=1)
        for _ in range(1500)
    ]
    relative = np.std(drawn, axis=0) / np.mean(drawn, axis=0)
    stated = glow_sigma(material((1, 1), (1, 1), 1), series, is_same_camera=is_same_camera)
    np.testing.assert_allclose(stated, relative, rtol=0.1)


def test_the_sigma_of_a_glow_of_another_order_is_that_of_its_decay_time() -> None:
    """Its rate and its level may not be known apart, to a factor; what its decay tells is τ."""
    rng = np.random.default_rng(63)
    t_s = np.arange(1.0, 200.0, 20.0)
    series, k_r, order = made_series(t_s, np.full_like(t_s, 0.5)), 0.05, 1.6

    def material(tau_s: float) -> Material:
        r0 = ((order - 1) * k_r * tau_s) ** (-1 / (order - 1))
        state = State(
            k_r_per_s=k_r, k_r_per_s_sigma=2 * k_r, kinetic_order=order, amplitude=1.0,
            amplitude_sigma=0.01, r0=r0, decay_time_s=tau_s, decay_time_s_sigma=0.03 * tau_s,
        )  # fmt: skip
        return Material(name="drawn", kind="phosphor", states=(state,))

    drawn = [
        (1 + 0.01 * rng.standard_normal())
        * state_signals(material(60 * (1 + 0.03 * rng.standard_normal())), series)[:, 0]
        for _ in range(1500)
    ]
    relative = np.std(drawn, axis=0) / np.mean(drawn, axis=0)
    stated = glow_sigma(material(60.0), series, is_same_camera=True)
    np.testing.assert_allclose(stated, relative, rtol=0.1)


def test_what_a_run_warns_of_its_charging_is_said_of_the_rendering() -> None:
    excited = excitation_result()
    left = excited.patches["left"]
    warning = Misfit("rate-equation-misfit", "another law holds")
    law = replace(left, fit=replace(left.fit, warnings=(warning,)))
    right = replace(left, fit=replace(left.fit, warnings=()))
    both = replace(excited, patches={"left": law, "right": right})
    chain = PhosphorResult(parts={"excitation": both}, failed={}, materials={})
    about_left = warning.about("left, excitation")
    assert list(charging_warnings(chain, ["left", "right"])) == [about_left]
    # A material that was named takes the place of the run's own.
    assert not list(charging_warnings(chain, ["right"]))
    alone = PhosphorResult(
        parts={"excitation": replace(excited, patches={"": law})}, failed={}, materials={}
    )
    assert list(charging_warnings(alone, ["otor"])) == [warning.about("excitation")]
    assert not list(charging_warnings(alone, []))


def test_the_lamps_fade_is_the_measured_one(measured: Path) -> None:
    room = PhotographedRoom.of(
        measured, read_rig_file(measured / "rig.yaml"), read_result(measured)
    )
    material = of_the_room()
    programme = [(at_s, level) for at_s, level in room.programme([material]) if -1 < at_s < 5]
    assert programme[0][0] == pytest.approx(0, abs=1e-6)
    assert programme[-1][1] == 0
    times, levels = np.transpose(programme)
    weight = np.sum([state.k_e_per_s or () for state in material.states], axis=0)
    equivalent_s = true_fade().fade.equivalent_s() @ weight / weight.sum()
    assert np.diff(times) @ levels[:-1] == pytest.approx(equivalent_s, rel=0.01)


def test_what_was_not_measured_is_one_clear_line(labrig: Labrig, measured: Path) -> None:
    bare = of_the_room().model_copy(update={"albedo": None})
    write_material(measured / "result" / "material.yaml", bare)
    ended = labrig("reproduce", measured, "--rendered", "--json")
    assert (ended.code, len(ended.err.splitlines())) == (2, 1)
    assert "--assume-albedo" in ended.err
    absolute = of_the_room().model_copy(update={"scale": "absolute"})
    write_material(measured / "result" / "material.yaml", absolute)
    ended = labrig("reproduce", measured, "--rendered", "--json")
    assert (ended.code, len(ended.err.splitlines())) == (2, 1)
    assert "luxmeter" in ended.err
    unlit = bare.model_copy(
        update={
            "states": tuple(state.model_copy(update={"reradiation": None}) for state in bare.states)
        }
    )
    write_material(measured / "result" / "material.yaml", unlit)
    ended = labrig("reproduce", measured, "--rendered", "--json")
    assert (ended.code, len(ended.err.splitlines())) == (2, 1)
    assert "emission spectrum" in ended.err


def test_assumptions_without_a_rendering_are_refused(labrig: Labrig, run: Path) -> None:
    ended = labrig("reproduce", run, "--assume-scale", 1)
    assert (ended.code, len(ended.err.splitlines())) == (2, 1)
    assert "--rendered" in ended.err


@pytest.mark.drawn
def test_the_assumption_is_in_the_picture(labrig: Labrig, measured: Path, tmp_path: Path) -> None:
    bare = of_the_room().model_copy(update={"albedo": None})
    write_material(measured / "result" / "material.yaml", bare)
    ended = labrig("reproduce", measured, "--rendered", "--assume-albedo", 0.5, "--out", tmp_path)
    assert (ended.code, ended.err) == (0, "")
    assert "assumed to be 0.5 at all wavelengths" in " ".join(ended.out.split())
    assert {"rendered.png", "rendered-one-exposure.png", "rendered.csv"} <= {
        p.name for p in tmp_path.iterdir()
    }
    # The same room for `labrig render`, with the assumption in it.
    scene = load_scene(tmp_path / "dark-room.yaml")
    (assumed,) = scene.notes
    assert (assumed.code, assumed.subject) == ("albedo-assumed", "sample (double-wide)")
    assert assumed.values == {"albedo": 0.5}
    renderer = Renderer(scene.resized(width_px=12, height_px=8), threads=1)
    lit, *glow = (float(frame.radiance.sum()) for frame in renderer.frames())
    assert lit > glow[0] > glow[-1] > 0
