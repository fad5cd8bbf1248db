"""Albedo and total radiance factor of samples in the simulated room, and what becomes of them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from labrig.analyse import Inputs
from labrig.analyse.surface import with_reflectance, with_reflectances
from labrig.calibration import LVF_KIND, REFLECTANCE_KIND
from labrig.foundation.errors import DataError, UsageError
from labrig.material import Albedo, read_material, write_material
from labrig.optics import Strip
from labrig.protocols.reflectance.analysis import analyse
from labrig.protocols.reflectance.result import ReflectanceResult
from labrig.report import describe_phosphor, draw_phosphor
from labrig.results import write_result
from tests.acceptance.reflectance_pulls import (
    BLUE,
    JUDGED,
    card_file,
    coloured,
    true_albedo,
)
from tests.analyse.recorded import part_of, record
from tests.analyse.spectral_bench import true_lvf_file
from tests.results.made import assert_read_back
from tests.warned import of_code

WIDTH, HEIGHT = 160, 64
PATCHES = {"plain": [0.03, 0.1, 0.94, 0.39], "prompt": [0.03, 0.51, 0.94, 0.39]}


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two paints of one albedo, one of which fluoresces, below one filter."""
    folder = tmp_path_factory.mktemp("reflectance")
    on_sample = Strip(left=(0.08, 0.5), right=(0.92, 0.5), height=0.25, rising=False)
    calibrated = true_lvf_file(WIDTH, HEIGHT).model_copy(update={"on_sample": on_sample})
    LVF_KIND.write(folder, calibrated)
    write_material(folder / "sample.yaml", coloured(BLUE))
    (folder / "card.csv").write_text(card_file(np.random.default_rng(3)))

    def change(rig: dict[str, Any]) -> None:
        rig["optics"] |= {"lvf": str(folder / "lvf.yaml"), "grey_card": str(folder / "card.csv")}
        rig["simulation"]["sensor"] = {"width": WIDTH, "height": HEIGHT}
        rig["simulation"]["sample"] = [
            {"material": str(folder / "sample.yaml"), "region": region, "prompt": prompt}
            for region, prompt in zip(PATCHES.values(), (0.0, 0.2), strict=True)
        ]

    protocol = {"protocol": "reflectance", "patches": PATCHES, "longest": "4 s", "repeats": 1,
                "charge": "5 min"}  # fmt: skip
    return record(folder, protocol, change)


@pytest.fixture(scope="module")
def result(run: Path) -> ReflectanceResult:
    return analyse(part_of(run))


def test_the_albedo_is_the_rooms(result: ReflectanceResult) -> None:
    patch, expected = result.patches["plain"], true_albedo(BLUE)
    error = (patch.albedo - expected)[JUDGED]
    assert np.abs(error).max() < 0.02
    assert np.abs(error / patch.albedo_sigma[JUDGED]).max() < 3
    # σ is of the card and the lamp where a place is bright, and not much more anywhere.
    assert 0.005 < float(np.median((patch.albedo_sigma / patch.albedo)[JUDGED])) < 0.02
    assert "plain" not in [warning.subject for warning in result.warnings]


def test_prompt_fluorescence_is_in_the_radiance_factor_and_not_in_the_albedo(
    result: ReflectanceResult,
) -> None:
    patch, expected = result.patches["prompt"], true_albedo(BLUE)
    error = (patch.albedo - expected)[JUDGED]
    assert np.abs(error).max() < 0.025
    assert np.abs(error / patch.albedo_sigma[JUDGED]).max() < 3.5
    at_460 = int(np.argmin(abs(patch.wavelength_nm - 460)))
    assert patch.radiance_factor[at_460] - expected[at_460] > 0.03
    assert patch.luminescence.value > 10
    assert of_code(result.warnings, "prompt-fluorescence").subject == "prompt"
    red = patch.wavelength_nm > 600
    np.testing.assert_allclose(patch.excess[red], 0, atol=0.01)


def test_the_glow_over_the_reflected_light_is_that_of_the_paint(result: ReflectanceResult) -> None:
    """The steady glow is the same in both patches, though one of them fluoresces."""
    plain, prompt = (result.patches[name].glow for name in ("plain", "prompt"))
    assert float(plain.max()) > 0.001
    np.testing.assert_allclose(prompt.sum(), plain.sum(), rtol=0.08)


def test_the_result_is_read_back_and_makes_a_material(
    result: ReflectanceResult, tmp_path: Path
) -> None:
    assert_read_back(result)
    write_result(tmp_path, result)
    file = REFLECTANCE_KIND.read(tmp_path / "reflectance.yaml")
    assert file == result.calibration
    header, first, *_ = (tmp_path / "reflectance.csv").read_text().splitlines()
    assert header.startswith("patch,wavelength_nm,albedo,albedo_sigma")
    assert first.startswith("plain,400,")
    paint = read_material("blue-paint")
    both = with_reflectances(
        {"plain": paint, "other": paint}, Inputs().updated_by(result)[REFLECTANCE_KIND]
    )
    material = both["plain"]
    assert both["other"].albedo is None
    assert material.albedo is not None
    assert material.radiance_factor is not None
    assert material.albedo.value == file.patches["plain"].albedo
    assert material.radiance_factor.lamp == file.lamp
    assert with_reflectance(paint, "plain", None) is paint
    write_material(tmp_path / "material.yaml", material)
    assert read_material(tmp_path / "material.yaml") == material
    text = describe_phosphor(material)
    assert "albedo" in text
    assert "radiance factor under" in text
    draw_phosphor(material, tmp_path / "material.svg")


def test_what_is_missing_is_one_clear_line(run: Path) -> None:
    part = part_of(run)
    lvf = part.inputs[LVF_KIND]
    assert lvf is not None
    without = lvf.model_copy(update={"on_sample": None})
    with pytest.raises(UsageError, match="no LVF is known before the camera and on the sample"):
        analyse(part_of(run, Inputs({"lvf": without})))
    (run / "frames" / "gone").mkdir()
    frame = next(iter(part.run.frames("reflectance-sample-white"))).path
    kept = frame.read_bytes()
    try:
        frame.unlink()
        with pytest.raises(DataError) as caught:
            analyse(part)
    finally:
        frame.write_bytes(kept)
    assert "\n" not in str(caught.value)


def test_an_albedo_on_one_wavelength_is_refused() -> None:
    with pytest.raises(ValueError, match="at least 2"):
        Albedo(wavelength_nm=(400.0,), value=(0.1,))
