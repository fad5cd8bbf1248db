"""Fluorescent samples on the simulated bench with LEDs, against the truth."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from labrig.acquire import read_protocol
from labrig.analyse import Overrides, check_options
from labrig.foundation import resources
from labrig.foundation.errors import DataError, UsageError
from labrig.material import (
    ReradiationMatrix,
    appearance,
    compare_colours,
    read_any_material,
    read_fluorescent,
)
from labrig.optics import read_light
from labrig.process import Processed, process_and_report
from labrig.protocols.led_fluorescence.analysis import analyse
from labrig.protocols.led_fluorescence.analysis.methods import method_differences
from labrig.protocols.led_fluorescence.result import LedFluorescenceResult
from labrig.results import FluorescentPatch
from tests.analyse.led_bench import QUICK, SAMPLES, record
from tests.analyse.recorded import part_of, processed_once
from tests.results.made import assert_read_back
from tests.warned import codes, of_code


def true_matrix(patch: str) -> ReradiationMatrix:
    matrix = read_any_material(SAMPLES[patch])
    assert isinstance(matrix, ReradiationMatrix)
    return matrix


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("led_fluorescence"), QUICK)


@pytest.fixture(scope="module")
def processed(run: Path) -> Processed:
    return processed_once(run)


@pytest.fixture(scope="module")
def result(processed: Processed) -> Any:
    return processed.result


def test_dyes_are_counted_and_placed(result: LedFluorescenceResult) -> None:
    numbers = {name: len(patch.dyes) for name, patch in result.patches.items()}
    assert numbers == {"yellow": 1, "orange": 2, "paper": 1, "felt": 0}
    for name in ("yellow", "paper"):
        patch, true = result.patches[name], true_matrix(name)
        emission = true.reradiation @ true.input_width_nm
        peak_nm = patch.matrix.output_nm[patch.dyes[0].emission.argmax()]
        assert abs(peak_nm - true.output_nm[emission.argmax()]) <= 30


@pytest.mark.parametrize("name", ["yellow", "orange", "felt"])
def test_colours_are_right_within_their_uncertainty(
    result: LedFluorescenceResult, name: str
) -> None:
    colours = [one for one in result.patches[name].colours if not one.depends_on_uv]
    assert colours
    for colour in colours:
        true = appearance(true_matrix(name), read_light(colour.light)).lab
        assert (np.abs(true - colour.lab) < 4 * np.array(colour.lab_sigma)).all()


def test_no_fluorescence_assumed_or_one_led_by_itself_is_far_worse(
    result: LedFluorescenceResult,
) -> None:
    lights = [read_light("D65"), read_light("A")]
    for name, patch in result.patches.items():
        together, alone = (
            [
                each.delta_e
                for each in compare_colours(matrix.named(name), true_matrix(name), lights)
            ]
            for matrix in (patch.matrix, patch.per_led)
        )
        assert np.mean(together) < np.mean(alone) / 1.5


def test_what_ultraviolet_excites_has_no_scale_and_is_said(result: LedFluorescenceResult) -> None:
    assert result.uv_scale == "unknown"
    assert result.is_brightness_known.tolist() == [False] + [True] * 8
    paper, felt = result.patches["paper"], result.patches["felt"]
    # The table of FL2 begins at 380 nm: nothing that 365 nm excites matters under it.
    depends = {colour.light: colour.depends_on_uv for colour in paper.colours}
    assert depends == {"D65": True, "A": True, "FL2": False}
    assert not any(colour.depends_on_uv for colour in felt.colours)
    unscaled = of_code(result.warnings, "light-unscaled")
    assert unscaled.values["lights"] == ("365 nm",)
    assert "paper" in unscaled.subject


def test_nothing_bleaches_or_is_left_without_a_cause(result: LedFluorescenceResult) -> None:
    for patch in result.patches.values():
        assert patch.bleaching is not None
        assert abs(patch.bleaching.value - 1) < 4 * patch.bleaching.sigma < 0.1
        assert patch.reduced_chi2 < 2
    assert not {"light-left", "sample-bleached"} & set(codes(result.warnings))


def test_the_result_is_read_back_and_written_as_materials(processed: Processed) -> None:
    done = processed
    assert isinstance(done.result, LedFluorescenceResult)
    assert_read_back(done.result)
    folder = done.report.parent
    for name in ("yellow", "orange"):
        written = json.loads((folder / name / "mixture.json").read_text())
        # 365 nm shone, but nobody knows how brightly.
        assert 385 <= written["measured_input_nm"][0] < 410
        assert_same_excitation(done.result.patches[name])
    assert not (folder / "felt" / "mixture.json").exists()
    for name, patch in done.result.patches.items():
        material = read_fluorescent(folder / name / "material.yaml")
        assert material.name == name
        np.testing.assert_allclose(material.reradiation, patch.matrix.reradiation, atol=1e-12)
        assert material.reradiation_sigma is not None
    assert len((folder / "colours.csv").read_text().splitlines()) == 1 + 4 * 3
    *lines, budgets = done.lines
    assert [line.split(":")[0] for line in lines] == sorted(SAMPLES)
    assert "are in the report" in budgets
    unknown = {line.split(":")[0] for line in done.lines if "its scale is not known" in line}
    assert "paper" in unknown
    assert "felt" not in unknown
    page = done.report.read_text()
    assert "uv_scale: unknown" in page
    assert page.count('class="patch"') == 4
    assert "Left half as photographed" in page
    assert "one LED by itself" in page


def assert_same_excitation(patch: FluorescentPatch) -> None:
    """The mixture re-radiates as much as the matrix does of light that the LEDs had."""
    matrix, lit = patch.matrix.named(""), ~patch.is_extrapolated
    assert patch.mixture is not None
    model = patch.mixture.mixture.to_matrix(matrix.input_nm, matrix.output_nm)
    light = [each.reradiated_fraction[lit].sum() for each in (model, matrix)]
    assert light[0] == pytest.approx(light[1], rel=0.1)


def test_methods_are_asked_about_the_same_light(result: LedFluorescenceResult) -> None:
    yellow = result.patches["yellow"]
    assert [each.light for each in yellow.under_lights] == list(result.leds)
    blue = next(each for each in yellow.under_lights if each.light == "455 nm")
    column = yellow.matrix.reradiation[:, 14:18]
    assert column.min(axis=1)[15] <= blue.joint.value[15] <= column.max(axis=1)[15]
    assert blue.joint.sigma is not None
    assert blue.per_led.sigma is None
    lights = {(each.first, each.second, each.light) for each in yellow.differences}
    assert lights == {("joint", "per-led", "D65"), ("joint", "per-led", "A")}


def test_a_direct_measurement_is_compared_where_it_measured() -> None:
    true = true_matrix("yellow")
    wrong = replace(true, reradiation=0.5 * true.reradiation)
    holed = true.reradiation.copy()
    holed[:, :10] = np.nan
    read = replace(true, reradiation=holed)
    found = {
        (each.first, each.second, each.light): each.delta_e
        for each in method_differences(true, wrong, read)
    }
    assert found["joint", "direct", "D65"] == pytest.approx(0.0, abs=1e-9)
    assert found["per-led", "direct", "A"] == pytest.approx(found["joint", "per-led", "A"], rel=0.5)
    assert found["per-led", "direct", "A"] > 3


def _on_relays(relays: dict[str, int]) -> Callable[[dict[str, Any]], None]:
    """LEDs on a relay board, which knows nothing of heads, by the relays that the rig file says."""

    def change(rig: dict[str, Any]) -> None:
        channels = rig["devices"]["leds"]["channels"]
        rig["devices"]["leds"] = {
            "driver": "numato",
            "address": "sim://room/relays",
            "channels": {
                led: {"relay": relay}
                | {key: channels[led][key] for key in ("centre", "fwhm", "settling")}
                for led, relay in relays.items()
            },
        }
        true = {"430 nm": 3, "455 nm": 4, "530 nm": 6, "625 nm": 9}
        leds = {led["relay"]: led for led in rig["simulation"]["leds"]}
        rig["simulation"]["led_board"] = "relays"
        rig["simulation"]["leds"] = [
            leds[number] | {"relay": relay} for relay, number in enumerate(true.values(), 1)
        ]

    return change


#: Fewer LEDs and samples take less time.
FEW = QUICK | {
    "leds": ["430 nm", "455 nm", "530 nm", "625 nm"],
    "patches": {"felt": QUICK["patches"]["felt"]},
    "repeats": 1,
}
RELAYS = {"430 nm": 1, "455 nm": 2, "530 nm": 3, "625 nm": 4}


def _with(**simulation: Any) -> Callable[[dict[str, Any]], None]:
    def change(rig: dict[str, Any]) -> None:
        _on_relays(RELAYS)(rig)
        rig["simulation"] |= simulation

    return change


def _result(folder: Path, change: Callable[[dict[str, Any]], None]) -> LedFluorescenceResult:
    result = analyse(part_of(record(folder, FEW, change)))
    assert not any("\n" in str(each) for each in result.warnings)
    return result


def _named(result: LedFluorescenceResult, code: str) -> tuple[str, dict[str, Any]]:
    warning = of_code(result.warnings, code)
    return warning.subject, dict(warning.values)


def _is_felt(result: LedFluorescenceResult) -> bool:
    felt, true = result.patches["felt"], true_matrix("felt")
    colour = next(colour for colour in felt.colours if colour.light == "D65")
    off = appearance(true, read_light("D65")).lab - np.array(colour.lab)
    return not felt.dyes and bool((np.abs(off) < 4 * np.array(colour.lab_sigma)).all())


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("begin", "seen_on"), [("0 s", "card"), ("2 min", "samples")], ids=["card", "samples"]
)
def test_an_led_that_does_not_light_is_left_out_and_named(
    tmp_path: Path, begin: str, seen_on: str
) -> None:
    result = _result(tmp_path, _with(faults=[{"led_dark": {"relay": 4, "at": begin}}]))
    assert result.leds == ("430 nm", "455 nm", "530 nm")
    subject, values = _named(result, "light-unlit")
    assert (subject, values["target"]) == ("625 nm", seen_on)
    assert _is_felt(result)


@pytest.mark.campaign
def test_the_thesis_method_that_was_asked_for_stands_before_that_of_all_leds(
    tmp_path: Path,
) -> None:
    done = process_and_report(record(tmp_path, FEW), Overrides(options={"method": "per-led"}))
    result = done.result
    assert isinstance(result, LedFluorescenceResult)
    for patch in result.patches.values():
        assert patch.method == "per-led"
        assert patch.matrix.reradiation_sigma is None
        assert patch.joint.reradiation_sigma is not None
        assert np.isnan(patch.colours[0].lab_sigma).all()
    assert_read_back(result)
    assert "method: per-led" in (done.report.parent / "provenance.yaml").read_text()
    assert all("without σ" in line for line in done.lines if not line.startswith("budget"))


@pytest.mark.campaign
def test_leds_in_another_order_count_as_what_they_are(tmp_path: Path) -> None:
    result = _result(tmp_path, _on_relays(RELAYS | {"455 nm": 3, "530 nm": 2}))
    assert result.leds == tuple(RELAYS)
    assert _named(result, "lights-exchanged")[0] == "455 nm, 530 nm"
    assert _is_felt(result)


@pytest.mark.campaign
def test_an_led_that_stays_lit_leaves_what_was_measured_before(tmp_path: Path) -> None:
    """It is the last one of the card, and all samples are lit by it, too."""
    stuck = _with(faults=[{"led_stuck": {"relay": 1, "at": "0 s"}}])
    with pytest.raises(DataError, match="clip with all LEDs off; an LED stays lit") as caught:
        _result(tmp_path, stuck)
    assert "\n" not in str(caught.value)


@pytest.mark.campaign
def test_an_led_that_clips_is_left_out(tmp_path: Path) -> None:
    def bright(rig: dict[str, Any]) -> None:
        _on_relays(RELAYS)(rig)
        rig["simulation"]["leds"][2]["level"] = "100 %"
        rig["simulation"]["lamp"] = {"irradiance": 20.0}

    run = record(tmp_path, FEW | {"camera": {"iso": 1600}}, bright)
    result = analyse(part_of(run))
    assert result.leds == ("430 nm", "455 nm", "625 nm")
    subject, values = _named(result, "light-clipped")
    assert (subject, values["target"]) == ("530 nm", "card")
    assert _is_felt(result)


@pytest.mark.campaign
def test_light_that_leaks_in_is_subtracted(tmp_path: Path) -> None:
    def leaking(rig: dict[str, Any]) -> None:
        rig["simulation"]["faults"] = [{"ambient_light": {"level": "0.5 %", "at": "3 min"}}]

    result = _result(tmp_path, leaking)
    assert _named(result, "light-left")[0] == "samples"
    felt = result.patches["felt"]
    assert not felt.dyes
    true = true_matrix("felt").reflectance[5:30]
    assert np.abs(felt.matrix.reflectance[5:30] - true).max() < 0.05


def test_a_method_is_refused_where_there_is_none_to_choose() -> None:
    decay = read_protocol(resources.find("protocols", "protocol", "decay"))
    with pytest.raises(UsageError, match="--method: expected an option of decay, it has") as no:
        check_options({"method": "joint"}, decay)
    assert "\n" not in str(no.value)
    fluorescence = read_protocol(resources.find("protocols", "protocol", "led_fluorescence"))
    with pytest.raises(UsageError, match=r"--method: .*joint.*thesis"):
        check_options({"method": "thesis"}, fluorescence)


@pytest.mark.campaign
def test_lamps_join_the_estimate_and_leave_one_led_by_itself_alone(tmp_path: Path) -> None:
    patches = {name: QUICK["patches"][name] for name in ("yellow", "felt")}
    asked = FEW | {"lamps": ["halogen"], "patches": patches}
    run = record(tmp_path, asked)
    done = process_and_report(run)
    part, result = part_of(run), done.result
    assert isinstance(result, LedFluorescenceResult)
    assert_read_back(result)
    assert "LED or lamp" in done.report.read_text()
    assert result.leds == ("430 nm", "455 nm", "530 nm", "625 nm", "halogen")
    assert result.lamps == ("halogen",)
    gaps_nm = of_code(result.warnings, "excitation-extrapolated").values["gaps_nm"]
    assert not [gap for gap in gaps_nm if gap.endswith("400")], "lamps tell sums"
    yellow, felt = result.patches["yellow"], result.patches["felt"]
    assert yellow.value.shape == (5, 3)
    assert len(yellow.dyes) == 1
    assert not felt.dyes
    assert yellow.is_extrapolated.any(), "a lamp does not count as light of a wavelength"
    assert [each.light for each in yellow.under_lights] == list(result.leds[:4])
    assert yellow.under_lights[0].per_led.sigma is None

    one_by_one = Overrides(options={"method": "per-led"})
    by_led = analyse(replace(part, overrides=one_by_one)).patches["yellow"]
    np.testing.assert_array_equal(by_led.matrix.reradiation, yellow.per_led.reradiation)
    without = part.protocol.model_copy(update={"lamps": ()})
    alone = analyse(replace(part, protocol=without)).patches["yellow"]
    np.testing.assert_allclose(by_led.matrix.reradiation, alone.per_led.reradiation)
    assert by_led.predicted.shape == by_led.pull.shape == (5, 3)


@pytest.mark.campaign
def test_a_lamp_that_does_not_light_is_left_out_and_the_leds_go_on(tmp_path: Path) -> None:
    def unplugged(rig: dict[str, Any]) -> None:
        rig["devices"]["illuminants"]["channels"]["halogen"]["relay"] = 7

    asked = FEW | {"lamps": ["halogen"]}
    result = analyse(part_of(record(tmp_path, asked, unplugged)))
    assert result.leds == ("430 nm", "455 nm", "530 nm", "625 nm")
    subject, values = _named(result, "light-unlit")
    assert (subject, values["target"]) == ("halogen", "card")
    assert _is_felt(result)
