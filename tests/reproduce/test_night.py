"""The look of a night: rods by the spectra, its formulas by hand, and what lit places keep."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.optics import illuminant, read_colour_chart, scotopic_efficacy
from labrig.reproduce import Display, NightLook, night_view, scotopic_luminance, tristimulus

EDGES_NM = np.linspace(300.0, 780.0, 25)
STILL = NightLook(rods=1.0, noise=0.0, blur_px=0.0)


def chart_radiance() -> FloatArray:
    light = illuminant("D65").in_bands(EDGES_NM)
    reflectances = np.stack([one.in_bands(EDGES_NM) for one in read_colour_chart("colorchecker")])
    return np.asarray(reflectances * light / tristimulus(light, EDGES_NM)[1])


def grey_picture(relative: FloatArray, luminance: float) -> FloatArray:
    """Radiance of equal energy whose luminance is a pattern times `luminance`, (h, w, bands)."""
    flat = np.ones(24) / tristimulus(np.ones(24), EDGES_NM)[1]
    return np.asarray(luminance * relative[..., np.newaxis] * flat)


def chromaticity(xyz: FloatArray) -> FloatArray:
    return np.asarray(xyz[..., :2] / xyz.sum(axis=-1, keepdims=True))


def test_scotopic_luminance_is_that_of_the_spectrum() -> None:
    radiance = np.random.default_rng(1).uniform(0, 1e-3, 24)
    nm = np.arange(300.005, 780.0, 0.01)
    expected = (np.repeat(radiance, 2000) * scotopic_efficacy(nm)).sum() * 0.01
    assert scotopic_luminance(radiance, EDGES_NM) == pytest.approx(expected, rel=1e-5)


def test_the_papers_regression_holds_for_daylight_and_fails_for_a_glow() -> None:
    def regression(xyz: FloatArray) -> FloatArray:
        x, y, z = np.moveaxis(xyz, -1, 0)
        return np.asarray(y * (1.33 * (1 + (y + z) / x) - 1.68))

    chart = chart_radiance()
    ratio = regression(tristimulus(chart, EDGES_NM)) / scotopic_luminance(chart, EDGES_NM)
    assert ratio.mean() == pytest.approx(1.0, abs=0.1)
    assert ((ratio > 0.7) & (ratio < 1.6)).all()
    glow = np.zeros(24)
    glow[10] = 1.0  # 500 to 520 nm, green phosphors
    narrow = regression(tristimulus(glow, EDGES_NM)) / scotopic_luminance(glow, EDGES_NM)
    assert narrow > 4


def test_rods_alone_see_bluish_grey_of_their_own_luminance() -> None:
    radiance = chart_radiance().reshape(4, 6, 24)
    xyz, _ = night_view(radiance, EDGES_NM, STILL, Display(1.0))
    np.testing.assert_allclose(chromaticity(xyz), 0.5 / 3 + 0.5 / 4)
    # Unblurred, d = 0.
    np.testing.assert_allclose(xyz[..., 1], scotopic_luminance(radiance, EDGES_NM))


@given(st.floats(0, 1), st.floats(0, 1))
def test_colour_and_luminance_of_any_share_of_rods(k: float, b: float) -> None:
    radiance = chart_radiance().reshape(4, 6, 24)
    before, rods = tristimulus(radiance, EDGES_NM), scotopic_luminance(radiance, EDGES_NM)
    look = NightLook(rods=k, blue_shift=b, blur_px=0.0, noise=0.0)
    xyz, _ = night_view(radiance, EDGES_NM, look, Display(1.0))
    expected = (1 - k * b) * ((1 - k) * chromaticity(before) + k / 3) + k * b / 4
    np.testing.assert_allclose(chromaticity(xyz), expected, rtol=1e-9)
    np.testing.assert_allclose(xyz[..., 1], (1 - k) * before[..., 1] + k * rods, rtol=1e-9)


def test_rods_take_over_between_a_hundredth_and_ten_candela() -> None:
    luminance = np.array([0.0, 1e-6, 0.01, np.sqrt(0.1), 10.0, 1e4])
    share = NightLook().share_of_rods(luminance)
    np.testing.assert_allclose(share, [1, 1, 1, 0.5, 0, 0], atol=1e-12)


def test_a_lit_place_keeps_its_look() -> None:
    radiance = 100.0 * chart_radiance().reshape(4, 6, 24)
    radiance *= 1e3 / tristimulus(radiance, EDGES_NM)[..., 1].min()
    xyz, display = night_view(radiance, EDGES_NM, NightLook())
    np.testing.assert_allclose(xyz, tristimulus(radiance, EDGES_NM), rtol=1e-9)
    assert display == Display.automatic(xyz)


def gaussian(sigma_px: float, size: int) -> FloatArray:
    x = np.arange(size) - size // 2
    line = np.exp(-0.5 * (x / sigma_px) ** 2)
    line /= line.sum()
    return np.asarray(np.outer(line, line))


@pytest.mark.parametrize("gamma", [1.0, 1.25, 2.0])
def test_a_point_of_light_is_spread_by_the_difference_of_gaussians(gamma: float) -> None:
    point = np.zeros((41, 41))
    point[20, 20] = 1.0
    look = NightLook(rods=1.0, sharpening=gamma, noise=0.0)
    radiance = grey_picture(point, 1.0)
    xyz, _ = night_view(radiance, EDGES_NM, look, Display(0.25))
    peak = scotopic_luminance(radiance, EDGES_NM)[20, 20] / 0.25
    narrow, wide = peak * gaussian(1.6, 41), peak * gaussian(2.56, 41)
    edge = narrow - wide
    expected = wide + np.sign(edge) * np.abs(edge) ** (1 / gamma)
    # Gaussians end at four standard deviations.
    np.testing.assert_allclose(xyz[..., 1] / 0.25, np.maximum(expected, 0), atol=2e-3)


def test_noise_is_relative_to_white_and_comes_again_with_its_seed() -> None:
    radiance = grey_picture(np.full((200, 200), 1.0), 1e-3)
    look = NightLook(seed=7)
    white = Display(8e-3)
    first, _ = night_view(radiance, EDGES_NM, look, white)
    again, _ = night_view(radiance, EDGES_NM, look, white)
    other, _ = night_view(radiance, EDGES_NM, NightLook(seed=8), white)
    np.testing.assert_array_equal(first, again)
    noise = first[..., 1] / 8e-3
    assert noise.std() == pytest.approx(0.0125, rel=0.02)
    assert noise.mean() == pytest.approx(2.261 / 8, rel=2e-3)
    assert not np.array_equal(first, other)


def test_darkness_stays_dark() -> None:
    xyz, _ = night_view(
        np.zeros((3, 3, 24), np.float32), EDGES_NM, NightLook(noise=0), Display(1.0)
    )
    np.testing.assert_array_equal(xyz, 0.0)


@pytest.mark.parametrize(
    "wrong",
    [
        {"rods": 1.2},
        {"blue_shift": -0.1},
        {"blur_px": -1.0},
        {"sharpening": 0.0},
        {"noise": float("nan")},
        {"seed": -1},
    ],
)
def test_parameters_outside_of_their_range_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(UsageError, match=rf"^{next(iter(wrong))}: expected [^\n]+$"):
        NightLook(**wrong)  # type: ignore[arg-type]


def test_a_spectrum_is_no_picture() -> None:
    with pytest.raises(UsageError, match="image"):
        night_view(np.ones(24), EDGES_NM, NightLook())
