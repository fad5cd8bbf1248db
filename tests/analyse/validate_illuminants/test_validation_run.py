"""Fluorescent samples under the lamps of the simulated bench, beside their predictions."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from labrig.analyse import AnalysisContext
from labrig.foundation.errors import DataError, UsageError
from labrig.protocols.led_fluorescence.result import LedFluorescenceResult
from labrig.protocols.validate_illuminants.analysis import analyse
from labrig.protocols.validate_illuminants.result import ValidateIlluminantsResult
from labrig.reduce import find_colour_chart
from labrig.results import RunResult, write_result
from tests.analyse.led_bench import QUICK, SAMPLES, record
from tests.analyse.recorded import part_of, processed_once
from tests.analyse.small_runs import VALIDATE_ONE
from tests.results.made import assert_read_back
from tests.warned import of_code

VALIDATE: dict[str, Any] = {
    "protocol": "validate_illuminants",
    "patches": QUICK["patches"],
    "fluorescence": SAMPLES,
    "longest": "2 s",
}


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("validate"), VALIDATE)


@pytest.fixture(scope="module")
def result(run: Path) -> ValidateIlluminantsResult:
    return analyse(part_of(run))


def test_predictions_of_true_matrices_agree_under_lamps_that_are_not_quite_their_files(
    result: ValidateIlluminantsResult,
) -> None:
    assert list(result.lamps) == ["daylight", "halogen", "xenon", "ultraviolet"]
    for lamp in result.lamps.values():
        assert lamp.verdict == "agrees"
        assert lamp.reduced_chi2 < 2
        for patch in lamp.patches.values():
            assert patch.delta_e.value < 3 * patch.delta_e_by_errors
    assert not result.warnings


def test_without_fluorescence_colours_are_far_off_where_there_is_some(
    result: ValidateIlluminantsResult,
) -> None:
    for lamp in result.lamps.values():
        for name in ("yellow", "orange"):
            patch = lamp.patches[name]
            assert patch.delta_e_reflected.value > 3 * patch.delta_e.value
            assert patch.delta_e_reflected.value > 8
        felt = lamp.patches["felt"]
        assert felt.delta_e_reflected.value == pytest.approx(felt.delta_e.value)
        np.testing.assert_allclose(felt.predicted, felt.reflected)


def test_a_lamp_that_the_camera_does_not_see_is_scaled_by_the_samples(
    result: ValidateIlluminantsResult,
) -> None:
    scales = {name: lamp.scale for name, lamp in result.lamps.items()}
    assert [name for name, scale in scales.items() if scale == "samples"] == ["ultraviolet"]
    black_light = result.lamps["ultraviolet"]
    assert black_light.white == "D65"
    paper = black_light.patches["paper"]
    assert paper.reradiated_only.xyz.sum() > 10 * paper.reflected_only.xyz.sum()


def test_the_result_is_read_back_and_its_page_says_what_it_is(run: Path) -> None:
    done = processed_once(run)
    assert isinstance(done.result, ValidateIlluminantsResult)
    assert_read_back(done.result)
    *lines, budgets = done.lines
    assert [line.split(":")[0] for line in lines] == list(done.result.lamps)
    assert all("agrees" in line for line in lines)
    assert budgets == "budgets of 16 values are in the report"
    rows = (done.report.parent / "illuminants.csv").read_text().splitlines()
    assert len(rows) == 1 + 4 * 4
    page = done.report.read_text()
    assert page.count("<h2>Under ") == 4
    assert "does not measure its brightness" in page


def _with_relays(relays: dict[str, int]) -> Callable[[dict[str, Any]], None]:
    def change(rig: dict[str, Any]) -> None:
        for lamp, relay in relays.items():
            rig["devices"]["illuminants"]["channels"][lamp]["relay"] = relay

    return change


def asked_anew(context: AnalysisContext, change: dict[str, Any]) -> AnalysisContext:
    """The run as if its protocol had said something else of what is compared."""
    return replace(context, protocol=context.protocol.model_copy(update=change))


def test_another_matrix_differs_and_is_named(run: Path) -> None:
    wrong = {"fluorescence": SAMPLES | {"felt": "white-paper"}}
    result = analyse(asked_anew(part_of(run), wrong))
    for lamp in ("daylight", "halogen", "xenon"):
        assert result.lamps[lamp].verdict == "differs"
        (differs,) = (w for w in result.warnings if w.subject == lamp)
        assert (differs.code, differs.values["worst"]) == ("photographs-differ", "felt")


def test_a_lamp_that_does_not_light_is_left_out_and_named(tmp_path: Path) -> None:
    two = VALIDATE_ONE | {"lamps": ["daylight", "halogen"]}
    result = analyse(part_of(record(tmp_path, two, _with_relays({"halogen": 7}))))
    assert list(result.lamps) == ["daylight"]
    assert of_code(result.warnings, "light-unlit").subject == "halogen"


def test_lamps_in_another_order_count_as_those_that_were_lit(run: Path) -> None:
    part = part_of(run)
    entry = part.rig.devices["illuminants"]
    lamps = entry.settings()["channels"]
    swapped = lamps | {"daylight": lamps["halogen"], "halogen": lamps["daylight"]}
    devices = part.rig.devices | {"illuminants": entry.model_copy(update={"channels": swapped})}
    rig = part.rig.model_copy(update={"devices": devices})
    result = analyse(replace(part, rig=rig))
    assert list(result.lamps) == ["halogen", "daylight", "xenon", "ultraviolet"]
    assert {lamp.verdict for lamp in result.lamps.values()} == {"agrees"}
    (warning,) = result.warnings
    assert warning.code == "lights-exchanged"
    assert "halogen for daylight" in warning.values["exchanged"]


@pytest.mark.campaign
def test_light_of_the_room_is_subtracted_and_said(tmp_path: Path) -> None:
    def leaking(rig: dict[str, Any]) -> None:
        rig["simulation"]["faults"] = [{"ambient_light": {"level": "0.5 %", "at": "3 min"}}]

    result = analyse(part_of(record(tmp_path, VALIDATE_ONE, leaking)))
    left = [warning for warning in result.warnings if warning.code == "light-left"]
    assert "halogen" in {each.values["lights"][0] for each in left}
    assert result.lamps["halogen"].verdict == "agrees"


def test_no_chart_where_one_is_expected_is_one_clear_line(run: Path) -> None:
    card = part_of(run).run.frames("lamp-card")[0]
    with pytest.raises(DataError, match="expected a ColorChecker, found none") as caught:
        find_colour_chart(card.path)
    assert "\n" not in str(caught.value)


@pytest.mark.campaign
def test_a_chart_is_found_in_the_frame_and_tells_the_colours(tmp_path: Path) -> None:
    def larger(rig: dict[str, Any]) -> None:
        rig["simulation"]["sensor"] = {"width": 384, "height": 256}

    result = analyse(part_of(record(tmp_path, VALIDATE_ONE | {"chart": True}, larger)))
    assert result.colours_from == "chart"
    assert result.chart_delta_e is not None
    assert result.chart_delta_e[0] < 2
    assert result.lamps["halogen"].patches["felt"].delta_e.value < 1


def _written(folder: Path, result: RunResult) -> Path:
    write_result(folder, result)
    return folder


def test_results_of_other_patches_and_none_are_one_clear_line(
    run: Path, result: ValidateIlluminantsResult, tmp_path: Path
) -> None:
    part = part_of(run)

    def of(fluorescence: object) -> None:
        analyse(asked_anew(part, {"fluorescence": fluorescence}))

    with pytest.raises(UsageError, match="expected 'fluorescence:' in the protocol"):
        of(None)
    with pytest.raises(UsageError, match="expected a run of led_fluorescence, got one of valid"):
        of(str(_written(tmp_path, result)))
    others = LedFluorescenceResult(
        leds=(),
        led_peak_nm=np.zeros(0),
        channels=("R", "G", "B"),
        brightness=np.zeros(0),
        is_brightness_known=np.zeros(0, dtype=np.bool_),
        uv_scale="none",
        patches={},
        run="earlier",
        warnings=(),
    )
    with pytest.raises(UsageError, match="expected a patch 'felt', got none; give the patches"):
        of(str(_written(tmp_path, others)))
    with pytest.raises(UsageError, match="got a phosphor"):
        of(SAMPLES | {"felt": "blue-paint"})
