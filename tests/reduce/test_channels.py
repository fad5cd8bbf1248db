import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from labrig.foundation.errors import DataError, FrameError, UsageError
from labrig.reduce import RawFrame, measure, read_raw
from labrig.reduce.plane_noise import plane_noise
from labrig.reduce.region_levels import isolated_outliers

MakeRaw = Callable[..., RawFrame]

#: colour.SDS_COLOURCHECKERS["BabelColor Average"] (colour-science 0.4.7), white 9.5 to black 2,
#: mean reflectance over 400 to 700 nm.
BABELCOLOR_NEUTRALS = (0.882548, 0.574161, 0.351677, 0.187161, 0.088097, 0.032161)
#: Green minus black of the neutrals, summed by another program.
GREEN_DN = (1162, 757, 477, 259, 126, 47)


def test_a_photographed_colorchecker_is_linear(real_data: Path) -> None:
    raw = read_raw(real_data / "canon_550d/canon_550d_kissx4_colorchecker.dng")
    patches = [
        measure(raw, (x - 24, 930 - 24, 48, 48)).channels["G"]
        for x in (704, 816, 926, 1034, 1146, 1256)
    ]
    green = np.array([patch.mean for patch in patches])
    assert green == pytest.approx(GREEN_DN, abs=1)
    assert np.corrcoef(green, BABELCOLOR_NEUTRALS)[0, 1] >= 0.9995
    # Flat paper: pixels scatter by their noise alone, so σ is about std/√n.
    for patch in patches:
        assert patch.n == 1152
        assert 0.8 < patch.sigma / (patch.std / np.sqrt(patch.n)) < 1.2


def test_bad_pixels_of_a_real_photograph_are_found(real_data: Path) -> None:
    good, bad = (
        np.fromfile(real_data / f"isp/isp_DSC_1339_768x512_rggb_{name}.raw", "<u2")
        for name in ("u16le", "badpixels_u16le")
    )
    good, bad = good.reshape(512, 768), bad.reshape(512, 768)
    places = [(row, column) for row in (0, 1) for column in (0, 1)]
    planes = [bad[row::2, column::2] for row, column in places]
    noises = dict(zip(places, plane_noise(planes), strict=True))
    found = np.zeros(bad.shape, bool)
    found[isolated_outliers(bad, (0, 0), 2, noises)] = True
    hot = bad > good
    assert np.count_nonzero(hot) == 200
    assert np.array_equal(found & hot, hot)
    # One sensor, one gain: a scene full of detail must not pass for noise in any plane.
    gains = [noise.above_darkest.photon_dn for noise in noises.values()]
    assert max(gains) < 1.5 * min(gains)
    # What else stands out, 0.24 %, is detail of the scene: a sanity limit, not an accuracy.
    assert np.count_nonzero(found & ~hot) < 0.01 * found.size
    before, after = (
        measure(RawFrame(pixels, "RGGB", (600.0,) * 4, 16383.0)).channels for pixels in (good, bad)
    )
    # 0.05 % of hot pixels change a mean by 2 %, and the noise hardly.
    for name, stats in before.items():
        assert after[name].sigma == pytest.approx(stats.sigma, rel=0.1)


@settings(max_examples=30, deadline=None)
@given(
    x=st.integers(0, 60),
    y=st.integers(0, 40),
    width=st.integers(2, 40),
    height=st.integers(2, 40),
    cfa=st.sampled_from(["RGGB", "BGGR", "GRBG", "GBRG"]),
)
def test_statistics_are_those_of_the_pixels_of_each_colour(
    x: int, y: int, width: int, height: int, cfa: str
) -> None:
    mosaic = np.random.default_rng(3).integers(500, 4000, (80, 100)).astype(np.uint16)
    raw = RawFrame(mosaic, cfa, (100.0, 110.0, 120.0, 130.0), 3900.0)
    colours = np.tile(np.array(list(cfa)).reshape(2, 2), (40, 50))
    above = mosaic - np.tile(np.reshape(raw.black, (2, 2)), (40, 50))
    area = (slice(y, y + height), slice(x, x + width))
    for name, stats in measure(raw, (x, y, width, height)).channels.items():
        mine = colours[area] == name
        pixels = above[area][mine]
        assert stats.n == pixels.size
        assert stats.mean == pytest.approx(pixels.mean(), rel=1e-12)
        assert stats.std == pytest.approx(pixels.std(ddof=1) if stats.n > 1 else 0, rel=1e-9)
        assert stats.saturated == np.count_nonzero(mosaic[area][mine] >= 3900)
        assert stats.peak == np.quantile(pixels, 0.995, method="inverted_cdf")
        assert stats.sigma > 0


def test_hot_pixels_are_counted_and_left_out_by_a_mask(make_raw: MakeRaw) -> None:
    pixels = np.random.default_rng(0).normal(1500, 10, (200, 200))
    hot = np.zeros(pixels.shape, bool)
    hot[10:190:20, 11:190:20] = True  # 81 greens
    clean = measure(make_raw(pixels)).channels["G"]
    pixels[hot] = 60000
    raw = make_raw(pixels)
    struck, masked = measure(raw).channels["G"], measure(raw, hot=hot).channels["G"]
    assert (clean.hot, struck.hot, masked.hot) == (0, 81, 0)
    assert (clean.saturated, struck.saturated, masked.saturated) == (0, 81, 0)
    assert struck.mean > clean.mean + 100
    assert masked.mean == pytest.approx(clean.mean, abs=4 * clean.sigma)
    assert masked.n == clean.n - 81
    assert masked.std == pytest.approx(clean.std, rel=0.02)
    assert struck.sigma == pytest.approx(clean.sigma, rel=0.05)


def test_peak_tells_how_near_clipping_is(make_raw: MakeRaw) -> None:
    pixels = np.full((100, 100), 1100)
    pixels[:10, :10] = 50000  # 1 % of the frame
    assert measure(make_raw(pixels)).channels["R"].peak == 49000
    assert measure(make_raw(pixels), (20, 20, 50, 50)).channels["R"].peak == 100


def test_json_has_the_keys_of_the_contract(make_raw: MakeRaw) -> None:
    raw = make_raw(np.full((20, 30), 1500), exposure_s=0.5, iso=100.0)
    document = json.loads(json.dumps(measure(raw).to_json(), allow_nan=False))
    assert set(document["channels"]["G"]) >= {"mean", "sigma", "std", "n", "saturated"}
    assert document["channels"]["G"]["mean"] == 500
    del document["channels"]
    assert document == {
        "black": [1000] * 4,
        "white": 60000,
        "cfa": "RGGB",
        "width": 30,
        "height": 20,
        "exposure_s": 0.5,
        "iso": 100,
        "f_number": None,
        "make": None,
        "model": None,
    }


def test_what_does_not_fit_is_refused(make_raw: MakeRaw) -> None:
    raw = make_raw(np.full((20, 30), 1500))
    with pytest.raises(UsageError, match="leaves the frame"):
        measure(raw, (20, 0, 11, 10))
    with pytest.raises(DataError, match="same camera"):
        measure(raw, hot=np.zeros((30, 20), bool))
    with pytest.raises(FrameError, match="every R pixel"):
        measure(raw, hot=np.ones((20, 30), bool))
