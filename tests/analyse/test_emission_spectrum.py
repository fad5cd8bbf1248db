"""The emission spectrum of a simulated sample against the truth, and what it must not miss."""

import json
import struct
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile

from labrig.analyse import Overrides
from labrig.analyse.combined_frames import combined, compared, differ, over_time, visible
from labrig.analyse.forward_model import forward_models
from labrig.analyse.inputs import Inputs
from labrig.analyse.place_reduction import reduce_places
from labrig.fit.spectrum import SpectrumFit, fit_spectrum, system_through_lvf
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError, UsageError
from labrig.foundation.region import region_pixels
from labrig.optics import Spectrum
from labrig.protocols.emission_spectrum.analysis import analyse
from labrig.protocols.emission_spectrum.report import render
from labrig.protocols.emission_spectrum.result import EmissionSpectrumResult
from labrig.record import read_run
from labrig.reduce import SeriesFrame
from labrig.report import figure_style
from labrig.results import FilterFrames
from labrig.results.emission_spectrum import (
    WAVELENGTH_NM,
    EmissionSpectrum,
    read_emission_spectrum,
    write_emission_spectrum,
)
from tests.analyse.recorded import part_of, source_of
from tests.analyse.small_runs import EMISSION
from tests.analyse.spectral_bench import HEIGHT, WIDTH, emitted, record
from tests.fit import lvf_pictures as made
from tests.quick_yaml import read_quickly, write_quickly
from tests.warned import codes, of_code


def analysed(run: Path, excluded: frozenset[str] = frozenset()) -> EmissionSpectrumResult:
    return analyse(replace(part_of(run), overrides=Overrides(excluded=excluded)))


def on_the_grid(fit: SpectrumFit) -> EmissionSpectrum:
    return EmissionSpectrum.from_draws(
        fit.knots_nm, fit.value, fit.samples, sample="light", lamp="halogen", run="run"
    )


def error(spectrum: EmissionSpectrum, material: str) -> tuple[FloatArray, FloatArray]:
    """Found less true, of one integral; and in σ."""
    value = np.array(spectrum.value)
    difference = value - emitted(material) * value.sum()
    return difference, difference / np.array(spectrum.sigma)


def two_colours(path: Path) -> Path:
    """A fast state that glows in the blue and a slow one in the green."""
    content = {
        "name": "two-colours", "kind": "phosphor",
        "bands_nm": [400.0, 437.5, 475.0, 512.5, 550.0, 587.5, 625.0, 662.5, 700.0],
        "irradiance_norm": {"kind": "vector_length", "value": 1.0},
        "states": [
            {"k_r_per_s": k, "k_e_per_s": [k, k, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
             "reradiation": [fraction / k for fraction in fractions]}
            for k, fractions in (
                (0.08, (0.0, 1.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0)),
                (0.01, (0.0, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0, 0.0)),
            )
        ],
    }  # fmt: skip
    path.write_text(write_quickly(content), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def blue(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Blue paint, charged by both lamps."""
    return record(tmp_path_factory.mktemp("blue"), EMISSION | {"lamps": ["halogen", "mercury"]})


@pytest.fixture(scope="module")
def found(blue: Path) -> EmissionSpectrumResult:
    return analysed(blue)


def test_the_spectrum_is_the_samples(found: EmissionSpectrumResult) -> None:
    (patch,) = found.patches.values()
    difference, in_sigma = error(patch.spectrum, "blue-paint")
    assert max(patch.spectrum.value) == 1
    assert np.sqrt(np.mean(difference**2)) < 0.025
    assert np.abs(in_sigma).max() < 4
    assert np.mean(np.abs(in_sigma) < 2) > 0.8
    assert found.warnings == ()
    assert [charge.lamp for charge in patch.charges] == ["halogen", "mercury"]
    assert len(patch.times) == len(patch.at_times) == len(patch.charges[0].frames) == 2
    assert not patch.changes_with_time
    assert [one.what for one in patch.lamps] == ["mercury against halogen"]
    assert not patch.depends_on_lamp
    assert patch.white_reference
    true_nm = WAVELENGTH_NM @ emitted("blue-paint")
    assert abs(patch.spectrum.centroid.value - true_nm) < 3 * patch.spectrum.centroid.sigma


def test_a_result_and_its_files_are_read_back(
    found: EmissionSpectrumResult, tmp_path: Path
) -> None:
    (before,) = found.patches.values()
    first = before.charges[0]
    clipped = np.array(first.frames.sigma_dn_per_s)
    clipped[0, :2] = np.nan, np.inf
    frames = replace(first.frames, sigma_dn_per_s=clipped)
    patch = replace(before, charges=(replace(first, frames=frames), *before.charges[1:]))
    result = replace(found, patches={"": patch})
    again = EmissionSpectrumResult.from_dict(json.loads(result.to_json()))
    assert again.to_json() == result.to_json()
    (after,) = again.patches.values()
    assert after.spectrum == before.spectrum
    assert after.times == before.times
    np.testing.assert_array_equal(after.charges[0].frames.sigma_dn_per_s, clipped)
    assert found.provides() == {"spectra": {"": before.spectrum}}
    found.write_files(tmp_path)
    assert read_emission_spectrum(tmp_path / "emission.yaml") == before.spectrum
    table = found.csv_tables()["spectrum.csv"]
    assert [float(row[0]) for row in table.rows] == WAVELENGTH_NM.tolist()


def test_a_report_shows_all_comparisons(blue: Path, found: EmissionSpectrumResult) -> None:
    part = part_of(blue)
    with figure_style():
        shown = render(found, source_of(part))
    assert {figure.name for section in shown.sections for figure in section.figures} == {
        "spectrum", "over-time", "shift", "lamps",
    }  # fmt: skip
    assert "over time: the same" in shown.lines[1]
    assert "mercury against halogen: the same" in shown.lines[2]


def test_without_a_calibrated_lvf_there_is_no_spectrum(blue: Path) -> None:
    with pytest.raises(UsageError, match=r"lvf_calibration.*optics"):
        analyse(replace(part_of(blue), inputs=Inputs()))


def test_damaged_frames_are_named(blue: Path) -> None:
    frame = read_run(blue).frames("spectrum")[1].path
    content = frame.read_bytes()
    frame.write_bytes(content[:-1] + bytes([content[-1] ^ 1]))
    try:
        with pytest.raises(DataError, match=f"{frame.name} was changed after the run"):
            analysed(blue)
    finally:
        frame.write_bytes(content)


def test_states_of_different_colours_are_reported(tmp_path: Path) -> None:
    material = two_colours(tmp_path / "two-colours.yaml")
    run = record(tmp_path, EMISSION | {"white": False}, sample=str(material))
    found = analysed(run)
    assert found.patches[""].changes_with_time
    assert "spectrum-changes" in codes(found.warnings)


@pytest.mark.campaign
def test_a_mercury_lamp_that_did_not_light_is_reported(tmp_path: Path) -> None:
    keys = EMISSION | {"lamps": ["halogen", "mercury"], "white": False, "times": ["2 s", "12 s"]}
    run = record(tmp_path, keys, faults=["mercury_dead"])
    found = analysed(run)
    assert {"lamp-unlit", "lamp-excites-nothing"} & set(codes(found.warnings))


@pytest.mark.campaign
def test_lines_narrower_than_the_band_are_reported(tmp_path: Path) -> None:
    content = read_quickly(two_colours(tmp_path / "lines.yaml").read_text())
    content["states"] = content["states"][1:]
    content["spectrum"] = {
        "wavelength_nm": [380.0, 541.0, 545.0, 549.0, 720.0], "value": [0.0, 0.0, 1.0, 0.0, 0.0],
    }  # fmt: skip
    (tmp_path / "lines.yaml").write_text(write_quickly(content))
    keys = EMISSION | {"white": False, "times": ["2 s"]}
    found = analysed(record(tmp_path, keys, sample=str(tmp_path / "lines.yaml")))
    assert of_code(found.warnings, "narrow-lines").values["places_nm"] == ("540 to 550",)
    spectrum = found.patches[""].spectrum
    value, covariance = np.array(spectrum.value), np.array(spectrum.covariance)
    near = np.abs(WAVELENGTH_NM - 545) < 30
    apart = np.sqrt(np.diag(covariance)[near].sum())
    assert np.sqrt(covariance[np.ix_(near, near)].sum()) < 0.3 * apart
    assert value[near].sum() > 0.95 * value.sum()


def test_a_white_picture_mends_curves_that_are_a_few_per_cent_off(tmp_path: Path) -> None:
    """Slow waves: 8 % in all channels, as a reference makes them, and 0.5 % in each."""
    ours = made.of_the_house()
    turns = 2 * np.pi * ours.wavelength_nm[:, np.newaxis]
    waves = 0.08 * np.sin(turns / 150) + 0.005 * np.sin(turns / np.array([170.0, 210.0, 130.0]))
    theirs = ours.sensitivity * (1 + waves)
    table = {f"{nm:g}": row for nm, row in zip(ours.wavelength_nm, theirs.tolist(), strict=True)}
    path = tmp_path / "curves.json"
    path.write_text(json.dumps({"spectral_data": {"data": {"main": table}}}))
    assert_mended_by_a_white_picture(tmp_path, path)


def test_a_white_picture_mends_the_curves_of_another_laboratory(
    shared_data: Path, tmp_path: Path
) -> None:
    folder = shared_data / "camera_sensitivity/ampas_rawtoaces_2017"
    assert_mended_by_a_white_picture(tmp_path, folder / "canon_eos_5d_mark_ii_380_780_5.json")


def assert_mended_by_a_white_picture(tmp_path: Path, curves: Path) -> None:
    keys = EMISSION | {"times": ["2 s"]}
    run = record(tmp_path, keys, sensor={"width": 96, "height": 64, "curves": str(curves)})
    white = frozenset(frame.path.name for frame in read_run(run).frames("white"))
    errors = []
    for excluded in (frozenset[str](), white):
        spectrum = analysed(run, excluded).patches[""].spectrum
        difference, in_sigma = error(spectrum, "blue-paint")
        assert np.sqrt(np.mean(in_sigma**2)) < 1.5
        errors.append(float(np.sqrt(np.mean(difference**2))))
    assert errors[0] < 0.02
    assert errors[0] < errors[1]


@pytest.mark.campaign
def test_what_is_narrower_than_the_band_comes_out_in_its_place() -> None:
    light = made.lines({532.0: 30.0}, 1e-6)
    lvf, camera = made.curved_lvf(), made.of_the_house()
    picture = made.photographed(light, lvf, camera, np.random.default_rng(0))
    fit = fit_spectrum(picture.value, picture.sigma, system_through_lvf(lvf, camera, made.KNOTS_NM))
    value = np.array(on_the_grid(fit).value)
    assert WAVELENGTH_NM[np.argmax(value)] == 530
    assert np.count_nonzero(value > 0.5) <= 3


def monochrome_dng(path: Path, counts: FloatArray) -> SeriesFrame:
    """A frame of two seconds at ISO 100 without colour filters, its black at 1000."""
    mosaic = np.random.default_rng(len(path.name)).poisson(counts) + 1000
    about: list[tuple[int, str, int, Any, bool]] = [
        (50706, "B", 4, bytes([1, 4, 0, 0]), True),
        (50708, "s", 0, "test mono", True),
    ]
    about += [(50717, "H", 1, 60000, True), (50713, "H", 2, (1, 1), True)]
    about += [(50714, "2I", 1, (1000, 1), True)]
    with tifffile.TiffWriter(path) as writer:
        writer.write(mosaic.astype(np.uint16), photometric="minisblack", extratags=about,
                     metadata=None, software=False)  # fmt: skip
    # tifffile knows LinearRaw (34892) as three colours only.
    as_gray, as_raw = (struct.pack("<HHIHH", 262, 3, 1, kind, 0) for kind in (1, 34892))
    path.write_bytes(path.read_bytes().replace(as_gray, as_raw))
    return SeriesFrame(path, 1.0, 2.0, 100, unit="spectrum")


def test_a_monochrome_camera_will_do(blue: Path, tmp_path: Path) -> None:
    curve = tmp_path / "mono.csv"
    sensitivity = np.column_stack([[350, 400, 500, 600, 700, 800], [0.2, 0.5, 1, 0.9, 0.6, 0.3]])
    np.savetxt(curve, sensitivity, delimiter=",", header="wavelength_nm,L", comments="")
    part = replace(part_of(blue), overrides=Overrides(camera=str(curve)))
    light = Spectrum("green", np.arange(380.0, 721.0, 5.0),
                     np.exp(-(((np.arange(380.0, 721.0, 5.0) - 530) / 35) ** 2)))  # fmt: skip
    dark = np.full((HEIGHT, 10 * WIDTH), 4.0)
    darks = [monochrome_dng(tmp_path / f"dark{number}.dng", dark) for number in range(2)]
    (model,) = forward_models(part, darks[0])[0].values()
    expected = model.expected_of(light)
    scene = dark.copy()
    for region, value in zip(model.slices.values(), expected / expected.max(), strict=True):
        x, y, width, height = region_pixels(region, 10 * WIDTH, HEIGHT)
        scene[y : y + height, x : x + width] += 8000 * value
    frames = [
        monochrome_dng(tmp_path / f"glow{'-' * number}.dng", scene / (1 + number))
        for number in range(2)
    ]
    (reduction,) = reduce_places(frames, darks, {"": model.slices}, None).values()
    seen = combined(reduction.of_unit("spectrum"))
    fit = fit_spectrum(seen.value, seen.sigma, model.system)
    value = np.array(on_the_grid(fit).value)
    true = light.in_bands(made.EDGES_NM)
    assert model.camera.channels == ("L",)
    assert value / value.sum() == pytest.approx(true / true.sum(), abs=0.01)


def test_bands_of_a_spectrum_carry_its_covariance(found: EmissionSpectrumResult) -> None:
    spectrum = found.patches[""].spectrum
    edges = np.arange(400.0, 701.0, 37.5)
    value, covariance = spectrum.in_bands(edges)
    draws = np.random.default_rng(0).multivariate_normal(
        spectrum.value, np.array(spectrum.covariance), 400
    )
    scattered = [
        spectrum.model_copy(update={"value": tuple(draw)}).in_bands(edges)[0][1] for draw in draws
    ]
    assert value[1] == pytest.approx(np.mean(scattered), abs=0.005)
    assert np.sqrt(covariance[1, 1]) == pytest.approx(np.std(scattered), rel=0.15)


def test_bands_that_cut_through_the_grid_are_those_of_the_spectrum(
    found: EmissionSpectrumResult,
) -> None:
    """Steep flanks, of which straight lines through means over 10 nm make too much."""
    fine = np.arange(395.0, 705.0, 0.1) + 0.05
    steep = np.exp(-(((fine - 460) / 20) ** 2))
    grid = steep.reshape(31, -1).mean(axis=1)
    spectrum = found.patches[""].spectrum.model_copy(update={"value": tuple(grid.tolist())})
    edges = np.arange(400.0, 701.0, 37.5)
    value, _ = spectrum.in_bands(edges)
    true = [steep[(fine > a) & (fine < b)].mean() for a, b in pairwise(edges)]
    np.testing.assert_allclose(value, true, atol=1e-3)


def test_a_malformed_file_is_refused_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "emission.yaml"
    ones = (1.0, 1.0)
    write_emission_spectrum(
        path,
        EmissionSpectrum(
            sample="x", wavelength_nm=(400.0, 410.0), value=ones, sigma=ones, low=ones,
            high=ones, covariance=(ones, ones),
        ),
    )  # fmt: skip
    path.write_text(path.read_text().replace("- 410.0", "- 390.0"))
    with pytest.raises(UsageError, match="rising wavelengths"):
        read_emission_spectrum(path)


def glow(seed: int, brightness: FloatArray, shape: FloatArray, snr: float = 200.0) -> FilterFrames:
    """Frames of one shape and several brightnesses with photon noise."""
    rng = np.random.default_rng(seed)
    true = np.outer(brightness, shape)
    sigma = np.sqrt(true * shape.max() + 1e-4) / snr
    value = true + sigma * rng.standard_normal(true.shape)
    return FilterFrames(np.arange(1.0, 1 + len(true)), value, sigma, np.zeros_like(true))


POSITIONS_NM = np.repeat(np.linspace(395.0, 705.0, 31), 3)
SHAPE = np.exp(-(((POSITIONS_NM - 500) / 40) ** 2))


def test_what_only_gets_darker_is_seldom_said_to_change() -> None:
    p_values = []
    for seed in range(100):
        frames = glow(seed, np.array([1.0, 0.4, 0.1]), SHAPE)
        p_values += [one.p_value for one in over_time(frames, POSITIONS_NM)]
    low, middle, high = np.quantile(p_values, [0.1, 0.5, 0.9])
    assert low == pytest.approx(0.1, abs=0.05)
    assert middle == pytest.approx(0.5, abs=0.1)
    assert high == pytest.approx(0.9, abs=0.05)


def test_a_sensor_that_has_warmed_is_no_change_of_colour() -> None:
    frames = glow(4, np.array([1.0, 0.4, 0.1]), SHAPE)
    offset = np.array([[0.0], [1e-4], [2e-4]])
    assert offset.max() > 3 * frames.sigma_dn_per_s.min()
    warmed = replace(frames, value_dn_per_s=frames.value_dn_per_s + offset)
    assert not differ(over_time(warmed, POSITIONS_NM))


def test_a_shift_by_a_nanometre_is_found_and_measured() -> None:
    moved = np.exp(-(((POSITIONS_NM - 501) / 40) ** 2))
    before = combined(glow(0, np.array([1.0, 0.5]), SHAPE))
    found = compared("later", glow(1, np.array([0.3]), moved), before, POSITIONS_NM)
    assert differ([found])
    assert abs(found.shift_nm - 1.0) < 4 * found.shift_nm_sigma
    assert found.brightness == pytest.approx(0.3, rel=0.02)
    assert found.beyond_noise == pytest.approx(0.025, rel=0.5)


def test_clipped_places_are_taken_from_the_frames_that_do_not_clip() -> None:
    frames = glow(2, np.array([1.0, 0.2]), SHAPE)
    frames.value_dn_per_s[0, SHAPE > 0.5] = np.nan
    frames.value_dn_per_s[:, 0] = np.nan
    sigma = np.where(np.isnan(frames.value_dn_per_s), np.nan, frames.sigma_dn_per_s)
    together = combined(replace(frames, sigma_dn_per_s=sigma))
    assert np.isnan(together.value[0])
    assert np.isfinite(together.value[1:]).all()
    assert together.value[SHAPE > 0.5] == pytest.approx(SHAPE[SHAPE > 0.5], rel=0.1)


def test_darkness_is_no_spectrum() -> None:
    lit = glow(3, np.array([1.0, 1.0]), SHAPE)
    noise = lit.sigma_dn_per_s * np.random.default_rng(3).standard_normal(lit.value_dn_per_s.shape)
    for value in (noise, noise - 0.1):
        with pytest.raises(DataError, match="none above the noise"):
            visible(replace(lit, value_dn_per_s=value))
