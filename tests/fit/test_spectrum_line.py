"""A single narrow line through a variable filter, and by sensors that are known badly."""

import numpy as np
import pytest

from labrig.fit.spectrum import (
    CurveError,
    LineFit,
    SpectralSystem,
    fit_line,
    system_through_lvf,
)
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from labrig.optics import Spectrum
from tests.fit import lvf_pictures as made

FINE_NM = np.arange(380.0, 721.0, 0.5)
FWHM_NM = 8.0
SYSTEM = system_through_lvf(made.curved_lvf(), made.of_the_house(), made.KNOTS_NM)


def line(centre_nm: float, fwhm_nm: float = FWHM_NM) -> Spectrum:
    return Spectrum("line", FINE_NM, np.exp(-np.log(16) * ((FINE_NM - centre_nm) / fwhm_nm) ** 2))


def photographed(light: Spectrum, seed: int, snr: float = 100.0) -> made.Picture:
    rng = np.random.default_rng(seed)
    return made.photographed(light, made.curved_lvf(), made.of_the_house(), rng, snr)


def found(
    centre_nm: float, seed: int, system: SpectralSystem = SYSTEM, snr: float = 100.0
) -> LineFit:
    picture = photographed(line(centre_nm), seed, snr)
    return fit_line(picture.value, picture.sigma, system, FWHM_NM)


def test_lines_are_found_as_well_as_their_sigma_says() -> None:
    centres = np.linspace(431.3, 655.9, 11)
    fits = [found(centre, seed) for seed, centre in enumerate(centres)]
    off = [(fit.wavelength_nm - nm) / fit.sigma_nm for fit, nm in zip(fits, centres, strict=True)]
    assert 0.6 < np.sqrt(np.mean(np.square(off))) < 1.5
    assert max(fit.sigma_nm for fit in fits) < 0.2
    area = float(np.trapezoid(line(550.0).at(FINE_NM), FINE_NM))
    assert [fit.strength for fit in fits] == pytest.approx([area] * len(fits), rel=0.05)
    assert np.mean([fit.misfit for fit in fits]) == pytest.approx(1.0, abs=0.1)


def test_curves_known_badly_make_the_line_less_certain() -> None:
    """In a picture with hardly any noise they are all that is left."""
    lvf, ours = made.curved_lvf(), made.of_the_house()
    unsure = system_through_lvf(lvf, ours, made.KNOTS_NM, CurveError())
    exact, rough = found(537.0, 1, snr=1e4), found(537.0, 1, unsure, snr=1e4)
    assert rough.wavelength_nm == pytest.approx(537.0, abs=3 * rough.sigma_nm)
    assert rough.sigma_nm > 2 * exact.sigma_nm


def test_values_that_are_missing() -> None:
    picture = photographed(line(537.0), 2)
    value = picture.value.copy()
    value[::3] = np.nan
    fit = fit_line(value, picture.sigma, SYSTEM, FWHM_NM)
    assert fit.wavelength_nm == pytest.approx(537.0, abs=4 * fit.sigma_nm)


def test_light_that_is_no_such_line_is_reported_by_the_misfit() -> None:
    two = Spectrum("two", FINE_NM, line(480.0).at(FINE_NM) + line(600.0).at(FINE_NM))
    picture = photographed(two, 3)
    assert fit_line(picture.value, picture.sigma, SYSTEM, FWHM_NM).misfit > 5


@pytest.mark.parametrize("fwhm_nm", [1.0, 4.0, 20.0])
def test_lines_much_narrower_and_wider(fwhm_nm: float) -> None:
    """Closer than the knots are to one another, its width is not kept: its centre is."""
    picture = photographed(line(537.0, fwhm_nm), 4)
    fit = fit_line(picture.value, picture.sigma, SYSTEM, fwhm_nm)
    assert fit.wavelength_nm == pytest.approx(537.0, abs=3 * fit.sigma_nm)
    assert fit.misfit < (1.2 if fwhm_nm == 20.0 else 2.0)


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (np.full(93, np.nan), "neither clipped nor missing, got 0"),
        (np.full(93, -1.0), "none above their noise"),
    ],
)
def test_values_that_say_nothing(value: FloatArray, said: str) -> None:
    with pytest.raises(FitError, match=said):
        fit_line(value, np.ones(93), SYSTEM, FWHM_NM)


def test_a_line_outside_of_the_knots() -> None:
    picture = photographed(line(690.0), 5)
    inner = SpectralSystem(made.KNOTS_NM[:40], SYSTEM.design[:, :40])
    with pytest.raises(FitError, match="expected a line between 380 and 575 nm"):
        fit_line(picture.value, picture.sigma, inner, FWHM_NM)
