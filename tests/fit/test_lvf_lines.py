"""Mercury lines along a variable filter, and the wavelengths they give."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from labrig.fit.lvf import MERCURY, Line, fit_wavelengths, locate_lines
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from labrig.optics import (
    Bands,
    CameraResponse,
    Lvf,
    Spectrum,
    WavelengthMap,
    read_spectrum,
    signal_through,
)
from labrig.results.strip_profile import LocatedLines
from tests.fit import lvf_pictures as made

PIXELS = np.arange(0.0, 1001.0, 2.0)
SPAN = (0.0, 1000.0)
GREY = CameraResponse("grey", np.array([380.0, 780.0]), np.array([[0.8], [1.0]]), ("L",))


def strip(bend_nm: float = 6.0) -> tuple[WavelengthMap, Lvf]:
    """Skewed bands that widen along the strip, and leak."""
    wavelengths = WavelengthMap(np.array([550.0, 170.0, bend_nm]), SPAN)
    centre = wavelengths.wavelength_nm(PIXELS)
    one = np.ones_like(centre)
    return wavelengths, Lvf(PIXELS, Bands(centre, 25 * centre / 550, 0.08 * one, one, 0.002 * one))


def picture(lvf: Lvf, camera: CameraResponse, seed: int = 0) -> FloatArray:
    rng = np.random.default_rng(seed)
    seen = signal_through(lvf, camera, made.mercury_lamp(rng))
    seen = seen / seen.max()
    noisy: FloatArray = seen + np.sqrt(seen + 0.001) / 200 * rng.standard_normal(seen.shape)
    return noisy


@pytest.mark.parametrize(
    "seed",
    [0, pytest.param(1, marks=pytest.mark.campaign), pytest.param(2, marks=pytest.mark.campaign)],
)
def test_four_lines_in_colour(seed: int) -> None:
    wavelengths, lvf = strip()
    found = locate_lines(PIXELS, picture(lvf, made.of_the_house(), seed), rising=True)
    np.testing.assert_allclose(found.wavelength_nm, [404.6565, 435.8335, 546.075, 576.961])
    error = found.position - wavelengths.position(found.wavelength_nm)
    # 3 pixels are 1 nm; the 404.7 nm line is seen by 2 % of the camera's peak.
    assert np.abs(error[1:3]).max() < 0.3
    assert np.abs(error).max() < 3
    assert (np.abs(error) < 4 * np.hypot(found.sigma, 0.1)).all()


def test_a_strip_that_is_turned_is_seen_and_refused_if_that_was_not_said() -> None:
    _, lvf = strip()
    turned = picture(lvf, made.of_the_house())[::-1]
    assert not locate_lines(PIXELS, turned).rising
    with pytest.raises(FitError, match="the wrong way round"):
        locate_lines(PIXELS, turned, rising=True)


def test_without_colours_it_has_to_be_reported() -> None:
    wavelengths, lvf = strip()
    grey = picture(lvf, GREY)
    with pytest.raises(FitError, match="say whether the wavelength rises"):
        locate_lines(PIXELS, grey)
    found = locate_lines(PIXELS, grey, rising=True)
    error = found.position - wavelengths.position(found.wavelength_nm)
    assert (np.abs(error) < 4 * np.hypot(found.sigma, 0.1)).all()


def test_what_is_not_known_of_a_blend_is_in_its_sigma() -> None:
    _, lvf = strip()
    found = locate_lines(PIXELS, picture(lvf, GREY), rising=True)
    pixels_per_nm = 2.9
    for line, sigma in zip(MERCURY, found.sigma, strict=True):
        apart_nm = float(np.ptp(line.wavelength_nm))
        assert sigma > pixels_per_nm * apart_nm * line.second_fraction[1]


def test_pictures_without_lines() -> None:
    _, lvf = strip()
    lit = made.lines({}, continuum=1.0)
    noise = np.random.default_rng(0).standard_normal((len(PIXELS), 3))
    for profile in (signal_through(lvf, made.of_the_house(), lit), noise, 0 * noise):
        with pytest.raises(FitError, match="no lines of mercury"):
            locate_lines(PIXELS, profile)
    with pytest.raises(FitError, match="finite values"):
        locate_lines(PIXELS, np.full(len(PIXELS), np.nan))


@pytest.mark.parametrize(("bend_nm", "order"), [(0.0, 1), (6.0, 2)])
def test_the_wavelength_along_the_strip(bend_nm: float, order: int) -> None:
    wavelengths, lvf = strip(bend_nm)
    found = fit_wavelengths(locate_lines(PIXELS, picture(lvf, made.of_the_house())), SPAN)
    assert found.order == order
    at = wavelengths.position([400.0, 450.0, 550.0, 650.0, 700.0])
    error = found.map.wavelength_nm(at) - [400, 450, 550, 650, 700]
    sigma = found.map.sigma_nm(at)
    assert (np.abs(error) < 3 * sigma).all()
    assert np.abs(error[:3]).max() < 1.0
    # 700 nm is 120 nm beyond the last line.
    assert sigma[4] > 5 * sigma[2]


def test_a_bend_too_small_to_be_believed_is_in_the_sigma_beyond_the_lines() -> None:
    wavelengths, lvf = strip(3.0)
    found = fit_wavelengths(locate_lines(PIXELS, picture(lvf, made.of_the_house())), SPAN)
    assert found.order == 1
    at = wavelengths.position(700.0)
    error, sigma = abs(found.map.wavelength_nm(at)[0] - 700.0), found.map.sigma_nm(at)[0]
    assert 2.0 < error < 1.6 * sigma


def test_lines_that_cannot_be_are_refused() -> None:
    wrong = np.array([100.0, 500.0, 300.0])
    lines = LocatedLines(np.array([435.8, 546.1, 577.0]), wrong, np.ones(3), 70.0, True, 1.0)
    with pytest.raises(FitError, match="does not rise or fall"):
        fit_wavelengths(lines, SPAN)
    assert (
        fit_wavelengths(replace(lines, position=np.array([100.0, 430.0, 520.0])), SPAN).order == 1
    )


def test_the_lines_are_those_of_a_spectrographs_table(real_data: Path) -> None:
    """Å in air, with heights in another instrument."""
    table = np.loadtxt(real_data / "hg_lines/hgar.arc", comments=["#", "*"])
    mercury = {round(float(nm), 4) for nm in table[:, 0] / 10 if nm < 700}
    assert {nm for line in MERCURY for nm in line.wavelength_nm} <= mercury


def rms_nm(lamp: Spectrum, lines: tuple[Line, ...], low_nm: float, count: int) -> float:
    """What is left of the lines' wavelengths after a straight line through where they are."""
    part = (lamp.wavelength_nm > low_nm) & (lamp.wavelength_nm < 590)
    found = locate_lines(lamp.wavelength_nm[part], lamp.value[part], lines=lines, fwhm_nm=1.2)
    assert len(found.position) == count
    straight = np.polyfit(found.position, found.wavelength_nm, 1)
    return float(np.std(np.polyval(straight, found.position) - found.wavelength_nm))


@pytest.mark.parametrize("seed", range(3))
def test_lines_of_a_spectrometer_a_third_of_a_nanometre_off(seed: int) -> None:
    """Pixels of 0.45 nm, lines of 1.2 nm, as of the real one below."""
    rng = np.random.default_rng(seed)
    nm = np.arange(380.0, 600.0, 0.45)
    apart_nm = (nm - 0.3)[:, np.newaxis] - made.MERCURY_NM
    value = np.exp(-4 * np.log(2) * (apart_nm / 1.2) ** 2) @ made.MERCURY_HEIGHTS + 0.002
    lamp = Spectrum("made", nm, value + 5e-4 * rng.standard_normal(len(nm)))
    assert rms_nm(lamp, MERCURY, 395, 4) < 0.02


def test_a_real_mercury_lamp(shared_data: Path) -> None:
    table = shared_data / "light_sources/photobiology/lamps.csv"
    lamp = read_spectrum(table, "Generic.germicidal")
    # Measured: 0.004 nm for the visible lines.
    assert rms_nm(lamp, MERCURY, 395, 4) < 0.02
    with_ultraviolet = (Line((253.6517,)), Line((365.0158,)), *MERCURY)
    assert rms_nm(lamp, with_ultraviolet, 250, 4) < 0.1
