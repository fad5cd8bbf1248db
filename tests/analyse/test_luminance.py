"""Luminances of simulated glows against the room's own; what is not as it should be is told."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from labrig.analyse import AnalysisContext, evaluate_luminance_table
from labrig.bench_optics import card_radiance, luminance
from labrig.process import process_and_report
from labrig.protocols.luminance.analysis import analyse
from labrig.protocols.luminance.result import LuminanceResult, ScaleFactor
from labrig.results import TABLE_S, VISIBLE_MCD_PER_M2, Verdict
from tests.analyse.luminance_bench import QUICK, record, true_luminance, write_glow
from tests.analyse.recorded import part_of
from tests.results.made import assert_read_back
from tests.warned import codes

EVERYWHERE = [0.0, 0.0, 1.0, 1.0]


@pytest.fixture(scope="module")
def long_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A glow that is at 0.3 mcd/m² within the run, its emission known."""
    folder = tmp_path_factory.mktemp("long")
    glow = write_glow(folder, 12.0)
    keys = {
        "emission": str(glow),
        "colours": "K-W",
        "require": ["10 mcd/m2 at 10 min", "1 mcd/m2 at 60 min"],
        "adaptation": "50 mcd/m2",
        "sample": {"name": "test", "thickness": "0.4 mm"},
    }
    return record(folder, QUICK | keys, sample=[{"material": str(glow), "region": EVERYWHERE}])


def changed(
    context: AnalysisContext, reading: dict[str, Any] | None = None, **optics: Any
) -> AnalysisContext:
    """The part on a rig whose optics, and whose meter's reading, are others."""
    old = context.rig.optics
    assert old.luminance is not None
    own = type(old.luminance).model_validate(old.luminance.model_dump() | (reading or {}))
    new = old.model_copy(update={"luminance": own, **optics})
    return replace(context, rig=context.rig.model_copy(update={"optics": new}))


def sigma_of(factors: tuple[ScaleFactor, ...], begin: str) -> float:
    (factor,) = (one for one in factors if one.name.startswith(begin))
    return factor.relative_sigma


def test_luminances_are_those_of_the_room(long_run: Path) -> None:
    done = process_and_report(long_run)
    assert isinstance(done.result, LuminanceResult)
    assert done.result.warnings == ()
    (patch,) = done.result.patches.values()
    decay = patch.decay
    assert decay.visible_s is not None
    true = true_luminance(long_run)([*TABLE_S, decay.visible_s.value])[:, 0]
    for entry, light in zip(decay.at, true, strict=False):
        assert entry.luminance is not None
        assert abs(entry.luminance.value - light) < 3 * entry.luminance.sigma
        assert entry.luminance.sigma < 0.05 * light
    relative = decay.visible_s.sigma / decay.visible_s.value
    assert decay.slope is not None
    assert abs(np.log(true[-1] / VISIBLE_MCD_PER_M2)) < 3 * decay.slope.value * relative
    assert relative < 0.05
    late, early = decay.required
    assert [at.verdict(one.least_mcd_per_m2) for one, at in (late, early)] == [
        Verdict.PASS,
        Verdict.FAIL,
    ]
    assert decay.marking is not None
    assert decay.marking.endswith(f"-{decay.visible_s.value / 60:.0f}-K-W")
    assert patch.scotopic_ratio.value == pytest.approx(2.95, rel=0.05)
    assert patch.mesopic_ratio is not None
    assert 1 < patch.mesopic_ratio.value < patch.scotopic_ratio.value
    assert sigma_of(patch.factors, "luxmeter") == 0.03
    assert done.result.excitation.charged_s == pytest.approx(300, abs=0.5)
    assert_read_back(done.result)
    content = json.loads((done.report.parent / "luminance.json").read_text())
    assert content["origin"] == long_run.name
    assert content["marking"] == decay.marking
    again, _ = evaluate_luminance_table(done.report.parent / "luminance.csv")
    assert again.luminance_mcd_per_m2 == pytest.approx(decay.luminance_mcd_per_m2)
    assert again.visible_s is not None
    assert again.visible_s.value == pytest.approx(decay.visible_s.value)
    page = done.report.read_text()
    assert "0.4 mm" in page
    assert decay.marking in page


def test_a_reading_on_the_card_is_the_same_scale(long_run: Path) -> None:
    part = part_of(long_run)
    (by_lux,) = analyse(part).patches.values()
    on_card = {"value": f"{luminance(card_radiance(part.rig))} cd/m2", "at": "card"}
    (by_card,) = analyse(
        changed(part, on_card | {"lamp": "LED", "f1_prime": 0.06})
    ).patches.values()
    ours, its = by_lux.decay.luminance_mcd_per_m2, by_card.decay.luminance_mcd_per_m2
    assert its == pytest.approx(ours, rel=1e-6)
    assert sigma_of(by_card.factors, "meter's colour") == pytest.approx(0.06 / np.sqrt(3))
    assert not any("reflectance" in factor.name for factor in by_card.factors)


def test_another_lamp_than_the_rig_file_says_is_noticed(long_run: Path) -> None:
    part = part_of(long_run)
    doubts = analyse(changed(part, lamp="xenon_projector")).warnings
    assert "card-colour-differs" in codes(doubts)
    without = changed(part, {"lamp": None})
    assert "lamp-unnamed" in codes(analyse(without).warnings)


def test_excitation_is_held_against_the_standard(long_run: Path) -> None:
    part = part_of(long_run)

    def accordance(rested: str, **reading: Any) -> str:
        keys = part.protocol.model_dump(mode="json", by_alias=True)
        keys["excitation"] = {"preset": "DIN 67510-1", "rested": rested}
        protocol = type(part.protocol).model_validate(keys)
        result = analyse(replace(changed(part, reading), protocol=protocol))
        return result.excitation.accordance

    assert accordance("50 h", lamp="xenon") == "according to DIN 67510-1:2020"
    assert accordance("50 h", lamp="halogen").endswith("halogen lamp, not xenon")
    dim = accordance("2 h", lamp="xenon", value="312 lx")
    assert dim.startswith("not according to DIN 67510-1:2020: 312 lx, not 1000 lx; 2 h in the dark")


def test_an_led_and_a_card_that_fluoresces_are_noticed(tmp_path: Path) -> None:
    """The LED makes 0.001 lx at the sample; the glow is that of two samples."""
    half = [0.0, 0.0, 0.5, 1.0]
    run = record(
        tmp_path,
        QUICK
        | {
            "excitation": {"preset": "own", "time": "1 min"},
            "until": "150 s",
            "patches": {"bright": [0.05, 0.1, 0.4, 0.8], "dim": [0.55, 0.1, 0.4, 0.8]},
        },
        sample=[
            {"material": str(write_glow(tmp_path, 12.0)), "region": half},
            {"material": "power-law", "region": [0.5, 0.0, 0.5, 1.0]},
        ],
        ambient=1e-6,
        grey_card_fluorescence=1.0,
    )
    result = analyse(part_of(run))
    assert "not-dark-before" in codes(result.warnings)
    assert "card-colour-differs" in codes(result.warnings)
    assert result.ranked() == ("bright", "dim")
    ratios = result.patches["dim"].relative_to_first
    assert ratios is not None
    ratio = ratios[TABLE_S[0]]
    assert abs(12 * ratio.value - 1) < 3 * 12 * ratio.sigma
    assert 12 * ratio.sigma < 0.08
