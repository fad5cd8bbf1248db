"""A ColorChecker on the simulated bench: right colours, and what a wrong bench does to them."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from labrig.analyse import AnalysisContext, Inputs
from labrig.calibration import LVF_KIND
from labrig.foundation.errors import UsageError
from labrig.optics import CURVES_FILE
from labrig.protocols.camera_curves.analysis import analyse as analyse_curves
from labrig.protocols.colour_check.analysis import analyse
from labrig.protocols.colour_check.result import ColourCheckResult
from tests.analyse.chart_bench import record, with_camera
from tests.analyse.recorded import part_of, processed_once
from tests.analyse.small_runs import COLOUR_CHECK, with_known_camera
from tests.results.made import assert_read_back
from tests.warned import codes


def with_optics(context: AnalysisContext, **changed: str) -> AnalysisContext:
    """The run as if its rig file had named other curves."""
    optics = context.rig.optics.model_copy(update=changed)
    return replace(context, rig=context.rig.model_copy(update={"optics": optics}))


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("check"), COLOUR_CHECK, with_known_camera)


def test_colours_are_right_end_to_end(run: Path) -> None:
    done = processed_once(run)
    result = done.result
    assert isinstance(result, ColourCheckResult)
    assert result.plain.mean < 2
    assert result.through is not None
    assert result.through.mean < 0.5
    assert (result.plain.verdict, result.through.verdict) == ("agrees", "agrees")
    assert result.plain.mean < result.plain.allowed < 8
    assert result.through.allowed < 3
    assert not result.warnings
    seen = [name for name, patch in result.patches.items() if patch.through is not None]
    assert seen == ["green", "white"]
    assert_read_back(result)
    rows = (done.report.parent / "colour_check.csv").read_text().splitlines()
    assert len(rows) == 1 + 24
    page = done.report.read_text()
    assert page.count("background:#") >= 24 + 24 + 2


@pytest.mark.parametrize(
    ("optics", "code"),
    [
        ({"lamp": "xenon_projector"}, "card-colour-differs"),
        pytest.param(
            {"camera": "nikon_d850"},
            "card-through-filter",
            marks=pytest.mark.campaign,
        ),
    ],
)
def test_a_wrong_lamp_and_wrong_curves_are_noticed(
    run: Path, optics: dict[str, str], code: str
) -> None:
    result = analyse(with_optics(part_of(run), **optics))
    assert code in codes(result.warnings)
    assert result.card_misfit is not None
    assert result.card_misfit > 2


def test_a_filter_that_was_moved_is_noticed(run: Path) -> None:
    part = part_of(run)
    calibrated = part.inputs[LVF_KIND]
    assert calibrated is not None
    strip = calibrated.before_camera
    assert strip is not None
    # The filter now lies to the right of where its calibration had it.
    ends = {side: (x - 0.02, y) for side, (x, y) in (("left", strip.left), ("right", strip.right))}
    before = calibrated.model_copy(update={"before_camera": strip.model_copy(update=ends)})
    result = analyse(replace(part, inputs=Inputs({**part.inputs.provided, "lvf": before})))
    assert result.filter_shift_nm == pytest.approx(0.02 / 0.88 * 324, abs=2)
    assert "strip-shifted" in codes(result.warnings)


@pytest.mark.campaign
@pytest.mark.parametrize("name", ["nikon_d850", "sony_ilce_7m3", "fujifilm_x_t3"])
def test_curves_told_by_the_chart_make_right_colours(tmp_path: Path, name: str) -> None:
    asked = {"protocol": "camera_curves", "leave_out": [name], "through": True}
    curves = record(tmp_path / "curves", asked, with_camera(name))
    result = analyse_curves(part_of(curves))
    result.write_files(tmp_path)

    def with_curves(rig: dict[str, Any]) -> None:
        with_camera(name)(rig)
        rig["optics"]["camera"] = str(tmp_path / CURVES_FILE)

    every = COLOUR_CHECK | {"through": "all"}
    checked = analyse(part_of(record(tmp_path / "check", every, with_curves)))
    assert checked.plain.mean < 2
    assert checked.through is not None
    assert checked.through.mean < 2
    assert not checked.warnings
    pulls = (checked.card_balance - 1) / checked.card_balance_sigma
    assert np.abs(pulls).max() < 3


def test_what_is_missing_is_one_clear_line(run: Path) -> None:
    part = part_of(run)
    without = replace(part, inputs=Inputs())
    with pytest.raises(UsageError, match="needs the LVF calibrated before the camera") as caught:
        analyse(without)
    assert "\n" not in str(caught.value)
    protocol = part.protocol.model_copy(update={"chart": "grey_card_18"})
    with pytest.raises(UsageError, match="expected the 24 patches of a ColorChecker, a column"):
        analyse(replace(part, protocol=protocol))
