"""Spectral images on a screen, against colour-science and the published colours of a chart."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra.numpy import arrays

import labrig
from labrig.foundation import colour_science
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.optics import (
    CHART_PATCHES,
    CIE_1931,
    XYZ_TO_SRGB,
    delta_e,
    illuminant,
    lab,
    observer,
    read_colour_chart,
    white_xyz,
)
from labrig.reproduce import (
    Display,
    camera_values,
    tristimulus,
)

EDGES_NM = np.linspace(300.0, 780.0, 25)
WHITE = white_xyz("D65", observer(CIE_1931))


def bands(width_nm: float) -> FloatArray:
    return np.linspace(300.0, 780.0, round(480 / width_nm) + 1)


def chart(edges_nm: FloatArray, light: str = "D65") -> FloatArray:
    """X, Y, Z of the patches under a light, (24, 3), a perfect white with Y = 1."""
    power = illuminant(light).in_bands(edges_nm)
    reflectances = np.stack([one.in_bands(edges_nm) for one in read_colour_chart("colorchecker")])
    return tristimulus(reflectances * power / tristimulus(power, edges_nm)[1], edges_nm)


def chart_lab(edges_nm: FloatArray) -> FloatArray:
    return lab(chart(edges_nm), WHITE)


def adapted_lab(xyz: FloatArray, white: FloatArray) -> FloatArray:
    """CIELAB of colours under another white, adapted to D65 by Bradford's transform."""
    colour = colour_science.load()
    adapted = colour.chromatic_adaptation(
        xyz, white, WHITE, method="Von Kries", transform="Bradford"
    )
    return lab(np.asarray(adapted), WHITE)


def published_lab() -> FloatArray:
    """CIELAB of the mean of 30 charts, whose published colours are those under D50, adapted."""
    colour = colour_science.load()
    published = colour.CCS_COLOURCHECKERS["BabelColor Average"]
    xyz = colour.xyY_to_XYZ(np.array(list(published.data.values())))
    return adapted_lab(np.asarray(xyz), np.asarray(colour.xy_to_XYZ(published.illuminant)))


def test_tristimulus_values_of_a_piecewise_constant_spectrum_are_those_of_fine_sums() -> None:
    rng = np.random.default_rng(1)
    radiance = rng.uniform(0, 1e-3, (2, 5, 24)).astype(np.float32)
    eye = observer(CIE_1931)
    nm = np.arange(300.0005, 780.0, 0.001)
    functions = np.stack(
        [np.interp(nm, eye.wavelength_nm, one, left=0, right=0) for one in eye.functions.T], axis=1
    )
    in_band = functions.reshape(24, -1, 3).sum(axis=1) * 0.001
    expected = 683.0 * radiance.astype(float) @ in_band
    np.testing.assert_allclose(tristimulus(radiance, EDGES_NM), expected, rtol=1e-6)


@pytest.mark.parametrize(
    ("width_nm", "largest", "mean"), [(20.0, 0.72, 0.37), (10.0, 0.19, 0.09), (5.0, 0.05, 0.03)]
)
def test_bands_displace_a_chart_by_less_than_is_seen(
    width_nm: float, largest: float, mean: float
) -> None:
    difference = delta_e(chart_lab(bands(width_nm)), chart_lab(bands(1.0)))
    assert difference.max() < largest
    assert difference.mean() < mean


def test_a_chart_has_its_published_colours() -> None:
    white = white_xyz("D50", observer(CIE_1931))
    difference = delta_e(adapted_lab(chart(EDGES_NM, "D50"), white), published_lab())
    assert difference.max() < 1.0
    assert difference.mean() < 0.45


def test_a_chart_under_d65_on_the_screen_has_its_published_colours() -> None:
    """Its colours adapted from D50 are not those under D65: 0.57 without bands, up to 1.4."""
    assert delta_e(chart_lab(bands(1.0)), published_lab()).mean() < 0.6
    shown = Display(white_luminance=1.0).shown(chart(EDGES_NM))
    linear = colour_science.load().cctf_decoding(shown / 255, function="sRGB")
    difference = delta_e(lab(linear @ np.linalg.inv(XYZ_TO_SRGB).T, WHITE), published_lab())
    is_in_gamut = np.array([name != "cyan" for name in CHART_PATCHES])
    assert difference[is_in_gamut].mean() < 0.8
    assert difference[is_in_gamut].max() < 2.0


def test_a_camera_records_its_curves() -> None:
    camera = labrig.read_camera("canon_eos_5d_mark_ii")
    flat = np.ones((3, 2, 24))
    values = camera_values(flat, EDGES_NM, camera)
    expected = np.trapezoid(camera.sensitivity, camera.wavelength_nm, axis=0)
    np.testing.assert_allclose(values, np.broadcast_to(expected, (3, 2, 3)), rtol=1e-9)


pictures = arrays(np.float64, (4, 3), elements=st.floats(0, 1e6, allow_subnormal=False))


@given(pictures, st.floats(1e-3, 1e3))
def test_luminance_is_kept_wherever_the_screen_reaches_it(xyz: FloatArray, white: float) -> None:
    linear = Display(white).linear(xyz)
    assert ((linear >= 0) & (linear <= 1)).all()
    luminance = np.linalg.inv(XYZ_TO_SRGB)[1] @ linear.T
    is_reached = (xyz / white @ XYZ_TO_SRGB.T).max(axis=1) <= 1
    # The standard rounds its matrix to 4 digits.
    kept, true = luminance[is_reached], xyz[is_reached, 1] / white
    np.testing.assert_allclose(kept, true, rtol=1e-3, atol=1e-9)
    # What is brighter than the screen is never shown brighter than it is.
    assert (luminance <= xyz[:, 1] / white * 1.001 + 1e-9).all()


def oklab(linear: FloatArray) -> FloatArray:
    """Oklab by colour-science."""
    colour = colour_science.load()
    return np.asarray(colour.XYZ_to_Oklab(linear @ np.linalg.inv(XYZ_TO_SRGB).T))


@pytest.mark.parametrize("name", CHART_PATCHES)
def test_a_light_that_grows_keeps_its_hue_and_never_gets_darker(name: str) -> None:
    """A wall that is lit more and more: no lilac, no salmon, and white at last."""
    colour = chart(EDGES_NM, "D65")[CHART_PATCHES.index(name)]
    growing = np.geomspace(0.1, 1e4, 60)[:, np.newaxis] * colour / colour[1]
    linear = Display(1.0).linear(growing)
    lightness, a, b = oklab(linear).T
    assert (np.diff(lightness) > -1e-3).all()
    assert lightness[-1] > 0.99
    chroma = np.hypot(a, b)
    is_coloured = chroma > 0.03
    hue = np.unwrap(np.arctan2(b, a)[is_coloured])
    assert hue.size == 0 or np.ptp(hue) < np.radians(6)


def test_greys_are_in_the_gamut_however_bright() -> None:
    """The standard's matrix, of 4 digits, gives some of them all channels above their luminance."""
    grey = np.array([0.9505, 1.0, 1.089]) + 1e-4 * np.random.default_rng(5).normal(size=(200, 3))
    for bright in (1.0, 1e3, 1e6):
        display = Display.automatic(bright * grey, 100.0)
        np.testing.assert_allclose(display.linear(bright * grey), 1.0, atol=4e-3)


def test_colours_in_the_gamut_are_not_changed() -> None:
    linear = np.random.default_rng(2).uniform(0, 1, (5, 6, 3))
    xyz = 30.0 * linear @ np.linalg.inv(XYZ_TO_SRGB).T
    np.testing.assert_allclose(Display(30.0).linear(xyz), linear, atol=1e-9)


def test_a_colour_out_of_gamut_keeps_its_hue_towards_grey() -> None:
    """A laser of 532 nm: on the line from the colour to its grey, at the edge of the gamut."""
    laser = 0.5 * np.array([0.1891, 0.8850, 0.0369])
    outside, grey = XYZ_TO_SRGB @ laser, laser[1]
    inside = Display(1.0).linear(laser)
    assert inside.min() == pytest.approx(0.0, abs=1e-12) or inside.max() == pytest.approx(1.0)
    share = (inside - grey) / (outside - grey)
    np.testing.assert_allclose(share, share[0])
    assert 0 < share[0] < 1


def test_automatic_exposure_clips_the_share_that_it_says() -> None:
    linear = np.random.default_rng(3).uniform(0, 7, (100, 100, 3))
    xyz = linear @ np.linalg.inv(XYZ_TO_SRGB).T
    display = Display.automatic(xyz, unclipped_per_cent=98.0)
    clipped = (xyz @ XYZ_TO_SRGB.T * display.exposure > 1).any(axis=-1).mean()
    assert clipped == pytest.approx(0.02, abs=1e-4)
    # A small glow in the dark is exposed as if it were all.
    in_the_dark = np.concatenate([np.zeros((2000, 100, 3)), xyz])
    in_the_dark_display = Display.automatic(in_the_dark, unclipped_per_cent=98.0)
    assert in_the_dark_display == display


def test_an_exposure_is_the_reciprocal_of_the_white() -> None:
    xyz = np.random.default_rng(4).uniform(0, 50, (7, 3))
    np.testing.assert_array_equal(Display.of_exposure(0.02).shown(xyz), Display(50.0).shown(xyz))
    assert "luminance 50 is white" in Display.of_exposure(0.02).statement


def test_a_white_under_a_lamp_is_white_and_all_else_is_adapted_as_by_colour_science() -> None:
    lamp = white_xyz("A", observer(CIE_1931))
    display = Display(2.0, tuple(7.0 * lamp))
    np.testing.assert_allclose(display.linear(2.0 * lamp), 1.0, atol=1e-9)
    np.testing.assert_allclose(display.linear(0.4 * lamp), 0.2, atol=1e-9)
    xyz = chart(EDGES_NM, "A")
    colour = colour_science.load()
    adapted = colour.chromatic_adaptation(
        xyz, lamp, np.linalg.inv(XYZ_TO_SRGB).sum(axis=1), "Von Kries", transform="Bradford"
    )
    np.testing.assert_allclose(display.linear(xyz), Display(2.0).linear(adapted), atol=1e-4)
    assert "x, y = 0.4476, 0.4074" in display.statement
    automatic = Display.automatic(xyz, 100.0, tuple(lamp))
    assert automatic.white_luminance == pytest.approx(np.max(adapted @ XYZ_TO_SRGB.T), rel=1e-4)
    with pytest.raises(UsageError, match="white"):
        Display(1.0, (0.9, 1.0, 0.0))


@pytest.mark.parametrize(
    ("radiance", "edges_nm"),
    [
        (np.ones((2, 2, 23)), EDGES_NM),
        (np.ones((2, 2, 24)), EDGES_NM[::-1]),
        (np.full((2, 2, 24), np.nan), EDGES_NM),
        (np.full((2, 2, 24), np.inf, np.float32), EDGES_NM),
    ],
)
def test_an_image_that_is_none_is_refused(radiance: FloatArray, edges_nm: FloatArray) -> None:
    with pytest.raises(UsageError, match=r"^expected [^\n]+$"):
        tristimulus(radiance, edges_nm)


def test_a_dark_picture_has_no_automatic_exposure() -> None:
    with pytest.raises(UsageError, match="dark"):
        Display.automatic(np.zeros((4, 4, 3)))
    for white in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(UsageError):
            Display(white)
