"""Albedo from ratios to a card: σ, luminescence, what a filter throws back."""

from dataclasses import replace

import numpy as np
import pytest

from labrig.fit.reflectance import (
    LitStrip,
    Luminescence,
    StripLight,
    fit_albedo,
    luminescence_by_glow,
    relative_to_card,
)
from labrig.fit.spectrum import SpectralSystem, fit_spectrum
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from labrig.optics import Transmittance
from tests.pulls import assert_sigma_is_right

KNOTS_NM = np.arange(390.0, 711.0, 10.0)
CENTRE_NM = np.linspace(400.0, 700.0, 31)
CARD = Transmittance("grey", np.array([380.0, 720.0]), np.array([0.17, 0.19]))
#: Two channels: blind to the blue, and to the red.
CHANNELS = np.stack([1 / (1 + np.exp(s * (KNOTS_NM - 550) / 40)) + 0.02 for s in (1, -1)])
GLOW = np.exp(-(((KNOTS_NM - 480) / 30) ** 2))
NOISE = 0.003


def system() -> SpectralSystem:
    bands = np.exp(-4 * np.log(2) * ((KNOTS_NM - CENTRE_NM[:, np.newaxis]) / 25) ** 2)
    rows = bands[:, np.newaxis] * CHANNELS
    return SpectralSystem(KNOTS_NM, rows.reshape(-1, len(KNOTS_NM)))


def ratios(
    albedo: FloatArray, rng: np.random.Generator, prompt: float = 0.0
) -> tuple[LitStrip, LitStrip]:
    """By white and by narrow light, glow and prompt fluorescence of one colour."""
    light, relative = system(), relative_to_card(system(), CARD)
    of_card = light.design @ CARD.at(KNOTS_NM)
    seen = 0.01 * (light.design @ GLOW) / of_card
    excited = np.exp(-(((CENTRE_NM - 430) / 30) ** 2))
    colour = np.kron(np.eye(31), CHANNELS @ GLOW) / of_card
    own = colour * (0.01 * excited[:, np.newaxis])
    strips = []
    for glow, courses in ((seen, seen[np.newaxis]), (own.sum(axis=0), colour)):
        value = relative.design @ albedo + (1 + prompt) * glow
        value = value + NOISE * value * rng.standard_normal(len(value))
        dark = np.zeros_like(glow)
        strips.append(LitStrip(value, NOISE * value, relative, glow, dark, courses, 1e-6))
    white, narrow = strips
    return white, narrow


def fluorescent(
    albedo: FloatArray, rng: np.random.Generator, *, is_stokes: bool = False
) -> tuple[LitStrip, LitStrip, Luminescence]:
    """By white and by narrow light, fluorescence of a matrix of light in and light out.

    If it `is_stokes`, light excites the part of the emission at longer wavelengths than its own.
    """
    light, relative = system(), relative_to_card(system(), CARD)
    bands = light.design.reshape(31, 2, -1)[:, 0] / CHANNELS[0]
    of_card = (light.design @ CARD.at(KNOTS_NM)).reshape(31, 2)
    excites = 0.4 * np.exp(-(((KNOTS_NM - 440) / 30) ** 2))
    emitted = np.outer(GLOW / GLOW.sum(), excites)
    if is_stokes:
        emitted *= KNOTS_NM[:, np.newaxis] >= KNOTS_NM
    by_white = np.einsum("pk,ck,kj->pc", bands, CHANNELS, emitted)
    by_narrow = np.einsum("ck,kj,pj->pc", CHANNELS, emitted, bands)
    glow = 0.01 * (light.design @ GLOW).reshape(31, 2)
    # Of places 10 nm apart the bands add up to one of all wavelengths.
    weight = np.full(31, 10.0 / (10.0 * bands[15].sum()))
    places = StripLight(CENTRE_NM, of_card, weight)
    none = np.zeros(31)
    excited = luminescence_by_glow(glow, places, places, ultraviolet=none, is_direct=True)
    colour = np.kron(np.eye(31), CHANNELS @ GLOW) / of_card.ravel()
    steady = (glow / of_card).ravel()
    strips = []
    for seen, courses in ((by_white, steady[np.newaxis]), (by_narrow, colour)):
        value = relative.design @ albedo + (seen / of_card).ravel()
        value = value + NOISE * value * rng.standard_normal(len(value))
        dark = np.zeros_like(value)
        strips.append(LitStrip(value, NOISE * value, relative, steady, dark, courses, 1e-6))
    return strips[0], strips[1], excited


def drawn(rng: np.random.Generator, over_nm: float = 60.0) -> FloatArray:
    """A reflectance of Matérn's kind (3/2), rougher than that of the prior."""
    away = np.sqrt(3) * np.abs(KNOTS_NM - KNOTS_NM[:, np.newaxis]) / over_nm
    covariance = (1 + away) * np.exp(-away) + 1e-9 * np.eye(len(KNOTS_NM))
    course = np.linalg.cholesky(covariance) @ rng.standard_normal(len(KNOTS_NM))
    return np.asarray(0.45 + 0.08 * course)


def thrown_back(strip: LitStrip, albedo: FloatArray, part: float) -> LitStrip:
    """A sample below a filter that throws back a part of its light, and of the card's."""
    excess = np.interp(CENTRE_NM, KNOTS_NM, albedo - CARD.at(KNOTS_NM))
    return replace(strip, value=strip.value * (1 + part * np.repeat(excess, 2)))


@pytest.mark.campaign
def test_the_sigma_is_right() -> None:
    pulls = []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        albedo = drawn(rng)
        white, narrow = ratios(albedo, rng)
        narrow = thrown_back(narrow, albedo, 0.02 * rng.standard_normal())
        fit = fit_albedo(white, narrow, CARD)
        judged = np.searchsorted(KNOTS_NM, [430, 480, 530, 580, 630, 670])
        sigma = fit.albedo.samples.std(axis=0, ddof=1)
        pulls.append(((fit.albedo.value - albedo) / sigma)[judged])
        assert not fit.is_prompt
    assert_sigma_is_right(pulls)


@pytest.mark.parametrize("is_stokes", [False, True], ids=["as the glow", "beyond the light"])
def test_one_excitation_explains_the_luminescence_of_both_strips(is_stokes: bool) -> None:
    """Emission that the exciting light cuts off is none that the fit has for likely."""
    rng = np.random.default_rng(2)
    albedo = drawn(rng)
    white, narrow, excited = fluorescent(albedo, rng, is_stokes=is_stokes)
    fit = fit_albedo(white, narrow, CARD, excited)
    assert fit.is_prompt
    judged = (KNOTS_NM >= 430) & (KNOTS_NM <= 680)
    error, sigma = fit.albedo.value - albedo, fit.albedo.samples.std(axis=0, ddof=1)
    assert np.abs(error)[judged].max() < (0.03 if is_stokes else 0.02)
    assert np.abs(error / sigma)[judged].max() < 4
    if is_stokes:
        free = fit_albedo(white, narrow, CARD)
        assert np.abs(error)[judged].max() < np.abs(free.albedo.value - albedo)[judged].max()


@pytest.mark.campaign
def test_the_sigma_beside_fluorescence_is_right() -> None:
    pulls = []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        albedo = drawn(rng)
        white, narrow, excited = fluorescent(albedo, rng)
        fit = fit_albedo(white, narrow, CARD, excited)
        judged = np.searchsorted(KNOTS_NM, [430, 480, 530, 580, 630, 670])
        sigma = fit.albedo.samples.std(axis=0, ddof=1)
        pulls.append(((fit.albedo.value - albedo) / sigma)[judged])
    assert_sigma_is_right(pulls)


def test_an_edge_is_rougher_than_what_is_beside_it() -> None:
    """An even prior draws it too flat, and gives too large a σ to what is straight."""
    relative, rng = relative_to_card(system(), CARD), np.random.default_rng(5)
    albedo = 0.1 + 0.6 / (1 + np.exp(-(KNOTS_NM - 555) / 6))
    value = relative.design @ albedo
    sigma = NOISE * value
    value = value + sigma * rng.standard_normal(len(value))
    even, local = (
        fit_spectrum(value, sigma, relative, decisive=np.inf, stiffest=1e5, is_local=is_local)
        for is_local in (False, True)
    )
    straight = (KNOTS_NM >= 430) & (KNOTS_NM <= 500)
    spread = [fit.samples.std(axis=0)[straight].mean() for fit in (even, local)]
    assert spread[1] < 0.7 * spread[0]
    errors = [np.abs(fit.value - albedo)[3:-3].max() for fit in (even, local)]
    assert errors[1] < errors[0]
    assert errors[1] < 0.02


def test_the_radiance_factor_has_the_luminescence_in_it() -> None:
    rng = np.random.default_rng(1)
    albedo = drawn(rng)
    white, narrow = ratios(albedo, rng, prompt=20.0)
    fit = fit_albedo(white, narrow, CARD)
    assert fit.is_prompt
    error = (fit.albedo.value - albedo)[3:-3]
    assert np.abs(error / fit.albedo.samples.std(axis=0)[3:-3]).max() < 4
    assert np.abs(error).max() < 0.02
    excess = fit.radiance_factor.value - fit.albedo.value
    at = np.searchsorted(KNOTS_NM, [480, 650])
    assert excess[at] == pytest.approx([0.21, 0.0], abs=0.02)
    assert fit.amount == pytest.approx(21, abs=3 * fit.amount_sigma)
    assert fit.amount_sigma < 2


def test_what_a_filter_throws_back_is_found() -> None:
    """Below it a bright sample is brighter than beside it, over the card by its excess."""
    rng = np.random.default_rng(2)
    albedo = np.linspace(0.2, 0.9, len(KNOTS_NM))
    white, narrow = ratios(albedo, rng)
    assert abs(fit_albedo(white, narrow, CARD).thrown_back) < 0.01
    fit = fit_albedo(white, thrown_back(narrow, albedo, 0.05), CARD)
    assert fit.thrown_back == pytest.approx(0.05, abs=3 * fit.thrown_back_sigma)
    assert fit.thrown_back_sigma < 0.01
    error = fit.albedo.value - albedo
    assert np.abs(error / fit.albedo.samples.std(axis=0))[3:-3].max() < 4


def test_no_light_is_refused() -> None:
    white, narrow = ratios(np.full(len(KNOTS_NM), 0.2), np.random.default_rng(3))
    dark = replace(white, value=np.full_like(white.value, np.nan))
    with pytest.raises(FitError, match="expected light of sample and card"):
        fit_albedo(dark, narrow, CARD)
