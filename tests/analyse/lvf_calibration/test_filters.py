"""Colour filters seen through a strip: which was not in its place, and what the rest say."""

from dataclasses import replace

import numpy as np
import pytest

from labrig.foundation.arrays import FloatArray
from labrig.optics import CameraResponse, Lvf, Transmittance, nominal_lvf, read_camera
from labrig.optics.piecewise import quadrature
from labrig.protocols.lvf_calibration.analysis import (
    NO_FILTER,
    Bench,
    FilterScenes,
    fit_bands,
    left_out_warning,
    misfits,
    residuals,
)
from labrig.results.strip_profile import SliceValues
from tests.analyse.lvf_calibration.strip_pictures import TRUE_MAP, halogen

CARD = Transmittance("card", np.array([380.0, 780.0]), np.array([0.17, 0.19]))
BENCH = Bench(halogen(), CARD, read_camera("canon_eos_5d_mark_ii"))
#: Fall-off of lens and lamp along the strip.
FALL_OFF = 1 - 0.3 * np.linspace(-1, 1, 11) ** 2


def edge(name: str, at_nm: float, sign: float) -> Transmittance:
    nm = np.arange(380.0, 781.0, 5.0)
    return Transmittance(name, nm, 0.02 + 0.9 / (1 + np.exp(-sign * (nm - at_nm) / 10)))


FILTERS = [
    NO_FILTER,
    *(edge(f"long-{at}", at, 1) for at in range(410, 700, 40)),
    *(edge(f"short-{at}", at, -1) for at in range(430, 700, 40)),
]


def strip() -> Lvf:
    return nominal_lvf(TRUE_MAP, np.linspace(402.0, 700.0, 11), fwhm_nm=24.0, leakage=0.002)


def values(
    lvf: Lvf | None, one: Transmittance, seed: int, camera: CameraResponse = BENCH.camera
) -> SliceValues:
    """Of 11 places, with noise; without a strip the card by itself."""
    lamp = BENCH.lamp
    curves = (camera.wavelength_nm, lamp.wavelength_nm, one.wavelength_nm)
    nodes, weights = quadrature(380.0, 780.0, *curves)
    light = weights * lamp.at(nodes) * CARD.at(nodes) * one.at(nodes)
    seen = (0.5 * lvf.transmission(nodes) if lvf else np.ones((11, len(nodes)))) * light
    value = FALL_OFF[:, np.newaxis] * (seen @ camera.at(nodes))
    sigma: FloatArray = np.sqrt(value * value.max() + (0.002 * value.max()) ** 2) / 1000
    rng = np.random.default_rng(seed)
    return SliceValues(value + sigma * rng.standard_normal(value.shape), sigma)


def scenes(camera: CameraResponse = BENCH.camera, **in_their_place: Transmittance) -> FilterScenes:
    """All filters; named ones, `-` as `_`, replaced by others."""
    really = [in_their_place.get(one.name.replace("-", "_"), one) for one in FILTERS]
    seen = [values(strip(), one, seed, camera) for seed, one in enumerate(really)]
    return FilterScenes(strip().position, FILTERS, seen, values(None, NO_FILTER, 99, camera))


def test_filters_in_their_place_calibrate_the_strip() -> None:
    all_of_them = scenes()
    assert not [one for one in misfits(all_of_them, BENCH, TRUE_MAP) if one.left_out]
    found = fit_bands(all_of_them, BENCH, TRUE_MAP)
    truth = strip().bands
    np.testing.assert_allclose(found.lvf.bands.centre_nm, truth.centre_nm, atol=1.0)
    np.testing.assert_allclose(found.lvf.bands.fwhm_nm, truth.fwhm_nm, rtol=0.1)
    # The card by itself takes lamp and lens out: the strip lets half of the light through.
    np.testing.assert_allclose(found.lvf.bands.peak[1:], 0.5 * truth.peak[1:], rtol=0.06)
    left = residuals(all_of_them, BENCH, found.lvf)
    assert np.nanmax(np.abs(left)) < 0.02


def test_channels_have_the_ratios_of_this_camera_not_of_the_curves_it_began_with() -> None:
    of_this_body = np.array([0.93, 1.0, 1.12])
    published = BENCH.camera
    camera = replace(published, sensitivity=published.sensitivity * of_this_body)
    fitted = fit_bands(scenes(camera), BENCH, TRUE_MAP).camera
    for peak_nm in (460.0, 530.0, 600.0):
        glow = np.exp(-(((camera.wavelength_nm - peak_nm) / 40) ** 2))
        ratios, true_ratios = fitted.response(glow), camera.response(glow)
        np.testing.assert_allclose(ratios / ratios[1], true_ratios / true_ratios[1], rtol=0.02)


@pytest.mark.parametrize("really", [FILTERS[0], FILTERS[4]], ids=["none", "the one before"])
def test_a_filter_that_was_skipped_is_named(really: Transmittance) -> None:
    (wrong,) = (one for one in misfits(scenes(long_570=really), BENCH, TRUE_MAP) if one.left_out)
    assert (wrong.name, wrong.like) == ("long-570", really.name)
    assert wrong.own > 3 * wrong.best
    said = left_out_warning(wrong)
    assert said.subject == "colour filter long-570"
    assert said.values["rms"] == wrong.own
    like = "no filter" if really is NO_FILTER else really.name
    assert said.values["likeness"].startswith(f"it looks like {like} (")
    assert "\n" not in str(said)


def test_a_filter_whose_file_is_of_another_one_is_named() -> None:
    unknown = Transmittance("unknown", np.array([380.0, 780.0]), np.array([0.6, 0.3]))
    (wrong,) = (one for one in misfits(scenes(short_550=unknown), BENCH, TRUE_MAP) if one.left_out)
    assert wrong.name == "short-550"
    assert "none of the others" in str(left_out_warning(wrong))


def test_what_clips_everywhere_is_left_out() -> None:
    one = scenes()
    dark = one.values[3]
    holes = replace(dark, value=np.where(dark.value > np.median(dark.value), np.nan, dark.value))
    with_holes = replace(one, values=[*one.values[:3], holes, *one.values[4:]])
    assert not [m for m in misfits(with_holes, BENCH, TRUE_MAP) if m.left_out]
    bands = fit_bands(with_holes, BENCH, TRUE_MAP).lvf.bands
    np.testing.assert_allclose(bands.centre_nm, strip().bands.centre_nm, atol=1.0)
