"""Albedo from ratios to a card: σ, luminescence, what a filter throws back."""

from dataclasses import replace

import numpy as np
import pytest

from labrig.errors import FitError
from labrig.fit.least_squares import FloatArray
from labrig.fit.reflectance import LitStrip, fit_albedo, relative_to_card
from labrig.fit.spectrum import SpectralSystem
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
