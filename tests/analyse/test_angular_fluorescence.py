"""Angular fluorescence on the simulated bench: none and a planted dependence, faults, pages."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from labrig.analyse import AnalysisContext, Inputs
from labrig.foundation.errors import DataError, UsageError
from labrig.process import process_and_report
from labrig.protocols.angular_fluorescence.analysis import analyse
from labrig.protocols.angular_fluorescence.protocol import Circle
from labrig.protocols.angular_fluorescence.result import AngularFluorescenceResult
from labrig.record import Attempt
from tests.analyse.angular_bench import record_angular, record_sphere, true_camera
from tests.analyse.recorded import part_of, processed_once
from tests.analyse.small_runs import ANGULAR
from tests.results.made import assert_read_back
from tests.warned import codes, of_code


#: Few views, of angles far apart.
def yarn(folder: Path, keys: dict[str, Any] | None = None, **simulation: Any) -> AnalysisContext:
    return part_of(record_angular(folder, ANGULAR | (keys or {}), **simulation))


@pytest.fixture(scope="module")
def planted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run with a dependence."""
    return record_angular(
        tmp_path_factory.mktemp("planted"), ANGULAR, reradiation_anisotropy=0.06, repositioning=0.01
    )


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> AnalysisContext:
    """A run with both directions, each with three placings."""
    keys = {"directions": ["vertical", "horizontal"], "repositionings": 3, "angles": [30, 60, 90]}
    return yarn(tmp_path_factory.mktemp("both"), keys)


def test_no_dependence_is_found_where_there_is_none(tmp_path: Path) -> None:
    result = analyse(yarn(tmp_path, repositioning=0.01))
    (views,) = result.yarns
    assert not result.finds_dependence
    assert views.channels == ("R", "G", "B")
    assert views.reflected_at_most == 0.0
    assert views.means.angle_deg.tolist() == [30, 60, 90, 120]
    # The placings of the room, with the camera's flicker of two frames and the LED's warmth.
    assert views.means.scatter.value == pytest.approx(0.011, abs=3 * views.means.scatter.sigma)
    assert 0.02 < result.detectable < 0.05
    assert not result.warnings
    assert_read_back(result)


def test_a_planted_dependence_is_found_and_measured(planted: Path) -> None:
    result = analyse(part_of(planted))
    (views,) = result.yarns
    true = 1 - 0.06 * (1 - np.cos(np.radians(views.means.angle_deg)))
    assert result.finds_dependence
    assert result.p < 1e-3
    assert views.means.test.interval[1] < 0
    off = (views.means.mean - true / np.exp(np.log(true).mean())) / views.means.mean_sigma
    assert np.abs(off).max() < 3.5


def test_reflected_light_that_a_channel_sees_is_no_re_radiation(tmp_path: Path) -> None:
    """The yarn's sheen is 4.5 times as bright at 30° as at 120°, and R sees some of it."""
    part = yarn(tmp_path, {"leds": ["455 nm"], "repositionings": 3})
    result = analyse(part)
    (views,) = result.yarns
    assert "R" in views.channels
    assert "B" not in views.channels
    assert 0.003 < views.reflected_at_most < 0.05
    assert not result.finds_dependence
    assert result.detectable > 0.02
    wanted = part.protocol.model_copy(update={"channels": ("B",)})
    blue = analyse(replace(part, protocol=wanted))
    (warning,) = blue.warnings
    assert (warning.code, warning.subject) == ("reflected-light", "455 nm")
    assert (warning.values["reflected"], warning.values["channels"]) == (1.0, ("B",))
    wrong = part.protocol.model_copy(update={"channels": ("X",)})
    with pytest.raises(UsageError, match="expected some of R, G, B, got X"):
        analyse(replace(part, protocol=wrong))


def test_without_curves_channels_have_to_be_named(tmp_path: Path) -> None:
    keys = ANGULAR | {"angles": [30, 90], "repositionings": 3}
    run = record_angular(tmp_path, keys, lambda rig: rig["optics"].pop("camera"))
    part = part_of(run)
    with pytest.raises(UsageError, match=r"expected 'channels' in the protocol, for example \[R\]"):
        analyse(part)
    named = part.protocol.model_copy(update={"channels": ("R", "G")})
    result = analyse(replace(part, protocol=named))
    (warning,) = result.warnings
    assert (warning.code, warning.subject) == ("reflected-light-unknown", "365 nm")
    assert warning.values["channels"] == ("R", "G")
    assert np.isnan(result.yarns[0].reflected_at_most)


@pytest.mark.campaign
def test_views_that_are_missing_are_named_and_the_others_used(both: AnalysisContext) -> None:
    part, attempts = both, both.run.attempts

    def without(*units: str) -> list[Attempt]:
        return [attempt for attempt in attempts if attempt.unit not in units]

    missing = without("365 nm vertical 60° 2", "365 nm vertical 90° 3")
    result = analyse(replace(part, run=replace(part.run, attempts=missing)))
    (warning,) = result.warnings
    assert (warning.code, warning.values["missing"]) == ("view-missing", 2)
    assert warning.values["named"].startswith("365 nm vertical 60° 2, 365 nm vertical 90°")
    assert [len(views.signal) for views in result.yarns] == [9, 11]
    only = [attempt for attempt in attempts if "horizontal" not in attempt.unit]
    result = analyse(replace(part, run=replace(part.run, attempts=only)))
    assert [views.direction for views in result.yarns] == ["vertical"]
    untested = of_code(result.warnings, "views-untested")
    assert untested.subject == "horizontal under 365 nm"
    few = [attempt for attempt in attempts if attempt.unit.endswith(("before", "after"))]
    with pytest.raises(DataError, match="scatter cannot be estimated; go on with labrig resume"):
        analyse(replace(part, run=replace(part.run, attempts=few)))
    with pytest.raises(DataError, match="no view is complete"):
        analyse(replace(part, run=replace(part.run, attempts=[])))


def swapped(context: AnalysisContext, unit: str, **roles: str) -> AnalysisContext:
    """The part with the frames of one view given other roles."""
    attempts = []
    for attempt in context.run.attempts:
        if attempt.unit == unit:
            frames = [
                replace(frame, role=roles.get(frame.role.replace("-", "_"), frame.role))
                for frame in attempt.frames
            ]
            attempt = replace(attempt, frames=frames)
        attempts.append(attempt)
    return replace(context, run=replace(context.run, attempts=attempts))


def test_an_led_that_does_not_light_in_one_view_is_noticed(planted: Path) -> None:
    part = part_of(planted)
    views = len(analyse(part).yarns[0].signal)
    unlit = swapped(
        part, "365 nm vertical 60° 2",
        angular_view="angular-off", angular_off="angular-view",
    )  # fmt: skip
    result = analyse(unlit)
    (warning,) = result.warnings
    assert (warning.code, warning.values["named"]) == ("view-dark", "365 nm vertical 60° 2")
    assert len(result.yarns[0].signal) == views - 1


def test_a_clipped_view_is_left_out(tmp_path: Path) -> None:
    """Metered at 150°, the sheen at 10° clips; all of this light is reflected."""
    keys = {"leds": ["625 nm"], "angles": [150, 120, 10], "channels": ["R"], "repositionings": 3}
    result = analyse(yarn(tmp_path, keys))
    clipped, reflected = result.warnings
    assert (clipped.code, clipped.values["clipped"]) == ("view-clipped", 3)
    assert "625 nm vertical 10° 1, 625 nm vertical 10° 2" in clipped.values["named"]
    assert (reflected.code, reflected.subject) == ("reflected-light", "625 nm")
    assert result.yarns[0].means.angle_deg.tolist() == [120, 150]


@pytest.fixture(scope="module")
def sphere(tmp_path_factory: pytest.TempPathFactory) -> AnalysisContext:
    """A run with a sphere of 90 px about (180, 120) in a frame of 360 × 240."""
    folder = tmp_path_factory.mktemp("sphere")
    run = record_sphere(folder, {"reflected_led": "625 nm"}, repositioning=0.01)
    return part_of(run, Inputs({"camera": true_camera(run)}))


def changed(context: AnalysisContext, **keys: Any) -> AnalysisContext:
    """The part with other settings of its protocol."""
    return replace(context, protocol=context.protocol.model_copy(update=keys))


@pytest.mark.parametrize(
    ("region", "sides"),
    [
        ((82, 50, 196, 140), {"above": 20, "below": 20}),
        ((94, 38, 184, 180), {"left": 4, "above": 8}),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, dict) else "",
)
def test_a_region_that_cuts_the_outline_is_named_and_no_dependence(
    sphere: AnalysisContext, region: tuple[int, ...], sides: dict[str, int]
) -> None:
    result = analyse(changed(sphere, region=region))
    reradiated, _ = result.spheres
    assert reradiated.circles == pytest.approx(np.array([[180.0, 120.0, 90.0]] * 4), abs=1.0)
    assert result.p > 0.2
    line = next(str(each) for each in result.warnings if each.code == "outline-cut")
    for side, px in sides.items():
        named = re.search(rf"{side} by (\d+) px \((\d+) % of its radius\)", line)
        assert named is not None
        assert int(named[1]) == pytest.approx(px, abs=1)
        assert int(named[2]) == pytest.approx(100 * px / 90, abs=1.5)
    assert 0.007 < reradiated.shading.by_view.amplitude.sigma < 0.02


def test_an_outline_of_which_too_little_is_left_is_refused(sphere: AnalysisContext) -> None:
    with pytest.raises(DataError, match=r"in \d+ of 61 directions: the region cuts it off"):
        analyse(changed(sphere, region=(120, 22, 158, 196)))


def test_a_given_circle_that_is_off_is_named_and_refined(sphere: AnalysisContext) -> None:
    across, down, wider = -2, 0, -2
    circle = Circle(
        centre=((180 + across) / 360, (120 + down) / 240), radius=(90 + wider) / 360
    )  # fmt: skip
    result = analyse(changed(sphere, circle=circle))
    assert not result.finds_dependence
    assert codes(result.warnings)[0] == "circle-differs"
    assert result.detectable < 0.07


def test_a_given_circle_of_another_outline_counts_with_the_difference(
    sphere: AnalysisContext,
) -> None:
    result = analyse(changed(sphere, circle=Circle(centre=(0.5, 0.5), radius=85 / 360)))
    assert not result.finds_dependence
    assert result.spheres[0].circles == pytest.approx(np.array([[180.0, 120.0, 85.0]] * 4))
    assert result.warnings[0].values["taken"] == "the difference is in σ"
    assert 0.2 < result.detectable < 1.0


def test_a_sphere_is_lambertian_in_re_radiation_and_not_in_reflection(
    sphere: AnalysisContext,
) -> None:
    result = analyse(sphere)
    reradiated, reflected = result.spheres
    assert not result.finds_dependence
    assert not result.warnings
    assert_read_back(result)
    for views in result.spheres:
        assert views.circles == pytest.approx(np.array([[180.0, 120.0, 90.0]] * 4), abs=0.7)
    assert reradiated.shading.radiance == pytest.approx(reradiated.shading.cos_incidence, abs=0.01)
    assert reradiated.shading.roughness_deg.value < 5.0
    # The room's cloth is brighter at its rim, by another law than Oren's and Nayar's.
    assert reflected.shading.by_view.finds_dependence
    assert reflected.shading.by_incidence.finds_dependence
    assert reflected.shading.roughness_deg.value == pytest.approx(21.0, abs=3.0)


@pytest.mark.campaign
def test_what_a_sphere_loses_to_the_side_is_found(tmp_path: Path) -> None:
    run = record_sphere(tmp_path, {}, repositioning=0.01, reradiation_anisotropy=0.06)
    known = analyse(part_of(run, Inputs({"camera": true_camera(run)})))
    (views,) = known.spheres
    amplitude = views.shading.by_view.amplitude
    assert known.finds_dependence
    assert abs(amplitude.value + 0.06) < 3 * amplitude.sigma
    assert amplitude.sigma < 0.015
    assert not views.shading.by_incidence.finds_dependence
    cut = analyse(
        changed(part_of(run, Inputs({"camera": true_camera(run)})), region=(82, 50, 196, 140))
    )
    assert cut.finds_dependence
    assert cut.warnings
    # Without the lens it could be the lens.
    unknown = analyse(part_of(run))
    assert not unknown.spheres[0].is_lens_known
    assert not unknown.finds_dependence
    page = process_and_report(run)
    assert "The lens is not calibrated" in page.report.read_text()
    part = part_of(run)
    circle = Circle(centre=(0.5, 0.5), radius=0.24)
    given = analyse(changed(part, circle=circle))
    assert given.spheres[0].circles == pytest.approx(np.array([[180.0, 120.0, 86.4]] * 4))


def test_a_flat_sample_is_no_sphere(tmp_path: Path) -> None:
    run = record_angular(tmp_path, {"shape": "sphere", "region": [0.0, 0.0, 1.0, 1.0]})
    with pytest.raises(DataError, match=r"give its circle: \{centre"):
        analyse(part_of(run))


def test_the_page_answers_with_p_and_power(planted: Path) -> None:
    done = processed_once(planted)
    assert isinstance(done.result, AngularFluorescenceResult)
    line, *budgets = done.lines
    assert all(each.startswith("budget") for each in budgets)
    assert line.startswith("angular fluorescence: re-radiation depends on angle (p < ")
    assert "from 30° to 120°, vertical, 365 nm, it changes by −" in line
    assert "would have been found with 90 % power" in line
    page = done.report.read_text()
    assert "Re-radiation depends on angle" in page
    rows = (done.report.parent / "angular.csv").read_text().splitlines()
    assert len(rows) == 1 + 4
