"""Real measurements of other people, through the commands a person would use."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from labrig.foundation import colour_science
from tests.conftest import Ended

#: Centres of the neutrals, white to black, in pixels, and their reflectance (BabelColor average of
#: 30 charts, mean over 400-700 nm).
NEUTRALS_X = (704, 816, 926, 1034, 1146, 1256)
NEUTRALS_Y = 930


def test_the_neutrals_of_a_colour_checker_are_linear(
    labrig: Callable[..., Ended], real_data: Path
) -> None:
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
            "frame", real_data / "canon_550d/canon_550d_kissx4_colorchecker.dng",
            "--roi", f"{x - 24},{NEUTRALS_Y - 24},48,48", "--json",
        )  # fmt: skip
        assert ended.code == 0, ended.err
        green.append(json.loads(ended.out)["channels"]["G"]["mean"])
    assert green == pytest.approx([1162, 757, 477, 259, 126, 47], abs=1.0)
    assert np.corrcoef(green, reflectance)[0, 1] >= 0.9995


@dataclass(frozen=True)
class Photograph:
    """A RAW file and what other programs say of it."""

    name: str
    refused: str = ""
    size: tuple[int, int] = (0, 0)
    cfa: str = ""
    black: int = 0
    white: int = 0


NO_CONTAINER = "no RAW container"
PHOTOGRAPHS = [
    Photograph(
        "canon_550d/canon_550d_kissx4_colorchecker.dng", "", (1734, 1156), "RGGB", 2056, 15000
    ),
    Photograph("isp/isp_DSC_1339_768x512_rggb_u16le.raw", NO_CONTAINER),
    Photograph("isp/isp_DSC_1339_768x512_rggb_badpixels_u16le.raw", NO_CONTAINER),
]
SHARED_PHOTOGRAPHS = [
    Photograph("kodak_dc50.kdc", "", (768, 512), "GRBG", 0, 16383),
    Photograph("canon_eos_6d_linear.dng", "all colours in every pixel"),
    Photograph("canon_700d_truncated.cr2", "cut off"),
]


@pytest.mark.parametrize("photo", PHOTOGRAPHS, ids=lambda photo: photo.name)
def test_every_photograph_is_reduced_or_refused(
    labrig: Callable[..., Ended], real_data: Path, photo: Photograph
) -> None:
    assert_reduced_or_refused(labrig, real_data, photo)


def test_every_shared_photograph_is_reduced_or_refused(
    labrig: Callable[..., Ended], shared_data: Path
) -> None:
    for photo in SHARED_PHOTOGRAPHS:
        assert_reduced_or_refused(labrig, shared_data / "raw_photos", photo)


def assert_reduced_or_refused(
    labrig: Callable[..., Ended], folder: Path, photo: Photograph
) -> None:
    ended = labrig("frame", folder / photo.name, "--json")
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


def test_a_table_in_the_shape_of_a_real_phosphors_has_its_rates(
    labrig: Callable[..., Ended], tmp_path: Path
) -> None:
    """Dark, charge and decay in one trace, as Castaing et al. (2024) have it; a count is 1.45."""
    t_s = np.arange(6551) * 0.6
    after_s = np.maximum(t_s - 330, 0)
    decay = 10851 * np.exp(-0.01046 * after_s) + 3514 * np.exp(-0.00205 * after_s)
    charge = np.clip((t_s - 30) / 300, 0, 1)
    light = np.random.default_rng(524).poisson((charge * decay + 4.5) / 1.448) * 1.448
    rows = [f"{t:g}\t{counts:.8g}\t\t\t" for t, counts in zip(t_s, light, strict=True)]
    rows[0] = f"0\t{light[0]:.8g}\t524\t30\t330"
    table = tmp_path / "made.txt"
    table.write_bytes("\r\n".join(["t\tcounts\twl0\tt0\tt1", *rows, ""]).encode())
    ended = labrig(
        "fit", "decay", table, "--origin", 330, "--from", 331.2, "--weights", "counts",
        "--offset", "free", "--flicker", 0, "--states", 2, "--json",
    )  # fmt: skip
    assert ended.code == 0, ended.err
    fit = json.loads(ended.out)
    assert fit["sigma_factor"] == pytest.approx(1.448**0.5, rel=0.02)
    for state, k_r_per_s in zip(fit["states"], (0.01046, 0.00205), strict=True):
        assert abs(state["k_r_per_s"] - k_r_per_s) < 3 * state["k_r_per_s_sigma"]
