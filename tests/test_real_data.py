"""Real measurements of other people, through the commands a person would use."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from labrig import colour_science
from labrig.results import read_series
from tests.conftest import Ended

DATA = Path(__file__).parents[2] / "shared" / "data"
pytestmark = [
    pytest.mark.shared_data,
    pytest.mark.skipif(not DATA.is_dir(), reason="the folder of real data is not there"),
]
RAW = DATA / "raw_photos"
#: Centres of the neutrals, white to black, in pixels, and their reflectance (BabelColor average of
#: 30 charts, mean over 400-700 nm).
NEUTRALS_X = (704, 816, 926, 1034, 1146, 1256)
NEUTRALS_Y = 930


def test_the_neutrals_of_a_colour_checker_are_linear(labrig: Callable[..., Ended]) -> None:
    colour = colour_science.load()

    chart = colour.SDS_COLOURCHECKERS["BabelColor Average"]
    names = [
        "white 9.5 (.05 D)", "neutral 8 (.23 D)", "neutral 6.5 (.44 D)", "neutral 5 (.70 D)",
        "neutral 3.5 (1.05 D)", "black 2 (1.5 D)",
    ]  # fmt: skip
    reflectance = [float(np.mean(chart[name].values)) for name in names]
    green = []
    for x in NEUTRALS_X:
        ended = labrig(
            "frame", RAW / "canon_550d_kissx4_colorchecker.dng",
            "--roi", f"{x - 24},{NEUTRALS_Y - 24},48,48", "--json",
        )  # fmt: skip
        assert ended.code == 0, ended.err
        green.append(json.loads(ended.out)["channels"]["G"]["mean"])
    assert green == pytest.approx([1162, 757, 477, 259, 126, 47], abs=1.0)
    assert np.corrcoef(green, reflectance)[0, 1] >= 0.9995


@dataclass(frozen=True)
class Photograph:
    """A file of raw_photos/ and what its line in the README says of it."""

    name: str
    refused: str = ""
    size: tuple[int, int] = (0, 0)
    cfa: str = ""
    black: int = 0
    white: int = 0


NO_CONTAINER = "no RAW container"
PHOTOGRAPHS = [
    Photograph("canon_550d_kissx4_colorchecker.dng", "", (1734, 1156), "RGGB", 2056, 15000),
    Photograph("kodak_dc50.kdc", "", (768, 512), "GRBG", 0, 16383),
    Photograph("canon_eos_6d_linear.dng", "all colours in every pixel"),
    Photograph("canon_700d_truncated.cr2", "cut off"),
    Photograph("isp_DSC_1339_768x512_rggb_u16le.raw", NO_CONTAINER),
    Photograph("isp_DSC_1339_768x512_rggb_badpixels_u16le.raw", NO_CONTAINER),
]


def test_no_photograph_is_left_out() -> None:
    assert {path.name for path in RAW.iterdir()} == {photo.name for photo in PHOTOGRAPHS}


@pytest.mark.parametrize("photo", PHOTOGRAPHS, ids=lambda photo: photo.name)
def test_every_photograph_is_reduced_or_refused_as_the_readme_says(
    labrig: Callable[..., Ended], photo: Photograph
) -> None:
    ended = labrig("frame", RAW / photo.name, "--json")
    if photo.refused:
        assert (ended.code, ended.out) == (4, "")
        assert photo.refused in ended.err
        assert ended.err.count("\n") == 1
        return
    assert ended.code == 0, ended.err
    found = json.loads(ended.out)
    assert (found["width"], found["height"]) == photo.size
    assert (found["cfa"], found["white"]) == (photo.cfa, photo.white)
    assert found["black"] == [photo.black] * 4
    width, height = photo.size
    assert sum(channel["n"] for channel in found["channels"].values()) == width * height


def test_a_persistent_phosphor_has_the_rates_of_an_independent_fit(
    labrig: Callable[..., Ended],
) -> None:
    """Castaing et al. 2024, 524 nm after 300 s of 400 nm; oracle in the data's README."""
    table = DATA / "decay" / "perslqy_sao" / "sample_400_524_300s.txt"
    ended = labrig(
        "fit", "decay", table, "--origin", 330, "--from", 331.2, "--weights", "counts",
        "--offset", "free", "--flicker", 0, "--states", 2, "--json",
    )  # fmt: skip
    assert ended.code == 0, ended.err
    fit = json.loads(ended.out)
    # Every count weighs 1.45: the values scatter more than √counts.
    assert 1.2 < fit["sigma_factor"] < 1.27
    # Weighed by the counts that the fit expects, as by the counts themselves.
    assert fit["reduced_chi2"] * fit["sigma_factor"] ** 2 == pytest.approx(3.85, rel=0.01)
    rates = [state["k_r_per_s"] for state in fit["states"]]
    assert rates == pytest.approx([0.01046, 0.00205], rel=0.03)
    assert fit["warnings"], "no sum of exponentials is its law"


def test_a_table_of_somebody_elses_program_is_read() -> None:
    (series,) = read_series(DATA / "decay" / "perslqy_sao" / "sample_400_524_300s.txt")
    assert series.channels == ("counts",)
    assert len(series.t_s) == 6551
