"""Lines much narrower than the filter's band, in a spectrum of which nothing is known before."""

import numpy as np
import pytest

from labrig.fit.least_squares import FloatArray
from labrig.fit.spectrum import SpectrumFit, fit_spectrum, system_through_lvf
from labrig.optics import Spectrum, band_means
from tests.fit import lvf_pictures as made

FINE_NM = np.arange(380.0, 720.1, 0.25)
SYSTEM = system_through_lvf(made.curved_lvf(), made.of_the_house(), made.KNOTS_NM)
#: Draws: few, for speed.
SAMPLES = 60


def gaussian(centre_nm: float, fwhm_nm: float, height: float = 1.0) -> FloatArray:
    shape: FloatArray = height * np.exp(-np.log(16) * ((FINE_NM - centre_nm) / fwhm_nm) ** 2)
    return shape


def fitted(value: FloatArray, seed: int) -> tuple[Spectrum, SpectrumFit]:
    light = Spectrum("lines", FINE_NM, value)
    rng = np.random.default_rng(seed)
    picture = made.photographed(light, made.curved_lvf(), made.of_the_house(), rng)
    return light, fit_spectrum(picture.value, picture.sigma, SYSTEM, samples=SAMPLES)


def in_sigma(light: Spectrum, fit: SpectrumFit, edges_nm: FloatArray) -> FloatArray:
    """Errors of the means over bands above 2 % of the peak, in σ."""
    draws = band_means(fit.knots_nm, fit.samples.T, edges_nm)
    true = light.in_bands(edges_nm)
    bright = true > 0.02 * true.max()
    pulls: FloatArray = ((draws.mean(axis=1) - true) / draws.std(axis=1, ddof=1))[bright]
    return pulls


@pytest.mark.parametrize(("fwhm_nm", "seed"), [(5.0, 1), (8.0, 2)])
def test_a_line_is_in_its_place_and_in_its_band(fwhm_nm: float, seed: int) -> None:
    light, fit = fitted(gaussian(543.0, fwhm_nm), seed)
    (line,) = fit.lines
    assert line.wavelength_nm == pytest.approx(543.0, abs=0.3)
    assert np.abs(in_sigma(light, fit, made.EDGES_NM)).max() < 3
    # How the light is divided between bands is open; its sum is not.
    around = np.array([518.0, 568.0])
    draws = band_means(fit.knots_nm, fit.samples.T, around)[0]
    assert draws.mean() == pytest.approx(float(light.in_bands(around)[0]), rel=0.02)
    bands = band_means(fit.knots_nm, fit.samples.T, made.EDGES_NM)
    assert draws.std() / draws.mean() < 0.3 * bands.std(axis=1).max() / bands.mean(axis=1).max()


def test_a_line_on_a_band() -> None:
    light, fit = fitted(gaussian(530.0, 90.0) + gaussian(590.0, 6.0, 2.0), 3)
    (line,) = fit.lines
    assert line.wavelength_nm == pytest.approx(590.0, abs=0.5)
    assert np.abs(in_sigma(light, fit, made.EDGES_NM)).max() < 4


def test_broad_spectra_have_no_lines() -> None:
    for seed, (centre_nm, fwhm_nm) in enumerate([(470.0, 50.0), (530.0, 80.0), (600.0, 110.0)]):
        assert fitted(gaussian(centre_nm, fwhm_nm), seed)[1].lines == ()


@pytest.mark.campaign
@pytest.mark.skipif(not made.DATA.is_dir(), reason="the folder of real data is not there")
@pytest.mark.shared_data
def test_lines_of_mercury_are_in_their_bands() -> None:
    """Much narrower than any feature of the fit, and close to edges of bands."""
    pulls = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        lamp = made.mercury_lamp(rng)
        picture = made.photographed(lamp, made.curved_lvf(), made.of_the_house(), rng)
        fit = fit_spectrum(picture.value, picture.sigma, SYSTEM, samples=SAMPLES)
        assert len(fit.lines) == 4
        pulls.append(in_sigma(lamp, fit, made.EDGES_NM))
    assert np.sqrt(np.mean(np.square(np.concatenate(pulls)))) < 1.8
