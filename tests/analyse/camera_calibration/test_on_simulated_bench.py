"""A camera calibration on the simulated bench, whose sensor, lens and lamp are not the model's.

Pixels share charge with their neighbours, rows share noise, and the lamp loses a tenth of its light
in an hour: none of that is in the camera file.
"""

import shutil
from pathlib import Path
from typing import Any

import pytest

from labrig.analyse.inputs import Inputs
from labrig.calibration import CAMERA_KIND, CameraFile
from labrig.foundation.errors import DataError
from labrig.process import Processed, process_run
from labrig.protocols.camera_calibration.result import CameraCalibrationResult
from labrig.protocols.decay import analysis as decay_analysis
from labrig.record import read_run
from labrig.sim.optics import vignetting
from labrig.sim.sensor import gain_electrons_per_dn, read_noise_electrons
from tests.analyse.recorded import cut_off_and_resumed, part_of, processed_once, record
from tests.analyse.small_runs import CAMERA_CALIBRATION, unlike_the_model
from tests.results.made import assert_read_back
from tests.warned import codes


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("camera"), CAMERA_CALIBRATION, unlike_the_model)


@pytest.fixture(scope="module")
def processed(run: Path) -> Processed:
    return processed_once(run)


@pytest.fixture(scope="module")
def result(processed: Processed) -> Any:
    return processed.result


@pytest.fixture(scope="module")
def camera(result: CameraCalibrationResult) -> CameraFile:
    return result.calibration


def test_the_result_and_its_file_are_read_back(run: Path, result: CameraCalibrationResult) -> None:
    assert CAMERA_KIND.read(run / "result" / "camera.yaml") == result.calibration
    assert_read_back(result)


def test_a_person_is_reported(processed: Processed) -> None:
    told = ("ISO 100: gain", "ISO 400: gain", "flicker", "shutter", "aperture", "vignetting")
    *lines, budgets = processed.lines
    assert budgets.startswith("budgets of ")
    for line, begin in zip(lines, told, strict=True):
        assert line.startswith(begin)


def test_gain_and_read_noise_are_the_sensors(camera: CameraFile) -> None:
    assert [noise.iso for noise in camera.noise] == [100, 400]
    for noise in camera.noise:
        gain, read = gain_electrons_per_dn(noise.iso), read_noise_electrons(noise.iso)
        assert abs(noise.gain_e_per_dn - gain) < 3.5 * noise.gain_e_per_dn_sigma
        assert noise.gain_e_per_dn_sigma < 0.07 * gain
        assert abs(noise.read_noise_e - read) < 3.5 * noise.read_noise_e_sigma
        assert noise.row_noise_e == pytest.approx(0.5 * read, rel=0.35)


def test_shared_charge_is_seen(result: CameraCalibrationResult) -> None:
    assert any(one.neighbours_share_noise for one in result.photon_transfers)
    assert "pixels-share-noise" in codes(result.warnings)


def test_flicker_is_the_rooms_and_not_the_lamps_drift(
    camera: CameraFile, result: CameraCalibrationResult
) -> None:
    assert abs(camera.flicker - 0.007) < 3.5 * camera.flicker_sigma
    assert camera.flicker_sigma < 0.001
    assert abs(result.repeat_flicker.value - 0.007) < 3.5 * result.repeat_flicker.sigma


def test_shutter_iso_and_aperture_are_the_bodys(camera: CameraFile) -> None:
    """The room's shutter and gain are what they tell, its apertures true powers of √2."""
    for one in (*camera.shutter, *camera.iso_gain):
        assert abs(one.factor - 1) <= 4 * one.sigma
    (f4, f11) = camera.aperture
    assert (f4.setting, f4.factor, f11.setting) == (4.0, 1.0, 11.0)
    true = (11 / 2 ** (7 / 2)) ** 2
    assert abs(f11.factor - true) < 4 * f11.sigma
    assert f11.sigma < 0.006
    times_s = [one.setting for one in camera.shutter]
    assert times_s == sorted(times_s)
    assert times_s[-1] / times_s[0] > 100


def test_the_sensor_is_linear_until_pixels_are_full(
    camera: CameraFile, result: CameraCalibrationResult
) -> None:
    """A full pixel still shares its charge: it stays below the level that says it is full."""
    assert camera.linearity is not None
    curve = zip(
        camera.linearity.level_dn, camera.linearity.deviation, camera.linearity.sigma, strict=True
    )
    below = [(value, sigma) for level, value, sigma in curve if level < 14_000]
    assert len(below) >= 4
    assert all(abs(value) < 4 * sigma for value, sigma in below)
    assert camera.linearity.saturation_dn == pytest.approx(15_600 - 1024)
    assert "sensor-nonlinear" in codes(result.warnings)


def test_the_flat_field_is_the_lenss(camera: CameraFile) -> None:
    falloff = vignetting(64, 96)
    for flat in camera.flats:
        for region in ((0.0, 0.0, 0.1, 0.1), (0.45, 0.45, 0.1, 0.1), (0.8, 0.3, 0.2, 0.4)):
            rows = slice(round(region[1] * 64), round((region[1] + region[3]) * 64))
            columns = slice(round(region[0] * 96), round((region[0] + region[2]) * 96))
            true = falloff[rows, columns].mean()
            assert flat.mean(region, 96, 64) == pytest.approx(true, abs=0.006)


def test_the_body_is_noted_and_known_again(run: Path, camera: CameraFile) -> None:
    identity = read_run(run).attempts[0].start["devices"]["camera"]
    assert camera.camera == identity
    camera.require_match(identity, None, 4.0)
    with pytest.raises(DataError, match="another lens or aperture"):
        camera.require_match(identity, None, 5.6)


@pytest.mark.campaign
def test_killed_within_a_bracket_it_goes_on_there(
    run: Path, result: CameraCalibrationResult, camera: CameraFile, tmp_path: Path
) -> None:
    again = tmp_path / "again"
    shutil.copytree(run, again)
    cut, resumed = cut_off_and_resumed(again, "aperture")
    before, after = cut.completed(), resumed.completed()
    assert list(after) == list(read_run(run).completed())
    assert "shutter" in before
    assert "aperture" not in before
    assert all(after[unit].uid == attempt.uid for unit, attempt in before.items())
    # The bench may have been put to another use: what was put in is asked for again.
    asked = [a.task for u in after if u not in before for a in after[u].actions if a.is_manual]
    assert asked == ["grey card", "sample"]
    processed = process_run(again)
    assert isinstance(processed, CameraCalibrationResult)
    other = processed.calibration
    for one, as_before in zip(other.aperture, camera.aperture, strict=True):
        assert one.factor == pytest.approx(as_before.factor, abs=5 * 0.007)


def test_a_decay_uses_it_or_refuses_it(camera: CameraFile, tmp_path: Path) -> None:
    decay = {
        "protocol": "decay", "sample": {"name": "test"}, "charge": "60 s", "for": "40 s",
        "first": "1 s", "exposure": "1 s", "patches": {"corner": [0.05, 0.12, 0.1, 0.2]},
        "camera": {"iso": 400, "f_number": 4},
    }  # fmt: skip
    run = record(tmp_path, decay)

    def brightest(known: Inputs) -> float:
        found = decay_analysis.analyse(part_of(run, known))
        return float(found.patches["corner"].series.values[0].max())

    left = vignetting(64, 96)[8:20, 5:15].mean()
    assert brightest(Inputs({"camera": camera})) == pytest.approx(
        brightest(Inputs()) / left, rel=0.006
    )
    others: dict[str, dict[str, Any]] = {
        "another lens or aperture": {"flats": (camera.flats[1],)},
        "another camera": {"camera": camera.camera.replace("5D", "6D")},
    }
    for said, changes in others.items():
        with pytest.raises(DataError, match=f"calibration of {said}"):
            brightest(Inputs({"camera": camera.model_copy(update=changes)}))


def test_frames_of_another_lens_refuse_it(camera: CameraFile, tmp_path: Path) -> None:
    def other_lens(rig: dict[str, Any]) -> None:
        rig["simulation"]["lens"] = {"name": "EF50mm f/1.4 USM", "focal_mm": 50}

    decay = {"protocol": "decay", "charge": "20 s", "for": "20 s", "first": "1 s",
             "exposure": "1 s"}  # fmt: skip
    run = record(tmp_path, decay, other_lens)
    with pytest.raises(DataError, match="calibration of another lens: expected EF75mm") as caught:
        decay_analysis.analyse(part_of(run, Inputs({"camera": camera})))
    assert "EF50mm f/1.4 USM, 50 mm" in str(caught.value)
