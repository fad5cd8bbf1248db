"""A chain over two paints below one filter: a material of each, its own and not the other's."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

from labrig.acquire import read_protocol, read_rig_file
from labrig.analyse import Overrides
from labrig.analyse.inputs import AnalysisContext, Inputs
from labrig.analyse.strip import StripPatch, for_each_patch, slice_strip, tilt_offset
from labrig.calibration import IRRADIANCE_KIND, LVF_KIND
from labrig.compare.run import read_patches
from labrig.foundation.errors import DataError, FitError, UsageError
from labrig.foundation.region import Region
from labrig.foundation.result_warning import Misfit, ResultWarning
from labrig.material import read_material
from labrig.optics import Strip
from labrig.process import Processed, process_and_report
from labrig.protocols.emission_spectrum.analysis import analyse as analyse_spectra
from labrig.record import read_run
from labrig.reduce import SensorLayout
from labrig.results import read_fitted_decays
from labrig.results.emission_spectrum import read_emission_spectrum
from tests.analyse.excitation.bench import QUICK, true_irradiance
from tests.analyse.recorded import record
from tests.analyse.spectral_bench import emitted, true_lvf_file
from tests.quick_yaml import write_quickly
from tests.warned import of_code

WIDTH, HEIGHT = 192, 64
PAINTS: dict[str, Region] = {
    "blue-paint": (0.03, 0.1, 0.94, 0.4),
    "orange-paint": (0.03, 0.5, 0.94, 0.4),
}
SHORT = {key: value for key, value in QUICK.items() if key != "sample"} | {
    "first_charge": "20 s", "at_most": 2, "refine": 0, "direct": ["5 min"], "for": "10 s",
    "last_decay": "90 s",
}  # fmt: skip
PARTS = [
    {
        "protocol": "emission_spectrum", "charge": "2 min", "times": ["2 s", "12 s"],
        "longest": "8 s", "white": False,
    },
    {
        "protocol": "decay", "charge": "5 min", "first": "1 s", "every": "5 s", "for": "60 s",
        "daylight": False,
    },
    SHORT,
]  # fmt: skip


def chain(**keys: Any) -> dict[str, Any]:
    patches = {name: list(region) for name, region in PAINTS.items()}
    asked = {"protocol": "phosphor", "sample": {"name": "two"}, "patches": patches, "parts": PARTS}
    return asked | keys


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("phosphor")
    IRRADIANCE_KIND.write(folder, true_irradiance(WIDTH, HEIGHT))
    LVF_KIND.write(folder, true_lvf_file(WIDTH, HEIGHT))

    def change(rig: dict[str, dict[str, Any]]) -> None:
        rig["optics"] |= {name: str(folder / f"{name}.yaml") for name in ("irradiance", "lvf")}
        rig["simulation"]["sensor"] = {"width": WIDTH, "height": HEIGHT}
        rig["simulation"]["sample"] = [
            {"material": name, "region": list(region)} for name, region in PAINTS.items()
        ]

    return record(folder, chain(), change)


@pytest.fixture(scope="module")
def processed(run: Path) -> Processed:
    return process_and_report(run)


def parts_of(path: Path) -> Any:
    """Of the chain in a file."""
    protocol: Any = read_protocol(path)
    return protocol.chain()


def states(run: Path, paint: str) -> tuple[Any, Any]:
    """What was found of a paint, and what is true."""
    (found,) = read_material(run / "result" / paint / "material.yaml").states
    (true,) = read_material(paint).states
    return found, true


@pytest.mark.campaign
@pytest.mark.parametrize(("paint", "other"), [tuple(PAINTS), tuple(PAINTS)[::-1]])
def test_every_paint_has_its_own_material(
    run: Path, processed: Processed, paint: str, other: str
) -> None:
    found, true = states(run, paint)
    _, of_other = states(run, other)
    assert found.k_r_per_s == pytest.approx(true.k_r_per_s, rel=0.01)
    # The room's lamp is four times as bright as the irradiance to which Table 1's rates belong.
    rates, sigma = (np.array(x) / 4 for x in (found.k_e_per_s, found.k_e_per_s_sigma))
    off, off_other = (np.abs(rates - np.array(one.k_e_per_s)) for one in (true, of_other))
    assert (off < np.maximum(5 * sigma, 2e-5)).all()
    assert rates[:3] == pytest.approx(true.k_e_per_s[:3], rel=0.25)
    assert (off_other > 10 * sigma).any()
    strong = np.array(true.reradiation) > 0.1 * max(true.reradiation)
    shape, wanted = (np.array(one.reradiation)[strong] for one in (found, true))
    assert shape / shape.sum() == pytest.approx(wanted / wanted.sum(), abs=0.06)


@pytest.mark.campaign
def test_every_paint_has_its_own_spectrum(run: Path, processed: Processed) -> None:
    for paint in PAINTS:
        place = run / "result" / "emission_spectrum" / paint
        spectrum = read_emission_spectrum(place / "emission.yaml")
        value = np.array(spectrum.value)
        assert spectrum.sample == paint
        assert np.abs(value / value.sum() - emitted(paint)).max() < 0.02


@pytest.mark.campaign
def test_results_lie_in_folders_of_the_patches(run: Path, processed: Processed) -> None:
    made = run / "result"
    for paint in PAINTS:
        material = read_material(made / paint / "material.yaml")
        assert material.name == paint
        assert material == read_material(made / "excitation" / paint / "material.yaml")
        assert (made / "excitation" / paint / "excitation.json").is_file()
        assert (made / "decay" / paint / "series.csv").is_file()
    assert not (made / "material.yaml").exists()
    page = (made / "report.html").read_text()
    for part in ("Emission spectrum", "Excitation"):
        assert all(f"<h2>{part}: {paint}</h2>" in page for paint in PAINTS)
    assert any(line.startswith("excitation: orange-paint: state 1") for line in processed.lines)
    assert list(read_fitted_decays(run / "result")) == list(PAINTS)


@pytest.mark.campaign
def test_a_comparison_takes_the_whole_material_of_each(run: Path, processed: Processed) -> None:
    compared = read_patches(run)
    assert list(compared) == list(PAINTS)
    for paint, patch in compared.items():
        assert patch.material == read_material(run / "result" / paint / "material.yaml")


@pytest.mark.campaign
def test_a_patch_that_does_not_reach_along_the_filter_is_left_out(
    run: Path, tmp_path: Path
) -> None:
    part, rig = parts_of(run / "protocol.yaml")[0], read_rig_file(run / "rig.yaml")
    short = Overrides.parse(["orange-paint=0.03,0.5,0.5,0.4"], [])
    own = read_run(run).part(part.name)
    found = analyse_spectra(AnalysisContext(own, part.protocol, rig, short, Inputs.of(rig)))
    said = str(of_code(found.warnings, "patch-off-strip"))
    assert "columns 12 to 180" in said
    assert "labrig process RUN --roi orange-paint=x,y,width,height" in said
    assert list(found.patches) == ["blue-paint"]


STRIP = Strip(left=(0.1, 0.5), right=(0.9, 0.5), height=0.3, rising=True)
LAYOUT = SensorLayout(WIDTH, HEIGHT, "RGGB")


def cut_of(region: Region) -> dict[str, Region]:
    (slices,) = slice_strip([StripPatch("a", "a", region, alone=False)], STRIP, LAYOUT)[0].values()
    return slices


def test_a_patch_is_its_rows_of_the_strip() -> None:
    whole = STRIP.slices()
    for name, (x, y, width, height) in cut_of((10, 25, 170, 10)).items():
        assert (x, width) == (whole[name][0], whole[name][2])
        assert np.array([y, height]) * HEIGHT == pytest.approx([25, 10])


@pytest.mark.parametrize(
    ("region", "said"),
    [
        ((10, 2, 170, 10), r"the patch in .* rows 2 to 12 \(0 in common\)"),
        ((10, 11, 170, 14), r"rows 22 to 42, .* rows 11 to 25 \(3 in common\)"),
        ((30, 25, 150, 10), r"columns 19 to 173 .* columns 30 to 180"),
    ],
)
def test_too_few_rows_or_columns_are_one_line(region: Region, said: str) -> None:
    with pytest.raises(DataError, match=said) as caught:
        cut_of(region)
    assert "expected patch a below the filter" in str(caught.value)
    assert "\n" not in str(caught.value)


@given(st.floats(-0.15, 0.15), st.floats(-0.1, 0.1))
def test_rows_of_a_tilted_strip_lie_further_along(down: float, below: float) -> None:
    strip = Strip(left=(0.1, 0.5 - down), right=(0.9, 0.5 + down), height=0.1, rising=True)
    slices = {
        name: (x, y + below, width, height)
        for name, (x, y, width, height) in strip.slices(5).items()
    }
    left, right = (np.array(end) * [WIDTH, HEIGHT] for end in (strip.left, strip.right))
    for (x, y, width, height), further in zip(
        slices.values(), tilt_offset(strip, slices, LAYOUT), strict=True
    ):
        middle = np.array([(x + width / 2) * WIDTH, (y + height / 2) * HEIGHT])
        along = (middle - left) @ (right - left) / np.sum((right - left) ** 2)
        assert (middle[0] - left[0]) / (right - left)[0] + further == pytest.approx(along)


def test_one_patch_without_a_result_leaves_the_others() -> None:
    patches = [StripPatch(name, name, (0, 0, 1, 1), alone=False) for name in "ab"]
    odd = Misfit("odd", "odd")

    def analyse(failing: str) -> Callable[[StripPatch], tuple[str, list[ResultWarning]]]:
        def one(patch: StripPatch) -> tuple[str, list[ResultWarning]]:
            if patch.name in failing:
                raise FitError("nothing glows")
            return patch.material, [odd]

        return one

    results, warnings = for_each_patch(patches, analyse("a"))
    assert results == {"b": "b"}
    assert [str(warning) for warning in warnings] == ["a: nothing glows", "b: odd"]
    with pytest.raises(FitError, match="a: nothing glows"):
        for_each_patch(patches, analyse("ab"))
    alone = [StripPatch("a", "paint")]
    assert for_each_patch(alone, analyse("b")) == ({"": "paint"}, (odd,))
    with pytest.raises(FitError, match=r"^nothing glows"):
        for_each_patch(alone, analyse("a"))


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"patches": {"a": [0, 0.1, 0.5, 0.4], "b": [0.5, 0.3, 0.5, 0.4]}},
         "one above the other, each in rows of its own and as long as the filter, got 'a' in rows "
         "0.1 to 0.5 and 'b' in rows 0.3 to 0.7"),
        ({"patches": {"Excitation": [0, 0, 1, 0.4]}}, "not called like a part, got 'Excitation'"),
        ({"patches": {"figures": [0, 0, 1, 0.4]}}, "names of patches that can be folders"),
        ({"patches": {"a": [0, 0, 1]}}, "patches.a"),
        ({"parts": [*PARTS[:1], PARTS[1] | {"patches": {"sample": [0, 0, 1, 1]}}]},
         "part decay: expected the patches of the chain, blue-paint, orange-paint, got sample;"),
    ],
)  # fmt: skip
def test_patches_that_cannot_be_are_one_clear_line(
    keys: dict[str, Any], said: str, tmp_path: Path
) -> None:
    path = tmp_path / "chain.yaml"
    path.write_text(write_quickly(chain(**keys)))
    with pytest.raises(UsageError) as caught:
        read_protocol(path)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_part_may_move_the_patches_of_the_chain(tmp_path: Path) -> None:
    moved = {name: [x, y, width, 0.2] for name, (x, y, width, _) in PAINTS.items()}
    path = tmp_path / "chain.yaml"
    path.write_text(write_quickly(chain(parts=[PARTS[1] | {"patches": moved}, SHORT])))
    decay, excitation = (dict(part.protocol.patches) for part in parts_of(path))
    assert {name: list(region) for name, region in decay.items()} == moved
    assert excitation == PAINTS
