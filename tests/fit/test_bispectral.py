"""Columns from spectra: σ of the scale and of the lights, lights that cannot be seen."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from labrig.fit import IlluminatedSpectrum, bispectral_columns, separate_columns
from labrig.fit.bispectral import band_weights_nm
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.optics import band_integrals, edges_from_centres
from tests.pulls import assert_sigma_is_right

NM = np.arange(380.0, 781.0, 1.0)
OUTPUT_NM = np.arange(400.0, 761.0, 10.0)
EDGES_NM = edges_from_centres(OUTPUT_NM)
LIGHTS = ((430.0, 8.0, 12.0), (465.0, 13.0, 9.0), (500.0, 10.0, 16.0))


def skewed(peak_nm: float, below_nm: float, above_nm: float) -> FloatArray:
    off_nm = NM - peak_nm
    shape: FloatArray = np.exp(-((off_nm / np.where(off_nm < 0, below_nm, above_nm)) ** 2))
    return shape


def surface(light: FloatArray, part: float) -> FloatArray:
    """What two dyes of skewed emission and a rising reflectance make of a light."""
    emission = skewed(540.0, 20.0, 45.0) + 0.5 * skewed(620.0, 15.0, 60.0)
    emission /= np.trapezoid(emission, NM)
    reflectance = 0.1 + 0.6 / (1 + np.exp(-(NM - 580) / 12))
    back: FloatArray = reflectance * light + part * np.trapezoid(light, NM) * emission
    return back


def columns_of(
    rng: np.random.Generator, noise: float = 0.0, scale: float = 0.0, change: float = 0.0
) -> FloatArray:
    """Errors over σ of the columns of one measurement with errors of that σ."""
    band = np.clip(np.searchsorted(EDGES_NM, NM) - 1, 0, len(OUTPUT_NM) - 1)
    factor = (1 + scale * rng.normal(size=len(OUTPUT_NM)))[band]
    lights: list[IlluminatedSpectrum] = []
    samples: list[IlluminatedSpectrum] = []
    truth: list[FloatArray] = []
    for part, shape in zip((0.4, 0.3, 0.1), LIGHTS, strict=True):
        light = skewed(*shape)
        back = surface(light, part)
        truth.append(band_integrals(NM, back, EDGES_NM) / np.trapezoid(light, NM))
        changed = (1 + change * rng.normal()) * back
        for kept, clean in ((lights, light), (samples, changed)):
            value = factor * clean + rng.normal(0, noise or 1e-9, len(NM))
            kept.append(IlluminatedSpectrum(NM, value, np.full(len(NM), noise or 1e-9)))
    columns = bispectral_columns(
        lights, samples, OUTPUT_NM, np.full(len(OUTPUT_NM), scale), np.full(3, change)
    )
    error: FloatArray = columns.column - np.array(truth).T
    return error / columns.column_sigma


@pytest.mark.parametrize(
    ("errors", "seed"),
    [
        pytest.param({"noise": 3e-3}, 1, marks=pytest.mark.campaign),
        ({"noise": 1e-4, "scale": 0.02}, 2),
        ({"noise": 1e-4, "change": 0.02}, 3),
    ],
)
def test_sigma_is_that_of_the_errors(errors: dict[str, float], seed: int) -> None:
    rng = np.random.default_rng(seed)
    pulls = np.array([columns_of(rng, **errors) for _ in range(150)])
    # What has next to no light in it has the errors of its noise alone.
    assert_sigma_is_right(pulls)


def test_the_order_of_the_lights_is_that_of_their_wavelengths() -> None:
    noise = np.full(len(NM), 1e-6)
    spectra = [IlluminatedSpectrum(NM, skewed(*shape), noise) for shape in LIGHTS]
    backs = [IlluminatedSpectrum(NM, surface(skewed(*shape), 0.3), noise) for shape in LIGHTS]
    rising = bispectral_columns(spectra, backs, OUTPUT_NM)
    falling = bispectral_columns(spectra[::-1], backs[::-1], OUTPUT_NM)
    assert falling.order.tolist() == [2, 1, 0]
    assert np.array_equal(rising.column, falling.column)
    separated = separate_columns(rising)
    assert (np.diff(rising.light_nm) > 0).all()
    beyond = OUTPUT_NM > 560
    expected = band_integrals(NM, surface(skewed(*LIGHTS[0]), 0.3), EDGES_NM)[beyond]
    power = np.trapezoid(skewed(*LIGHTS[0]), NM)
    assert separated.reradiated[beyond, 0] == pytest.approx(expected / power, abs=1e-5)
    assert np.isnan(separated.reflectance[OUTPUT_NM > 600]).all()


def test_what_is_no_light_is_refused_in_one_line() -> None:
    dark = IlluminatedSpectrum(NM, np.zeros(len(NM)), np.ones(len(NM)))
    with pytest.raises(DataError, match="expected light on the white reference, got none"):
        bispectral_columns([dark], [dark], OUTPUT_NM)
    with pytest.raises(DataError, match="expected a spectrum of the sample for every light"):
        bispectral_columns([dark], [], OUTPUT_NM)


@given(
    seed=st.integers(0, 10_000),
    edges=st.lists(st.floats(300.0, 900.0), min_size=2, max_size=8, unique=True),
)
def test_weights_of_bands_are_exact_for_piecewise_linear_curves(
    seed: int, edges: list[float]
) -> None:
    rng = np.random.default_rng(seed)
    nm = np.sort(rng.uniform(350.0, 850.0, 40))
    values = rng.normal(size=40)
    edges_nm = np.sort(np.array(edges))
    weights = band_weights_nm(nm, edges_nm)
    assert weights @ values == pytest.approx(band_integrals(nm, values, edges_nm), abs=1e-6)
