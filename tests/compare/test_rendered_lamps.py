"""`labrig reproduce --rendered` of fluorescent samples under the lamps of the simulated bench."""

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from labrig.analyse import Overrides
from labrig.compare import LampsComparison, compare_lamps
from labrig.material import read_any_material
from labrig.optics import Spectrum, read_camera
from labrig.process import process_and_report
from labrig.protocols.validate_illuminants.result import ValidateIlluminantsResult
from labrig.reproduce import Renderer, load_scene
from labrig.results import read_result
from tests.analyse.led_bench import QUICK, SAMPLES, record
from tests.conftest import Ended
from tests.quick_yaml import read_quickly, write_quickly

Labrig = Callable[..., Ended]
CAMERA = read_camera("canon_eos_5d_mark_ii")


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Samples under a lamp that is not quite its file, a narrow one, and one that is not seen."""

    def with_blue(rig: dict[str, Any]) -> None:
        lamps = rig["devices"]["illuminants"]["channels"]
        of_black_light = rig["simulation"]["illuminants"][3]
        lamps["blue"] = lamps["ultraviolet"] | {"relay": 1, "centre": 450, "fwhm": 20}
        rig["simulation"]["illuminants"][1] = of_black_light | {
            "relay": 1, "centre": 451.0, "fwhm": 22
        }  # fmt: skip
        lamps.pop("halogen")

    protocol: dict[str, Any] = {
        "protocol": "validate_illuminants",
        "patches": QUICK["patches"],
        "fluorescence": SAMPLES,
        "lamps": ["daylight", "blue", "ultraviolet"],
        "longest": "2 s",
        "repeats": 1,
    }
    folder = record(tmp_path_factory.mktemp("lamps"), protocol, with_blue)
    process_and_report(folder)
    return folder


@pytest.fixture(scope="module")
def compared(run: Path) -> LampsComparison:
    return compare_lamps(run)


def test_renderings_are_the_photographs_within_their_errors(compared: LampsComparison) -> None:
    daylight, _, ultraviolet = compared.lamps
    assert [lamp.reference for lamp in compared.lamps] == ["card", "card", "brightest"]
    for lamp in compared.lamps:
        for sample in lamp.samples.values():
            assert (np.abs(sample.in_sigma) < 3).all()
            assert sample.delta_e < 3 * sample.delta_e_by_errors
        for name in ("yellow", "orange"):
            assert lamp.samples[name].delta_e_reflected > 10
    # The card reflects 18 %; grey felt a fifth more.
    np.testing.assert_allclose(daylight.samples["felt"].photographed, 1.25, rtol=0.05)
    assert max(sample.rendered.max() for sample in ultraviolet.samples.values()) == 1


def seen_share(name: str, light: Spectrum) -> np.ndarray:
    """Share of the camera's values that is re-radiated, without bands and paths (k,)."""
    light_seen = read_any_material(SAMPLES[name]).under(light)  # type: ignore[union-attr]
    parts = [
        CAMERA.response(part.at(CAMERA.wavelength_nm))
        for part in (light_seen.reradiated, light_seen.reflected)
    ]
    return np.asarray(parts[0] / (parts[0] + parts[1]))


def test_the_share_that_is_reradiated_is_that_of_the_matrix(
    run: Path, compared: LampsComparison
) -> None:
    daylight, _, ultraviolet = compared.lamps
    result = read_result(run)
    assert isinstance(result, ValidateIlluminantsResult)
    light = result.lamps["daylight"].light("daylight")
    for name, sample in daylight.samples.items():
        np.testing.assert_allclose(sample.reradiated, seen_share(name, light), atol=0.01)
    assert daylight.samples["felt"].reradiated_luminance == 0
    assert 0.5 < daylight.samples["orange"].reradiated_luminance < 0.7
    assert ultraviolet.samples["yellow"].reradiated_luminance > 0.98


def test_sigma_is_that_of_photograph_and_prediction(run: Path, compared: LampsComparison) -> None:
    result = read_result(run)
    assert isinstance(result, ValidateIlluminantsResult)
    patch = result.lamps["daylight"].patches["orange"]
    sample = compared.lamps[0].samples["orange"]
    np.testing.assert_allclose(sample.photographed_sigma, patch.sigma / patch.card)
    np.testing.assert_allclose(sample.rendered_sigma, patch.predicted_sigma / patch.card)
    off = patch.value - sample.rendered * patch.card
    together = np.sqrt(patch.sigma**2 + patch.predicted_sigma**2)
    np.testing.assert_allclose(sample.in_sigma, -off / together)


def test_it_is_printed_for_programs_and_the_report_shows_it_while_it_is_of_its_result(
    labrig: Labrig, run: Path
) -> None:
    report = run / "result" / "report.html"
    ended = labrig("reproduce", run, "--rendered", "--json")
    assert (ended.code, ended.err) == (0, "")
    lamps = json.loads(ended.out)["rendered"]["lamps"]
    assert list(lamps) == ["daylight", "blue", "ultraviolet"]
    assert "photographed and rendered" not in report.read_text()
    ended = labrig("reproduce", run, "--rendered")
    assert (ended.code, ended.err) == (0, "")
    assert "photographed and rendered" in report.read_text()
    assert "labrig reproduce" in report.read_text()
    again = process_and_report(run)
    assert again.changes == ("the same result as before",)
    assert "photographed and rendered" in report.read_text()
    protocol = read_quickly((run / "protocol.yaml").read_text())
    (run / "protocol.yaml").write_text(
        write_quickly(protocol | {"fluorescence": SAMPLES | {"felt": "white-paper"}})
    )
    process_and_report(run, Overrides(edited=True))
    assert "photographed and rendered" not in report.read_text()
    assert "is of another result" in report.read_text()
    felt = compare_lamps(run).lamps[0].samples["felt"]
    assert (felt.in_sigma > 10).all()
    rows = list(csv.DictReader((run / "comparison" / "rendered.csv").read_text().splitlines()))
    assert len(rows) == 3 * len(SAMPLES) * 3
    for row in rows:
        said = lamps[row["lamp"]]["samples"][row["sample"]]
        number = "RGB".index(row["channel"])
        assert float(row["rendered"]) == pytest.approx(said["rendered"][number], rel=1e-5)
    scene = load_scene(run / "comparison" / "dark-room.yaml")
    renderer = Renderer(scene.resized(width_px=30, height_px=20), threads=1)
    lit = [float(frame.radiance.sum()) for frame in renderer.frames()]
    assert len(lit) == 3
    assert min(lit) > 0


@pytest.mark.parametrize(
    ("protocol", "options", "said"),
    [
        ("led_fluorescence", ["--rendered"], "labrig run validate_illuminants"),
        ("direct_bispectral", [], "labrig run validate_illuminants"),
        ("validate_illuminants", [], "--rendered"),
        ("validate_illuminants", ["--rendered"], "labrig process"),
        ("validate_illuminants", ["--rendered", "--material", "grey-felt"], "fluorescence:"),
        ("validate_illuminants", ["--rendered", "--assume-albedo", "0.5"], "with a decay"),
    ],
)
def test_what_cannot_be_compared_is_one_clear_line(
    labrig: Labrig, tmp_path: Path, protocol: str, options: list[str], said: str
) -> None:
    (tmp_path / "protocol.yaml").write_text(f"protocol: {protocol}\n")
    ended = labrig("reproduce", tmp_path, *options)
    assert (ended.code, len(ended.err.splitlines())) == (2, 1)
    assert said in ended.err
