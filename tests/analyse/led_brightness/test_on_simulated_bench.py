"""led_brightness on the simulated bench: true LEDs are skewed, droop, and are off the rig file."""

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from labrig.bench_optics import led_sources
from labrig.calibration import LEDS_KIND
from labrig.foundation import resources
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError, UsageError
from labrig.protocols.led_brightness.analysis import analyse
from labrig.protocols.led_brightness.result import LedBrightnessResult
from tests.analyse.led_brightness.led_bench import (
    Rig,
    calibrated,
    processed,
    recorded,
    result_of,
    shine_like,
    truth,
    without_spectrometer,
)
from tests.analyse.recorded import part_of
from tests.results.made import assert_read_back

SHORT, LONG = ["430 nm", "455 nm"], ["565 nm", "590 nm", "625 nm"]
SOME = ["365 nm", "430 nm", "490 nm", "530 nm", "625 nm"]


def seeded(seed: int) -> Callable[[Rig], None]:
    def change(rig: Rig) -> None:
        rig["simulation"]["seed"] = seed

    return change


def pulls(result: LedBrightnessResult, run: Path) -> FloatArray:
    """Errors of the brightnesses about their common scale over their σ."""
    true = truth(run)
    known = {
        name: led.brightness for name, led in result.leds.items() if led.brightness is not None
    }
    error = np.array([math.log(one.value / true[name][1]) for name, one in known.items()])
    sigma = np.array([one.sigma / one.value for one in known.values()])
    weight = sigma**-2 / (sigma**-2).sum()
    return np.asarray((error - weight @ error) / sigma)


def faults(result: LedBrightnessResult) -> dict[str, tuple[str, ...]]:
    assert not any("\n" in str(each) for each in result.warnings)
    return {each.code: each.values.get("leds", ()) for each in result.warnings}


@pytest.mark.campaign
def test_in_many_rooms_errors_are_as_large_as_sigma_says(tmp_path: Path) -> None:
    all_pulls = []
    for seed in range(1, 13):
        run = recorded(tmp_path / str(seed), seeded(seed))
        all_pulls.append(pulls(result_of(run), run))
    assert 0.8 < np.sqrt(np.mean(np.square(all_pulls))) < 1.25


def test_spectra_and_brightnesses_are_the_rooms_and_come_back_from_files(tmp_path: Path) -> None:
    all_pulls, off_nm = [], []
    for seed in (4,):
        run = recorded(tmp_path / str(seed), seeded(seed))
        result = processed(run)
        assert faults(result) == {}
        assert (result.uv_scale, result.calibration.scale) == ("measured", "relative")
        true = truth(run)
        for name, led in result.leds.items():
            off_nm.append(led.centroid_nm - true[name][0])
            assert abs(off_nm[-1]) < 3 * result.calibration.leds[name].wavelength_sigma_nm
        all_pulls.append(pulls(result, run))
    assert np.sqrt(np.mean(np.square(off_nm))) < 0.3
    # The errors of one camera's curves are common to all LEDs: few degrees of freedom. The exact
    # test of σ is that of the fit, over many cameras.
    assert 0.4 < np.sqrt(np.mean(np.square(all_pulls))) < 1.6

    assert_read_back(result)
    assert result.calibration == LEDS_KIND.read(run)
    exposures = led_sources(part_of(run).rig, "rig", result.calibration)
    assert all(math.isfinite(one.brightness_sigma) for one in exposures.values())
    page = (run / "result" / "report.html").read_text(encoding="utf-8")
    assert "Brightness of the LEDs" in page
    assert "Camera / spectrometer" in page or "camera-and-spectrometer" in page


@pytest.mark.campaign
def test_with_an_absolute_scale_it_is_irradiance(tmp_path: Path) -> None:
    all_pulls, scales = [], []
    for seed in (2,):
        folder = tmp_path / str(seed)
        folder.mkdir()

        def change(rig: Rig, seed: int = seed, folder: Path = folder) -> None:
            rig["simulation"]["seed"] = seed
            calibrated(rig, folder)

        run = recorded(folder, change, leds=SOME)
        result, true = result_of(run), truth(run)
        assert faults(result) == {}
        assert (result.uv_scale, result.calibration.scale) == ("measured", "absolute")
        for name, led in result.leds.items():
            assert led.centroid_nm == pytest.approx(true[name][0], abs=0.3)
        all_pulls.append(pulls(result, run))
        scale = np.mean(
            [
                math.log(led.brightness.value / true[name][1] / 0.05)
                for name, led in result.leds.items()
                if led.brightness is not None
            ]
        )
        scales.append(scale / result.calibration.common_sigma)
        assert all(led.brightness.unit == "W m⁻²" for led in result.leds.values() if led.brightness)
    assert 0.3 < np.sqrt(np.mean(np.square(all_pulls))) < 1.7
    assert np.abs(scales).max() < 3


def test_by_the_camera_alone_the_scale_of_ultraviolet_is_unknown(tmp_path: Path) -> None:
    run = recorded(tmp_path, without_spectrometer, leds=SOME)
    result, true = processed(run), truth(run)
    assert (result.uv_scale, result.calibration.uv_scale) == ("unknown", "unknown")
    assert result.leds["365 nm"].brightness is None
    assert result.calibration.leds["365 nm"].brightness is None
    assert set(faults(result)) == {"uv-unscaled"}
    assert 0.4 < np.sqrt(np.mean(np.square(pulls(result, run)))) < 1.6
    for name, led in result.leds.items():
        sigma_nm = result.calibration.leds[name].wavelength_sigma_nm
        assert abs(led.centroid_nm - true[name][0]) < 2.5 * sigma_nm
    assert result.leds["530 nm"].by_spectrometer is None
    page = (run / "result" / "report.html").read_text(encoding="utf-8")
    assert "uv_scale: unknown" in page


def dark(rig: Rig) -> None:
    rig["simulation"]["leds"][7]["level"] = 1e-12


@pytest.mark.parametrize(
    "change",
    [
        pytest.param(dark, id="spectrometer"),
        pytest.param(without_spectrometer, id="camera", marks=pytest.mark.campaign),
    ],
)
def test_an_led_that_does_not_light_is_left_out(
    change: Callable[[Rig], None], tmp_path: Path
) -> None:
    def both(rig: Rig) -> None:
        dark(rig)
        change(rig)

    result = result_of(recorded(tmp_path, both, leds=LONG))
    assert faults(result) == {"light-unlit": ("590 nm",)}
    assert set(result.calibration.leds) == {"565 nm", "625 nm"}
    assert result.uv_scale == "none"


def stuck(rig: Rig) -> None:
    without_spectrometer(rig)
    rig["simulation"]["faults"] = [{"led_stuck": {"relay": 8}}]


@pytest.mark.campaign
def test_an_led_that_stays_lit_is_left_out_and_its_light_subtracted(tmp_path: Path) -> None:
    found = faults(result_of(recorded(tmp_path, stuck, leds=LONG)))
    assert found["light-stays"] == ("590 nm",)
    assert "590 nm" in found["light-left"]


@pytest.mark.campaign
def test_an_led_that_stays_lit_and_clips_all_frames_is_one_clear_line(tmp_path: Path) -> None:
    run = recorded(tmp_path, stuck, leds=["590 nm"], exposures=3)
    with pytest.raises(DataError, match="an LED stays lit, or another light is on") as caught:
        result_of(run)
    assert "\n" not in str(caught.value)


def test_if_none_lights_there_is_no_result(tmp_path: Path) -> None:
    def all_dark(rig: Rig) -> None:
        for led in rig["simulation"]["leds"]:
            led["level"] = 1e-12

    with pytest.raises(DataError, match="no LED can be used: LED '430 nm' did not light") as caught:
        result_of(recorded(tmp_path, all_dark, leds=["430 nm"]))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "has_spectrometer", [True, pytest.param(False, marks=pytest.mark.campaign)]
)
def test_two_alight_at_once_are_noticed(has_spectrometer: bool, tmp_path: Path) -> None:
    def two(rig: Rig) -> None:
        shine_like(rig, tmp_path, 4, {455.0: 1.0, 590.0: 0.6})
        if not has_spectrometer:
            without_spectrometer(rig)

    result = result_of(recorded(tmp_path, two, leds=[*SHORT, "590 nm"]))
    assert faults(result) == {"two-lights": ("455 nm", "590 nm")}
    assert set(result.calibration.leds) == {"430 nm", "590 nm"}


@pytest.mark.parametrize(
    "has_spectrometer", [True, pytest.param(False, marks=pytest.mark.campaign)]
)
def test_leds_in_another_order_are_noticed(has_spectrometer: bool, tmp_path: Path) -> None:
    def swapped(rig: Rig) -> None:
        shine_like(rig, tmp_path, 7, {590.0: 1.0})
        shine_like(rig, tmp_path, 8, {565.0: 1.0})
        if not has_spectrometer:
            without_spectrometer(rig)

    result = result_of(recorded(tmp_path, swapped, leds=LONG))
    found = {w.values["leds"] for w in result.warnings if w.code == "light-is-another"}
    assert found == {("565 nm", "590 nm"), ("590 nm", "565 nm")}
    # A measured spectrum belongs to its output, whatever that is called.
    assert ("565 nm" in result.leds) == has_spectrometer
    if has_spectrometer:
        assert result.leds["565 nm"].centroid_nm == pytest.approx(591, abs=1)


def test_a_reference_that_fluoresces_is_named(tmp_path: Path) -> None:
    def brightened(rig: Rig) -> None:
        shine_like(rig, tmp_path, 1, {365.0: 1.0, 450.0: 0.1})

    result = result_of(recorded(tmp_path, brightened, leds=["365 nm", *SHORT]))
    assert faults(result) == {"reference-fluoresces": ("365 nm",)}
    (warning,) = result.warnings
    assert warning.values["centre_nm"] == pytest.approx(454, abs=5)
    assert result.uv_scale == "measured"


@pytest.mark.campaign
def test_a_reference_that_fluoresces_is_named_by_the_camera_too(tmp_path: Path) -> None:
    def brightened(rig: Rig) -> None:
        shine_like(rig, tmp_path, 3, {430.0: 1.0, 500.0: 0.3})
        without_spectrometer(rig)

    result = result_of(recorded(tmp_path, brightened, leds=[*SHORT, "530 nm"]))
    assert faults(result)["reference-fluoresces"] == ("430 nm",)
    assert result.leds["430 nm"].brightness is None
    assert result.leds["455 nm"].brightness is not None


@pytest.mark.campaign
def test_light_of_the_room_is_subtracted_and_said(tmp_path: Path) -> None:
    def leaking(rig: Rig) -> None:
        rig["simulation"]["faults"] = [{"ambient_light": {"at": "2 min", "level": "0.01 %"}}]

    run = recorded(tmp_path, leaking, leds=LONG)
    result = result_of(run)
    assert "light-left" in faults(result)
    assert np.abs(pulls(result, run)).max() < 3


@pytest.mark.campaign
def test_what_clips_at_the_shortest_exposure_is_left_to_the_spectrometer(tmp_path: Path) -> None:
    def bright(rig: Rig) -> None:
        rig["simulation"]["leds"][4]["level"] = "100 %"
        rig["simulation"]["lamp"] = {"irradiance": 100.0}

    run = recorded(tmp_path, bright, leds=["490 nm", *LONG], camera={"iso": 1600})
    result = result_of(run)
    assert faults(result) == {"light-clipped": ("490 nm",)}
    assert result.leds["490 nm"].brightness is not None
    assert result.leds["490 nm"].by_camera is None


@pytest.mark.campaign
def test_drift_is_reported_and_in_sigma(tmp_path: Path) -> None:
    def warming(rig: Rig) -> None:
        for led in rig["simulation"]["leds"]:
            led |= {"warm_up": "5 min", "droop": "90 %"}

    run = recorded(tmp_path, warming, leds=LONG)
    result, first = result_of(run), part_of(run).protocol.shuffled()[0]
    assert result.drift is not None
    assert faults(result)["lamp-drifts"] == (first,)
    assert result.drift.value < -0.02
    for led in result.leds.values():
        assert led.brightness is not None
        assert led.brightness.sigma / led.brightness.value > -result.drift.value / math.sqrt(12)


@pytest.mark.campaign
def test_an_unfinished_run_keeps_what_is_measured(tmp_path: Path) -> None:
    run = recorded(tmp_path, leds=LONG)
    journal = run / "journal.jsonl"
    lines = journal.read_text(encoding="utf-8").splitlines(keepends=True)
    last = next(n for n, line in enumerate(lines) if '"unit": "again' in line)
    previous = [n for n, line in enumerate(lines[:last]) if '"unit": "card' in line][-1]
    journal.write_text("".join(lines[: previous + 3]), encoding="utf-8")
    result = result_of(run)
    assert "led-not-measured" in faults(result)
    assert len(result.leds) == 2
    assert result.drift is None


def changed_curves(folder: Path, change: Callable[[list[float]], None]) -> str:
    """Path of the shipped camera's curves, each row R, G, B changed."""
    path = resources.folder("config/optics/cameras") / "canon_eos_5d_mark_ii.json"
    curves = json.loads(path.read_text(encoding="utf-8"))
    for row in curves["spectral_data"]["data"]["main"].values():
        change(row)
    changed = folder / "changed.json"
    changed.write_text(json.dumps(curves))
    return str(changed)


@pytest.mark.campaign
def test_a_channel_that_sees_nothing_is_left_out(tmp_path: Path) -> None:
    """A filter before the lens, or another order of channels in the curves' file."""

    def blind(row: list[float]) -> None:
        row[0] = 1e-9

    def red_blind(rig: Rig) -> None:
        rig["simulation"]["sensor"]["curves"] = changed_curves(tmp_path, blind)

    run = recorded(tmp_path, red_blind, leds=[*SHORT, "530 nm"])
    result = result_of(run)
    assert set(faults(result)) == {"channel-unseen"}
    assert result.warnings[0].values["channels"] == ("R",)
    assert result.channels == ("G", "B")
    assert result.leds["530 nm"].by_camera is not None


@pytest.mark.campaign
def test_curves_of_another_camera_disagree_with_a_calibrated_spectrometer(tmp_path: Path) -> None:
    def dim(row: list[float]) -> None:
        row[2] *= 0.3

    def other_camera(rig: Rig) -> None:
        rig["optics"]["camera"] = changed_curves(tmp_path, dim)
        calibrated(rig, tmp_path)

    result = result_of(recorded(tmp_path, other_camera, leds=[*SHORT, *LONG]))
    assert set(faults(result)) == {"camera-disagrees"}


def test_a_bench_without_a_card_is_one_line(tmp_path: Path) -> None:
    part = part_of(recorded(tmp_path, leds=LONG))
    optics = part.rig.optics.model_copy(update={"grey_card": None})
    with pytest.raises(UsageError, match="does not say which grey card it has"):
        analyse(replace(part, rig=part.rig.model_copy(update={"optics": optics})))
