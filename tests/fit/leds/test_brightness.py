"""Brightnesses of LEDs with spectra, response and camera curves other than assumed, and σ."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import labrig
from labrig.fit.leds import (
    CURVES_OF_MODEL,
    RESPONSE_CALIBRATED,
    RESPONSE_UNKNOWN,
    BrightnessFit,
    LedLightMeasured,
    ResponseError,
    fit_brightness,
    led_band,
    light_within,
    match_channels,
)
from labrig.fit.spectrum import curve_modes
from labrig.foundation.arrays import FloatArray
from labrig.optics import CameraResponse, Spectrum, Transmittance
from tests.pulls import assert_sigma_is_right

HOUSE = labrig.read_camera("canon_eos_5d_mark_ii")
WHITE = Transmittance("card", np.array([300.0, 800.0]), np.array([0.18, 0.18]))
PEAK_NM = np.array([365.0, 405.0, 430.0, 455.0, 490.0, 530.0, 565.0, 590.0, 625.0])
FWHM_NM = np.array([12.0, 14.0, 17.0, 18.0, 24.0, 31.0, 16.0, 16.0, 17.0])
NODES_NM = np.arange(380.0, 780.0)


def led(peak_nm: float, fwhm_nm: float, skew: float = 0.0, name: str = "") -> Spectrum:
    grid_nm = np.arange(peak_nm - 4 * fwhm_nm, peak_nm + 4 * fwhm_nm, 0.5)
    width_nm = fwhm_nm / 2.355 * np.where(grid_nm < peak_nm, 1 - skew, 1 + skew)
    return Spectrum(name, grid_nm, np.exp(-(((grid_nm - peak_nm) / width_nm) ** 2) / 2))


def bent(rng: np.random.Generator) -> CameraResponse:
    modes = curve_modes(
        CURVES_OF_MODEL, HOUSE.wavelength_nm, HOUSE.sensitivity, HOUSE.sensitivity.max(axis=0)
    )
    change = sum(rng.standard_normal() * mode for mode in modes)
    return replace(HOUSE, sensitivity=np.maximum(HOUSE.sensitivity + change, 0.0))


def seen(spectrum: Spectrum, camera: CameraResponse) -> FloatArray:
    light = spectrum.resampled(NODES_NM).value / (spectrum.value.sum() * 0.5)
    return np.asarray(0.18 * light @ camera.at(NODES_NM))


def bank(seed: int, response: ResponseError | None) -> tuple[list[LedLightMeasured], FloatArray]:
    """Measured LEDs, by a spectrometer unless `response` is None; and their true ln b."""
    rng = np.random.default_rng(seed)
    camera, log_b, gain = bent(rng), rng.normal(0.0, 0.4, 9), np.exp(rng.normal())
    error = response or RESPONSE_UNKNOWN
    distance = (PEAK_NM[:, np.newaxis] - PEAK_NM) / error.correlation_nm
    covariance = error.sigma**2 * np.exp(-(distance**2) / 2) + 1e-10 * np.eye(9)
    log_r = np.linalg.cholesky(covariance) @ rng.standard_normal(9)
    leds = []
    for m, (peak_nm, fwhm_nm) in enumerate(zip(PEAK_NM, FWHM_NM, strict=True)):
        name = f"{peak_nm:g} nm"
        true = led(
            peak_nm + rng.normal(0.0, 2.0),
            fwhm_nm * (1 + 0.2 * rng.standard_normal()),
            float(np.clip(0.2 * rng.standard_normal(), -0.5, 0.5)),
            name,
        )
        value = np.exp(log_b[m]) * gain * seen(true, camera) * np.exp(0.005 * rng.standard_normal())
        variance = (1e-4 * value.max() + 1e-6) ** 2 + (0.002 * value) ** 2
        value = value + np.sqrt(variance) * rng.standard_normal(3)
        one = LedLightMeasured(name, led(peak_nm, fwhm_nm, name=name), 2.0, True, value, variance)
        if response is not None:
            moved = replace(true, wavelength_nm=true.wavelength_nm + 0.2 * rng.standard_normal())
            light = float(np.exp(log_b[m] + log_r[m] + 0.003 * rng.standard_normal()))
            one = replace(one, spectrum=moved, wavelength_sigma_nm=0.2, is_nominal=False)
            one = replace(one, light=light, light_sigma=0.003)
        leds.append(one)
    return leds, log_b


def pulls(fit: BrightnessFit, log_b: FloatArray) -> FloatArray:
    """Errors about the common scale over their σ, of the LEDs that are known."""
    known = fit.sigma < 0.5
    weight = np.where(known, fit.sigma**-2, 0.0)
    error = fit.log_brightness - log_b
    error = error - weight @ error / weight.sum()
    return np.asarray((error / fit.sigma)[known])


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("response", "seeds"),
    [
        pytest.param(RESPONSE_UNKNOWN, range(50), id="spectrometer", marks=pytest.mark.campaign),
        pytest.param(RESPONSE_CALIBRATED, range(40), id="calibrated", marks=pytest.mark.campaign),
        pytest.param(None, range(20), id="camera"),
    ],
)
def test_errors_are_as_large_as_sigma_says(response: ResponseError | None, seeds: range) -> None:
    all_pulls = []
    for seed in seeds:
        leds, log_b = bank(seed, response)
        fit = fit_brightness(leds, HOUSE, WHITE, response or RESPONSE_UNKNOWN)
        all_pulls.append(pulls(fit, log_b))
    assert_sigma_is_right(np.concatenate(all_pulls))


def test_the_spectrometer_carries_the_scale_to_the_ultraviolet() -> None:
    leds, _ = bank(1, None)
    assert fit_brightness(leds, HOUSE, WHITE).sigma[0] > 1
    assert not fit_brightness(leds, HOUSE, WHITE).by_camera[0]
    leds, _ = bank(1, RESPONSE_UNKNOWN)
    assert fit_brightness(leds, HOUSE, WHITE).sigma[0] < 0.3
    leds, _ = bank(1, RESPONSE_CALIBRATED)
    assert fit_brightness(leds, HOUSE, WHITE, RESPONSE_CALIBRATED).sigma[0] < 0.015


@settings(max_examples=8)
@given(
    scale=st.floats(1e-3, 1e3),
    gain=st.floats(1e-3, 1e3),
)
def test_units_of_either_instrument_do_not_matter(scale: float, gain: float) -> None:
    leds, _ = bank(3, RESPONSE_UNKNOWN)
    changed = [
        replace(
            one,
            light=scale * (one.light or 0.0),
            value=gain * np.asarray(one.value),
            variance=gain**2 * np.asarray(one.variance),
        )
        for one in leds
    ]
    before, after = (fit_brightness(some, HOUSE, WHITE) for some in (leds, changed))
    difference = after.log_brightness - before.log_brightness
    np.testing.assert_allclose(difference - difference.mean(), 0.0, atol=1e-3)
    np.testing.assert_allclose(after.sigma, before.sigma, rtol=1e-3)


@given(
    peak_nm=st.floats(380.0, 680.0),
    fwhm_nm=st.floats(8.0, 40.0),
    level=st.floats(-200.0, 200.0),
    seed=st.integers(0, 1000),
)
def test_a_band_is_found_whatever_the_dark_level(
    peak_nm: float, fwhm_nm: float, level: float, seed: int
) -> None:
    grid_nm = np.arange(270.0, 880.0, 0.35)
    true = np.exp(-(((grid_nm - peak_nm) / fwhm_nm * 2.355) ** 2) / 2)
    rng = np.random.default_rng(seed)
    sigma = np.full(len(grid_nm), 10.0)
    band = led_band("one", grid_nm, 2e4 * true + level + rng.normal(0.0, sigma), sigma)
    assert band is not None
    assert band.centroid_nm == pytest.approx(peak_nm, abs=0.1)
    assert band.light == pytest.approx(2e4 * true.sum() * 0.35, rel=0.005)
    assert band.spectrum.wavelength_nm[0] > peak_nm - 4 * fwhm_nm


def test_no_light_is_no_band_and_light_beside_is_told() -> None:
    grid_nm, rng = np.arange(350.0, 750.0, 0.35), np.random.default_rng(1)
    noise = rng.normal(0.0, 10.0, len(grid_nm))
    sigma = np.full(len(grid_nm), 10.0)
    assert led_band("dark", grid_nm, noise + 50.0, sigma) is None
    two = 1e4 * led(455.0, 18.0).at(grid_nm) + 2e3 * led(590.0, 16.0).at(grid_nm)
    band = led_band("455 nm", grid_nm, two + noise, sigma)
    assert band is not None
    part, part_sigma = light_within(band, 560.0, 620.0)
    assert part == pytest.approx(0.2 * 16 / 18, rel=0.02)
    assert part_sigma < 0.01
    assert abs(light_within(band, 650.0, 700.0)[0]) < 0.01


def lights() -> dict[str, Spectrum]:
    return {
        f"{peak_nm:g} nm": led(peak_nm, fwhm_nm)
        for peak_nm, fwhm_nm in zip(PEAK_NM, FWHM_NM, strict=True)
    }


@pytest.mark.parametrize("seed", range(3))
def test_channels_tell_which_led_is_lit(seed: int) -> None:
    rng = np.random.default_rng(seed)
    camera = bent(rng)
    for name, peak_nm, fwhm_nm in zip(lights(), PEAK_NM, FWHM_NM, strict=True):
        if peak_nm < 420 or 470 < peak_nm < 600:
            continue
        value = seen(led(peak_nm + rng.normal(), fwhm_nm, 0.1), camera)
        variance = (0.002 * value) ** 2 + 1e-10
        assert not match_channels(name, value, variance, lights(), HOUSE, WHITE).is_odd(name)
        other = "625 nm" if peak_nm < 560 else "455 nm"
        assert match_channels(other, value, variance, lights(), HOUSE, WHITE).is_odd(other)
        mixed = value + 0.6 * seen(lights()[other], camera)
        match = match_channels(name, mixed, variance, lights(), HOUSE, WHITE)
        assert match.is_odd(name)
