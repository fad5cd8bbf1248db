"""Two samples that take turns on a simulated changer, from the run to a material of each."""

import math
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from labrig.analyse import Overrides
from labrig.calibration import IRRADIANCE_KIND
from labrig.compare.run import read_patches
from labrig.foundation import resources
from labrig.material import read_material
from labrig.process import process_and_report
from labrig.protocols.excitation.analysis.charge_intervals import charge_frames
from labrig.protocols.excitation.result import ExcitationResult
from labrig.protocols.phosphor.analysis import analyse
from labrig.record import RunRecord, read_run
from labrig.results import read_fitted_decays
from labrig.sim.simulation import Simulation
from tests.analyse.recorded import cut_off_and_resumed, part_of, record
from tests.analyse.selected_lights import LED_NAMES, QUICK, bench, true_light
from tests.quick_yaml import read_quickly
from tests.results.made import assert_read_back

BLUE, GREEN = SAMPLES = ("blue-paint", "green-paint")
TWO = LED_NAMES[:2]
#: A sample in turn rests for longer than it would by itself.
CHAIN: dict[str, Any] = {
    "protocol": "phosphor",
    "samples": list(SAMPLES),
    "parts": [
        {key: value for key, value in QUICK.items() if key != "sample"}
        | {"select": {"leds": list(TWO)}, "charges": ["1 min"], "direct": ["10 s", "2 min"],
           "rest": {"below": "5 %", "at_least": "20 s", "at_most": "2 min"}},
        {"protocol": "decay", "charge": "2 min", "meter": "1 min", "for": "40 s", "first": "1 s"},
    ],
}  # fmt: skip


def run_on(folder: Path, chain: dict[str, Any] = CHAIN, **changer: Any) -> Path:
    """The folder of a run of the chain on the simulated changer."""
    shipped = read_quickly((resources.folder("config") / "sim-samples.yaml").read_text())

    def change(rig: dict[str, Any]) -> None:
        bench("leds", seed=7, sensor={"width": 48, "height": 32})(rig)
        rig["devices"]["lamp"]["warm_up"] = "0 s"
        room = Simulation.model_validate(rig["simulation"])
        light = true_light("leds", room)
        known = {
            name: getattr(light, name)[: len(TWO)]
            for name, value in light
            if isinstance(value, tuple) and len(value) == len(light.lights)
            if name not in ("direct", "direct_sigma")
        }
        folder.mkdir(parents=True, exist_ok=True)
        IRRADIANCE_KIND.write(folder, light.model_copy(update=known))
        rig["optics"]["irradiance"] = str(folder / "irradiance.yaml")
        rig["devices"]["sample_changer"] = shipped["devices"]["sample_changer"]
        rig["simulation"]["sample_changer"] = shipped["simulation"]["sample_changer"] | changer
        del rig["simulation"]["sample"]

    return record(folder, chain, change)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return run_on(tmp_path_factory.mktemp("turns"))


def test_each_sample_has_a_material_of_its_own(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Profiles of both samples' rates, and their layers, are those of a single one.
    monkeypatch.setattr("labrig.fit.excitation.fit.excitation_intervals", lambda *_: {})
    monkeypatch.setattr("labrig.protocols.excitation.analysis.orders.layer_effect", lambda *_: None)
    result = analyse(part_of(run))
    assert_read_back(result)
    assert list(result.parts) == [
        f"{sample}/{part}" for sample in SAMPLES for part in ("excitation", "decay")
    ]
    for sample in SAMPLES:
        (found,) = result.materials[sample].states
        (true,) = read_material(sample).states
        assert result.materials[sample].name == sample
        assert found.k_r_per_s_sigma is not None
        assert abs(found.k_r_per_s - true.k_r_per_s) < 4 * found.k_r_per_s_sigma
        assert found.k_r_per_s_sigma < 0.02 * true.k_r_per_s


@pytest.mark.campaign
def test_results_lie_in_folders_of_the_samples(run: Path) -> None:
    process_and_report(run)
    for sample in SAMPLES:
        material = read_material(run / "result" / sample / "material.yaml")
        assert material == read_material(run / "result" / sample / "excitation" / "material.yaml")
    assert list(read_fitted_decays(run / "result")) == [f"{one}/decay" for one in SAMPLES]
    assert [patch.material.name for patch in read_patches(run).values()] == list(SAMPLES)
    page = (run / "result" / "report.html").read_text()
    assert all(f'id="part-{sample}/excitation"' in page for sample in SAMPLES)


def rested(record: RunRecord) -> dict[str, float]:
    """Seconds for which a sample was in the dark before each unit, as recorded."""
    return {
        unit: float(action.action.split()[4])
        for unit, attempt in record.completed().items()
        for action in attempt.actions
        if action.device == "protocol" and action.action.startswith("in the dark for ")
    }


def test_how_long_it_was_in_the_dark_is_recorded(run: Path) -> None:
    record = read_run(run)
    times = rested(record)
    assert all(seconds >= 20.0 for seconds in times.values())
    for sample, other in (SAMPLES, SAMPLES[::-1]):
        name = "excitation/direct-2"
        attempt = record.completed()[f"{sample}/{name}"]
        turns = [
            action
            for each in record.completed().values()
            for action in each.actions
            if action.device == "sample_changer" and action.start_time < attempt.frames[0].end_time
        ]
        # It was taken away when the other one was brought, and has been back since its own turn.
        assert [turn.action for turn in turns[-2:]] == [f"sample {other}", f"sample {sample}"]
        on = next(action for action in attempt.actions if action.device == "lamp")
        rest_ends = next(frame for frame in attempt.frames if frame.role == "rest").start_time
        assert times[f"{sample}/{name}"] == pytest.approx(rest_ends - turns[-2].start_time, abs=2.0)
        assert rest_ends < on.start_time


def test_the_lamp_is_warm_from_the_turn_of_the_other_sample(run: Path) -> None:
    record, constant_s = read_run(run), 150.0
    own, others = record.part(f"{GREEN}/excitation"), record.without_part(f"{GREEN}/excitation")
    alone, together = (
        charge_frames(own, Overrides(), constant_s, None, also) for also in (None, others)
    )
    assert [one.unit for one in alone.intervals] == [one.unit for one in together.intervals]
    last = together.intervals[-1]
    # The housing follows the lamp, whichever sample it shines on: dw/dt = (on − w)/τ.
    switches = sorted(
        (action.middle_time, action.action == "on")
        for attempt in record.completed().values()
        for action in attempt.actions
        if action.device == "lamp"
    )
    warmth, mean = 0.0, 0.0
    for (begin_s, is_on), (end_s, _) in pairwise(switches):
        fades = math.exp(-(end_s - begin_s) / constant_s)
        if begin_s == last.on_s:
            mean = (1 - warmth) * (1 - fades) * constant_s / (end_s - begin_s)
        warmth = is_on + (warmth - is_on) * fades
    assert last.cold_deficit == pytest.approx(mean, rel=1e-9)
    assert last.cold_deficit < 0.9 * alone.intervals[-1].cold_deficit


def test_cut_off_in_one_turn_it_goes_on_and_the_other_sample_has_rested(tmp_path: Path) -> None:
    path = run_on(tmp_path)
    whole = read_run(path).completed()
    lit = f"{GREEN}/excitation/direct-1"
    before, after = cut_off_and_resumed(path, lit)
    assert list(after.completed()) == list(whole)
    assert 0 < len(before.completed()) < len(whole)
    for unit, attempt in before.completed().items():
        assert after.completed()[unit].uid == attempt.uid
    # The one that was lit rests anew; of the other, what it rested before the cut counts.
    assert lit in rested(RunRecord(path, list(whole.values()), torn=False, last_time=0.0))
    assert lit not in rested(after)
    taken_away = next(
        action.start_time
        for attempt in before.attempts
        if attempt.unit == lit
        for action in attempt.actions
        if action.device == "sample_changer"
    )
    following = after.completed()[f"{BLUE}/excitation/direct-2"]
    rest = next(frame for frame in following.frames if frame.role == "rest")
    assert rested(after)[following.unit] == pytest.approx(rest.start_time - taken_away, abs=2.0)


@pytest.mark.campaign
def test_a_changer_that_is_not_light_tight_does_not_fit(tmp_path: Path, run: Path) -> None:
    tight, leaking = (analyse(part_of(path)) for path in (run, run_on(tmp_path, leak="5 %")))
    for sample in SAMPLES:
        chi2 = []
        for result in (tight, leaking):
            part = result.parts[f"{sample}/excitation"]
            assert isinstance(part, ExcitationResult)
            chi2 += [patch.fit.reduced_chi2 for patch in part.patches.values()]
        assert chi2[0] < 1.5
        assert chi2[1] > 2.0 * chi2[0]
        misfits = {w.subject for w in leaking.warnings if w.kind == "misfit"}
        assert f"{sample}/excitation" in misfits
