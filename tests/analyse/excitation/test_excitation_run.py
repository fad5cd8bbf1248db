"""Excitation rates of a simulated sample, light on it known, against the truth."""

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from labrig.analyse import Inputs
from labrig.analyse.overrides import Overrides
from labrig.calibration import BlankFile
from labrig.calibration.irradiance_file import IRRADIANCE_KIND
from labrig.foundation.errors import DataError
from labrig.material import read_material
from labrig.process import process_and_report, process_run
from labrig.protocols.excitation.analysis import USUAL
from labrig.protocols.excitation.analysis.charge_intervals import charge_frames
from labrig.protocols.excitation.analysis.charging_series import patch_chargings
from labrig.protocols.excitation.result import ExcitationResult
from labrig.record import read_run
from labrig.reduce import measure, read_raw
from tests.analyse.excitation.bench import HEIGHT, QUICK, WIDTH, true_irradiance
from tests.analyse.recorded import cut_off_and_resumed, part_of, record
from tests.calibration.cameras import camera
from tests.results.made import assert_read_back


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
    assert abs(state.k_r_per_s - truth.k_r_per_s) < 4 * state.k_r_per_s_sigma
    # The room's lamp is four times as bright as the irradiance to which Table 1's rates belong.
    rates, sigma = state.k_e_per_s / 4, state.k_e_per_s_sigma / 4
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
            process_run(run, Overrides(edited=True))
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
        sigma_dn_per_s=((1.0,),), constant_dn_per_s=(0.0,), constant_dn_per_s_sigma=(1.0,),
        ambient_dn_per_s=(0.0,), ambient_dn_per_s_sigma=(1.0,), first_clean_s=10.0,
    )  # fmt: skip
    whole = charge_frames(read_run(run), Overrides(), 150.0)
    clean = charge_frames(read_run(run), Overrides(), 150.0, blank)
    early = [frame for frame, one in whole.charge_of.items() if frame.start_time < one.off_s + 9.98]
    assert early
    assert set(clean.charge_of) == set(whole.charge_of) - set(early)
    (warning,) = clean.left_out
    assert (warning.code, warning.values["left_out"]) == ("frames-before-dark", len(early))
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
    other = replace(part, inputs=Inputs({**part.inputs.provided, "camera": camera()}))
    with pytest.raises(DataError, match="calibration of another camera"):
        patch_chargings(other, true_irradiance(), USUAL)
