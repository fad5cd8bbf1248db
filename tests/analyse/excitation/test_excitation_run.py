"""Excitation rates of a simulated sample, light on it known, against the truth."""

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from labrig.analyse.excitation.analysis import USUAL
from labrig.analyse.excitation.charge_intervals import charge_frames
from labrig.analyse.excitation.charging_series import patch_chargings
from labrig.analyse.overrides import Overrides
from labrig.calibration import BlankFile
from labrig.calibration.irradiance_file import IRRADIANCE_KIND, IrradianceFile
from labrig.errors import DataError
from labrig.material import read_material
from labrig.optics import SLICES, Strip
from labrig.process import process_and_report, process_run
from labrig.record import read_run
from labrig.reduce import measure, read_raw
from labrig.results.excitation import ExcitationResult
from labrig.sim.bench_settings import LvfSettings
from labrig.sim.lamp import BURNING_K, filament_spectrum
from labrig.sim.lvf import Lvf
from labrig.sim.phosphor import band_cells
from tests.analyse.recorded import cut_off_and_resumed, part_of, record
from tests.calibration.test_camera_file import camera
from tests.quick_yaml import read_quickly
from tests.results.made import assert_read_back

#: Wide, so that a slice of the strip is ten pixels; low, so that it is fast.
WIDTH, HEIGHT = 384, 48
QUICK: dict[str, Any] = {
    "protocol": "excitation",
    "sample": {"name": "blue-paint"},
    "growth": "30 %",
    "at_most": 4,
    "refine": 1,
    "direct": ["10 s", "1 min", "4 min"],
    "for": "40 s",
    "last_decay": "60 s",
    "rest": {"at_least": "1 min", "at_most": "4 min"},
}
TILT = np.radians(1.0)


def true_irradiance(width: int = WIDTH, height: int = HEIGHT) -> IrradianceFile:
    """What an irradiance run without error would find on the shipped rig with such a sensor."""
    lvf_settings = read_quickly(Path("config/sim-phosphor.yaml").read_text(encoding="utf-8"))[
        "simulation"
    ]["lvf"]
    lvf = Lvf(LvfSettings.model_validate(lvf_settings))
    down = 0.42 * width / height * np.tan(TILT)
    strip = Strip(left=(0.08, 0.5 + down), right=(0.92, 0.5 - down), height=0.3, rising=False)
    bands_nm = read_material("blue-paint").bands_nm
    assert bands_nm is not None
    cells, lamp = band_cells(bands_nm), filament_spectrum(BURNING_K)
    position = np.array(strip.positions(width, height))
    about = np.linspace(-0.5, 0.5, 41) / SLICES
    passed = np.array([lvf.transmission(np.clip(u + about, 0, 1)).mean(axis=0) for u in position])
    norm = np.linalg.norm(cells @ lamp)
    through, direct = (passed * lamp) @ cells.T / norm, cells @ lamp / norm
    ratio = direct.sum() / through.sum(axis=1)
    return IrradianceFile(
        lamp="the room's own",
        bands_nm=bands_nm,
        direct=tuple(direct),
        direct_sigma=tuple(0.003 * direct),
        position=tuple(position),
        through=tuple(map(tuple, through)),
        through_sigma=tuple(map(tuple, 0.005 * through)),
        scale_sigma=0.005,
        ratio=tuple(ratio),
        ratio_sigma=tuple(0.005 * ratio),
        strip=strip,
    )


def recorded(folder: Path) -> Path:
    folder.mkdir(exist_ok=True)
    IRRADIANCE_KIND.write(folder, true_irradiance())

    def change(rig: dict[str, Any]) -> None:
        rig["optics"]["irradiance"] = str(folder / "irradiance.yaml")
        rig["simulation"]["sensor"] = {"width": WIDTH, "height": HEIGHT}
        rig["simulation"]["sample"] = [{"material": "blue-paint", "region": [0.03, 0.1, 0.94, 0.8]}]
        rig["devices"]["lamp"]["warm_up"] = "0 s"

    return record(folder, QUICK, change)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(tmp_path_factory.mktemp("excitation"))


@pytest.mark.campaign
def test_rates_and_levels_are_the_true_ones(run: Path) -> None:
    done = process_and_report(run)
    assert isinstance(done.result, ExcitationResult)
    (patch,) = done.result.patches.values()
    (state,), (truth,) = patch.fit.states, read_material("blue-paint").states
    assert truth.k_e_per_s is not None
    assert abs(state.k_r_per_s - truth.k_r_per_s) < 4 * state.k_r_sigma_per_s
    # The room's lamp is four times as bright as the irradiance to which Table 1's rates belong.
    rates, sigma = state.k_e_per_s / 4, state.k_e_sigma_per_s / 4
    off = rates - np.array(truth.k_e_per_s)
    assert (np.abs(off) < np.maximum(4 * sigma, 1e-5)).all()
    assert rates[:3] == pytest.approx(truth.k_e_per_s[:3], rel=0.1)
    assert state.k_e_upper_per_s[5] < 1e-3
    level = patch.fit.at_off[-1]
    kappa = 4 * float(np.array(truth.k_e_per_s) @ true_irradiance().direct)
    true_r0 = kappa / (kappa + truth.k_r_per_s)
    assert level.r0[0] == pytest.approx(true_r0, abs=4 * level.r0_sigma[0] + 0.01)
    assert patch.closure is not None
    assert patch.closure.rms_percent < 5
    assert patch.closure.rms_sigma < 3
    assert_read_back(done.result)
    tests = patch.fit.by_band
    assert tests is not None
    assert not tests.is_thick
    assert not tests.amplitude.differs
    assert not tests.rate.differs
    assert "exciting-bands" in done.report.read_text()

    folder = done.report.parent
    assert patch.material == read_material(folder / "material.yaml")
    fit = json.loads((folder / "excitation.json").read_text())
    assert fit["states"][0]["k_e_per_s"] == state.k_e_per_s.tolist()
    assert fit["by_band"]["is_thick"] is False
    assert (folder / "figures").is_dir()
    assert done.lines[0].startswith("state 1: k_r ")
    assert done.lines[-1].startswith("closure: charging by the lamp itself is predicted within ")


def test_charges_double_until_the_glow_stops_growing(run: Path) -> None:
    record_ = read_run(run)
    lit = {
        unit: [action for action in attempt.actions if action.device == "lamp"]
        for unit, attempt in record_.completed().items()
    }
    seconds = {u: a[1].start_time - a[0].end_time for u, a in lit.items() if len(a) == 2}
    doubled = [seconds[f"strip-{n}"] for n in range(1, 5) if f"strip-{n}" in seconds]
    assert doubled == pytest.approx([8.0 * 2**n for n in range(len(doubled))], abs=0.1)
    assert 8 <= seconds["refine-1"] <= doubled[-1] + 0.1
    asked = [
        (action.unit, action.task)
        for attempt in record_.completed().values()
        for action in attempt.actions
        if action.is_manual
    ]
    assert asked == [("dark", "lvf on sample"), ("direct-meter", "lvf away")]


@pytest.mark.campaign
def test_killed_in_the_middle_it_goes_on_with_the_filter_where_it_was(
    run: Path, tmp_path: Path
) -> None:
    again = tmp_path / run.name
    shutil.copytree(run, again)
    cut, resumed = cut_off_and_resumed(again, "strip-3")
    assert list(cut.completed())[-1] == "strip-2"
    assert list(resumed.completed()) == list(read_run(run).completed())
    # The room is opened anew; had its changer not put the filter back, all places would glow alike.
    last = resumed.frames("strip")[-1]
    places = [
        measure(read_raw(last.path), region)
        for region in true_irradiance().lvf_strip().slices(9).values()
    ]
    glow = [place.channels["B"].mean for place in places]
    assert max(glow) > 5 * min(glow)


def test_without_knowing_the_light_it_says_what_to_do(run: Path) -> None:
    path = run / "rig.yaml"
    kept = path.read_text()
    try:
        path.write_text("\n".join(line for line in kept.splitlines() if "irradiance:" not in line))
        with pytest.raises(DataError, match="run irradiance and name its run"):
            process_run(run)
    finally:
        path.write_text(kept)


def test_a_frame_that_was_changed_is_refused(run: Path) -> None:
    frame = read_run(run).frames("strip")[0].path
    kept = frame.read_bytes()
    try:
        frame.write_bytes(kept[:-1] + b"x")
        with pytest.raises(DataError, match="was changed after the run"):
            process_run(run)
    finally:
        frame.write_bytes(kept)


def test_photographs_before_the_bench_is_dark_are_left_out_and_it_is_reported(run: Path) -> None:
    blank = BlankFile(
        iso=400, f_number=4.0, channels=("G",), t_s=(0.5,), rate_dn_per_s=((0.0,),),
        sigma_dn_per_s=((1.0,),), constant_dn_per_s=(0.0,), constant_sigma_dn_per_s=(1.0,),
        ambient_dn_per_s=(0.0,), ambient_sigma_dn_per_s=(1.0,), first_clean_s=10.0,
    )  # fmt: skip
    whole = charge_frames(read_run(run), Overrides(), 150.0)
    clean = charge_frames(read_run(run), Overrides(), 150.0, blank)
    early = [frame for frame, one in whole.charge_of.items() if frame.start_time < one.off_s + 9.98]
    assert early
    assert set(clean.charge_of) == set(whole.charge_of) - set(early)
    (said,) = clean.left_out
    assert said.startswith("frames that begin before the bench is dark are left out")
    assert f", {len(early)} of " in said
    with pytest.raises(DataError, match="all frames begin before"):
        charge_frames(
            read_run(run), Overrides(), 150.0, blank.model_copy(update={"first_clean_s": 1e4})
        )


def test_charges_are_missing(run: Path) -> None:
    part = part_of(run)
    some = [one for one in part.run.attempts if not one.unit.startswith("direct")]
    with pytest.raises(DataError, match="through the filter and without it"):
        patch_chargings(
            replace(part, run=replace(part.run, attempts=some)), true_irradiance(), USUAL
        )


def test_a_calibration_of_another_camera_is_refused(run: Path) -> None:
    part = part_of(run)
    other = replace(part, inputs=replace(part.inputs, camera=camera()))
    with pytest.raises(DataError, match="calibration of another camera"):
        patch_chargings(other, true_irradiance(), USUAL)
