"""Curves of cameras that labrig does not have, from charts photographed on the simulated bench."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from labrig.analyse import AnalysisContext, Overrides
from labrig.bench_optics import camera_curves
from labrig.fit.camera_curves import GRID_NM
from labrig.foundation.errors import DataError, LabrigError, UsageError
from labrig.optics import CURVES_FILE, CameraResponse, read_camera
from labrig.protocols.camera_curves.analysis import analyse
from labrig.protocols.camera_curves.result import CameraCurvesResult
from labrig.results import write_result
from tests.analyse.chart_bench import record, true_curves, with_camera
from tests.analyse.recorded import part_of, processed_once
from tests.analyse.small_runs import UNKNOWN_CAMERA, curves_protocol
from tests.fit.unknown_cameras import rms_of_curves
from tests.results.made import assert_read_back
from tests.warned import codes


def asked_anew(context: AnalysisContext, **change: Any) -> AnalysisContext:
    """The run as if its protocol had said something else of what is made of it."""
    return replace(context, protocol=context.protocol.model_copy(update=change))


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("curves")
    return record(
        folder, curves_protocol(UNKNOWN_CAMERA, through=True), with_camera(UNKNOWN_CAMERA)
    )


@pytest.fixture(scope="module")
def by_chart(run: Path) -> CameraCurvesResult:
    return analyse(asked_anew(part_of(run), through=False))


def error_of(result: CameraCurvesResult, name: str | None) -> float:
    nm, curves = true_curves(name)
    return rms_of_curves(result.response(), CameraResponse("true", nm, curves))


def test_an_unknown_camera_is_told_by_its_chart(by_chart: CameraCurvesResult) -> None:
    family = replace(by_chart, sensitivity=by_chart.family_mean)
    assert error_of(by_chart, UNKNOWN_CAMERA) < 0.03
    assert error_of(by_chart, UNKNOWN_CAMERA) < 0.5 * error_of(family, UNKNOWN_CAMERA)
    assert by_chart.left_out == ("canon_eos_5d_mark_ii", UNKNOWN_CAMERA)
    assert by_chart.family_count == 50
    assert not by_chart.warnings


def test_the_filter_halves_the_error(run: Path, by_chart: CameraCurvesResult) -> None:
    done = processed_once(run)
    assert isinstance(done.result, CameraCurvesResult)
    assert done.result.through_filter
    assert error_of(done.result, UNKNOWN_CAMERA) < 0.6 * error_of(by_chart, UNKNOWN_CAMERA)
    assert done.result.mean_sigma < 0.5 * by_chart.mean_sigma
    assert_read_back(done.result)
    # A rig file names the run, as it does for calibrations.
    written = read_camera(run)
    assert written.sigma is not None
    np.testing.assert_allclose(written.sensitivity, done.result.sensitivity, atol=1e-5)
    np.testing.assert_allclose(written.sigma, done.result.sigma, atol=1e-5)
    np.testing.assert_array_equal(written.wavelength_nm, GRID_NM)
    assert "Spectral sensitivity" in done.report.read_text()


@pytest.mark.campaign
@pytest.mark.parametrize("name", ["nikon_d850", "sony_ilce_7m3", "fujifilm_x_t3", "canon_eos_r5"])
def test_more_cameras_are_told_within_two_per_cent(tmp_path: Path, name: str) -> None:
    part = part_of(record(tmp_path, curves_protocol(name, through=True), with_camera(name)))
    assert error_of(analyse(asked_anew(part, through=False)), name) < 0.025
    assert error_of(analyse(part), name) < 0.012


@pytest.mark.campaign
def test_another_lamp_than_the_rig_files_is_said(run: Path) -> None:
    part = asked_anew(part_of(run), through=False)
    optics = part.rig.optics.model_copy(update={"lamp": "xenon_projector"})
    other = analyse(replace(part, rig=part.rig.model_copy(update={"optics": optics})))
    assert "camera-unusual" in codes(other.warnings)


def test_a_lens_that_the_rig_file_names_is_not_in_the_curves(
    run: Path, by_chart: CameraCurvesResult
) -> None:
    part = asked_anew(part_of(run), through=False)
    optics = part.rig.optics.model_copy(update={"lens": "photographic_lens"})
    rig = part.rig.model_copy(update={"optics": optics})
    body = analyse(replace(part, rig=rig))
    assert not body.warnings
    seen = camera_curves(rig, str(_written(body, run.parent)))
    assert rms_of_curves(seen, by_chart.response()) < 0.01


def _written(result: CameraCurvesResult, folder: Path) -> Path:
    write_result(folder, result)
    return folder / CURVES_FILE


def test_what_cannot_be_used_is_one_clear_line(run: Path) -> None:
    part = part_of(run)
    with pytest.raises(UsageError, match="no shipped camera is called 'nikon_d85'; did you mean"):
        analyse(asked_anew(part, leave_out=("nikon_d85",)))
    frames = part.run.frames("curves-chart")
    metered_s = min(frame.exposure_s for frame in frames)
    metered = frozenset(frame.path.name for frame in frames if frame.exposure_s == metered_s)
    overrides = Overrides(excluded=metered)
    with pytest.raises(DataError, match=r"clip") as caught:
        analyse(replace(asked_anew(part, through=False), overrides=overrides))
    assert "\n" not in str(caught.value)


def test_a_folder_without_curves_is_one_clear_line(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"expected a run of camera_curves with curves\.csv"):
        read_camera(tmp_path)


def test_a_chart_that_is_not_seen_stops_the_run(tmp_path: Path) -> None:
    def tiny(rig: dict[str, Any]) -> None:
        rig["simulation"]["chart"] = [0.4, 0.4, 0.08, 0.08]

    with pytest.raises(LabrigError, match="expected a ColorChecker, found none") as caught:
        record(tmp_path, curves_protocol(UNKNOWN_CAMERA, card=False), tiny)
    assert "\n" not in str(caught.value)
