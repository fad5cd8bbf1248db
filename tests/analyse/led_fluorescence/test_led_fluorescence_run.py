"""Fluorescent samples on the simulated bench with LEDs, against the truth."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from labrig.analyse.led_fluorescence import analyse
from labrig.errors import DataError
from labrig.material import (
    ReradiationMatrix,
    appearance,
    compare_colours,
    read_any_material,
    read_fluorescent,
)
from labrig.optics import read_light
from labrig.process import process_and_report
from labrig.results import LedFluorescenceResult
from tests.analyse.led_bench import QUICK, SAMPLES, record
from tests.analyse.recorded import part_of
from tests.results.made import assert_read_back


def true_matrix(patch: str) -> ReradiationMatrix:
    matrix = read_any_material(SAMPLES[patch])
    assert isinstance(matrix, ReradiationMatrix)
    return matrix


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("led_fluorescence"), QUICK)


@pytest.fixture(scope="module")
def result(run: Path) -> LedFluorescenceResult:
    return analyse(part_of(run))


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
    for colour in result.patches[name].colours:
        if colour.depends_on_uv:
            continue
        true = appearance(true_matrix(name), read_light(colour.light)).lab
        assert (np.abs(true - colour.lab) < 4 * np.array(colour.lab_sigma)).all()


def test_no_fluorescence_assumed_or_one_led_by_itself_is_far_worse(
    result: LedFluorescenceResult,
) -> None:
    lights = [read_light("D65"), read_light("A")]
    for name, patch in result.patches.items():
        assert patch.per_led is not None
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
    assert all(colour.depends_on_uv for colour in paper.colours)
    assert not any(colour.depends_on_uv for colour in felt.colours)
    assert any("365 nm" in warning and "not known" in warning for warning in result.warnings)


def test_nothing_bleaches_or_is_left_without_a_cause(result: LedFluorescenceResult) -> None:
    for patch in result.patches.values():
        assert patch.bleaching is not None
        assert abs(patch.bleaching.value - 1) < 4 * patch.bleaching.sigma < 0.1
        assert patch.reduced_chi2 < 2
    assert not any("left with all LEDs off" in warning for warning in result.warnings)


def test_the_result_is_read_back_and_written_as_materials(run: Path) -> None:
    done = process_and_report(run)
    assert isinstance(done.result, LedFluorescenceResult)
    assert_read_back(done.result)
    folder = done.report.parent
    for name, patch in done.result.patches.items():
        material = read_fluorescent(folder / name / "material.yaml")
        assert material.name == name
        np.testing.assert_allclose(material.reradiation, patch.matrix.reradiation, atol=1e-12)
        assert material.reradiation_sigma is not None
    assert len((folder / "colours.csv").read_text().splitlines()) == 1 + 4 * 3
    assert [line.split(":")[0] for line in done.lines] == sorted(SAMPLES)
    unknown = {line.split(":")[0] for line in done.lines if "its scale is not known" in line}
    assert "paper" in unknown
    assert "felt" not in unknown
    page = done.report.read_text()
    assert "uv_scale: unknown" in page
    assert page.count("<h2>") >= 13


def _on_relays(relays: dict[str, int]) -> Callable[[dict[str, Any]], None]:
    """LEDs on a relay board, which knows nothing of heads, by the relays that the rig file says."""

    def change(rig: dict[str, Any]) -> None:
        channels = rig["devices"]["leds"]["channels"]
        rig["devices"]["leds"] = {
            "driver": "numato_led_bank",
            "address": "sim://room/relays",
            "relays": {
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


#: Fewer LEDs take less time.
FEW = QUICK | {"leds": ["430 nm", "455 nm", "530 nm", "625 nm"]}
RELAYS = {"430 nm": 1, "455 nm": 2, "530 nm": 3, "625 nm": 4}


def test_an_led_that_does_not_light_is_left_out_and_named(tmp_path: Path) -> None:
    result = analyse(part_of(record(tmp_path, FEW, _on_relays(RELAYS | {"625 nm": 5}))))
    assert result.leds == ("430 nm", "455 nm", "530 nm")
    assert any("625 nm" in warning and "did not light" in warning for warning in result.warnings)


def test_leds_in_another_order_are_one_clear_line(tmp_path: Path) -> None:
    swapped = _on_relays(RELAYS | {"455 nm": 3, "530 nm": 2})
    with pytest.raises(DataError, match="530 nm is lit as 455 nm") as caught:
        analyse(part_of(record(tmp_path, FEW, swapped)))
    assert "\n" not in str(caught.value)


def test_light_that_leaks_in_is_subtracted(tmp_path: Path) -> None:
    def leaking(rig: dict[str, Any]) -> None:
        rig["simulation"]["faults"] = [{"ambient_light": {"level": "0.5 %", "at": "3 min"}}]

    result = analyse(part_of(record(tmp_path, FEW, leaking)))
    assert any("left with all LEDs off" in warning for warning in result.warnings)
    felt = result.patches["felt"]
    assert not felt.dyes
    true = true_matrix("felt").reflectance[5:30]
    assert np.abs(felt.matrix.reflectance[5:30] - true).max() < 0.05


def test_lamps_join_the_estimate_and_leave_one_led_by_itself_alone(tmp_path: Path) -> None:
    result = analyse(part_of(record(tmp_path, FEW | {"lamps": ["halogen"], "repeats": 1})))
    assert result.leds == ("430 nm", "455 nm", "530 nm", "625 nm", "halogen")
    yellow, felt = result.patches["yellow"], result.patches["felt"]
    assert yellow.value.shape == (5, 3)
    assert len(yellow.dyes) == 1
    assert not felt.dyes
    assert yellow.is_extrapolated.any(), "a lamp does not count as light of a wavelength"
    assert yellow.per_led is not None
