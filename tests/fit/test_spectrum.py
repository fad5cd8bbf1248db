"""A spectrum from one picture through a variable filter."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray

from labrig.fit.spectrum import (
    CurveError,
    SpectralSystem,
    fit_spectrum,
    nonnegative_minimum,
    system_through_lvf,
)
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from labrig.foundation.nonnegative import nonnegative_least_squares
from labrig.optics import CameraResponse, Spectrum
from tests.fit import lvf_pictures as made

FINE_NM = np.arange(380.0, 721.0, 1.0)


def broad(centre_nm: float, fwhm_nm: float) -> Spectrum:
    return Spectrum("broad", FINE_NM, np.exp(-np.log(16) * ((FINE_NM - centre_nm) / fwhm_nm) ** 2))


GREEN = broad(525.0, 70.0)


@settings(max_examples=25)
@given(seed=st.integers(0, 10**6), n=st.integers(1, 30))
def test_quadratic_functions_have_their_least_where_lawson_and_hanson_find_it(
    seed: int, n: int
) -> None:
    rng = np.random.default_rng(seed)
    design, target = rng.standard_normal((n + 3, n)), rng.standard_normal(n + 3)
    found = nonnegative_minimum(design.T @ design, design.T @ target, rng.random(n) < 0.5)
    np.testing.assert_allclose(found, nonnegative_least_squares(design, target), atol=1e-8)


def fitted(
    light: Spectrum,
    camera: CameraResponse,
    seed: int = 0,
    missing: FloatArray | None = None,
    error: CurveError | None = None,
) -> tuple[FloatArray, NDArray[np.bool_], FloatArray]:
    """Of every band error over the peak, whether it is inside 95 %, and σ over the peak."""
    lvf = made.curved_lvf()
    picture = made.photographed(light, lvf, camera, np.random.default_rng(seed))
    value = picture.value if missing is None else picture.value + missing
    system = system_through_lvf(lvf, made.of_the_house() if error else camera, made.KNOTS_NM, error)
    bands = fit_spectrum(value, picture.sigma, system).in_bands(made.EDGES_NM, 0.95)
    truth = light.in_bands(made.EDGES_NM)
    inside = (bands.low <= truth) & (truth <= bands.high)
    return (bands.value - truth) / truth.max(), inside, bands.sigma / truth.max()


def test_a_smooth_spectrum_comes_back() -> None:
    error, inside, sigma = fitted(GREEN, made.of_the_house())
    # At the ends the camera sees 2 % of what it sees in the middle.
    assert np.abs(error[2:-2]).max() < 0.01
    assert np.abs(error).max() < 0.03
    assert inside.mean() > 0.9
    assert 1e-4 < sigma.max() < 0.02


@pytest.mark.campaign
def test_the_band_covers_what_it_says() -> None:
    rng = np.random.default_rng(5)
    lights = [broad(rng.uniform(450, 640), rng.uniform(35, 110)) for _ in range(8)]
    inside = [fitted(light, made.of_the_house(), seed)[1] for seed, light in enumerate(lights)]
    assert 0.9 < np.mean(inside) <= 1.0


def test_clipped_positions_cost_certainty_only_where_they_are() -> None:
    missing = np.zeros((31, 3))
    missing[11:14] = np.nan
    whole = fitted(GREEN, made.of_the_house())[2]
    error, inside, sigma = fitted(GREEN, made.of_the_house(), missing=missing.ravel())
    assert np.abs(error).max() < 0.1
    assert inside.mean() > 0.9
    assert sigma[12] > 2 * whole[12]
    assert sigma[25] < 3 * whole[25]


def test_a_camera_without_colours() -> None:
    nm = np.array([380.0, 450.0, 550.0, 780.0])
    grey = CameraResponse("grey", nm, np.array([[0.2], [0.8], [1.0], [0.1]]), ("L",))
    error, inside, _ = fitted(GREEN, grey)
    assert np.abs(error).max() < 0.02
    assert inside.mean() > 0.9


def test_curves_that_are_wrong_are_in_the_band_if_it_is_reported_so() -> None:
    ours = made.of_the_house()
    bend = 1 + 0.08 * np.sin(ours.wavelength_nm / 25.0)
    theirs = replace(ours, sensitivity=ours.sensitivity * bend[:, np.newaxis])
    error, inside, sigma = fitted(GREEN, theirs, error=CurveError())
    assert np.abs(error).max() > 0.02
    assert inside.mean() > 0.9
    assert sigma.max() > 3 * fitted(GREEN, ours)[2].max()


def test_the_same_values_give_the_same_spectrum() -> None:
    lvf, camera = made.curved_lvf(), made.of_the_house()
    picture = made.photographed(GREEN, lvf, camera, np.random.default_rng(0))
    system = system_through_lvf(lvf, camera, made.KNOTS_NM)
    fits = [fit_spectrum(picture.value * k, picture.sigma * k, system) for k in (1.0, 1.0, 1e6)]
    np.testing.assert_array_equal(fits[0].samples, fits[1].samples)
    np.testing.assert_allclose(fits[0].value * 1e6, fits[2].value, rtol=1e-4, atol=1e-3)
    assert (fits[0].samples >= 0).all()


@pytest.mark.parametrize(
    ("value", "sigma", "said"),
    [
        (np.full(93, np.nan), np.ones(93), "neither clipped nor missing, got 0"),
        (np.full(93, -1.0), np.ones(93), "none above their noise"),
        (np.ones(93), np.zeros(93), "σ above 0"),
    ],
)
def test_values_that_say_nothing(value: FloatArray, sigma: FloatArray, said: str) -> None:
    system = SpectralSystem(made.KNOTS_NM, np.ones((93, len(made.KNOTS_NM))))
    with pytest.raises(FitError, match=said):
        fit_spectrum(value, sigma, system)
