"""How strongly the lamp lights what lies behind an LVF, by a camera of doubtful curves."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from labrig.calibration import IRRADIANCE_KIND
from labrig.fit.spectrum import CurveError
from labrig.fit.spectrum.system import curve_modes
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.optics import CameraResponse, Lvf, Transmittance, nominal_lvf, read_camera
from labrig.optics.piecewise import quadrature
from labrig.protocols.irradiance.analysis import in_bands, mean_ratio, strip_scale
from labrig.protocols.irradiance.result import CardRatio, IrradianceResult
from labrig.results.strip_profile import SliceValues
from tests.analyse.lvf_calibration.room_truth import simulation_of, true_irradiance
from tests.analyse.lvf_calibration.strip_pictures import TRUE_MAP, halogen
from tests.analyse.recorded import processed_once
from tests.analyse.small_runs import irradiance
from tests.results.made import assert_read_back

CARD = Transmittance("card", np.array([380.0, 780.0]), np.array([0.17, 0.19]))
HOUSE = read_camera("canon_eos_5d_mark_ii")
EDGES_NM = np.array([400.0, 437.5, 475.0, 512.5, 550.0, 587.5, 625.0, 662.5, 700.0])
#: What really comes through, over what the calibrated strip lets expect.
TRUE_SCALE = 0.8


def strip() -> Lvf:
    return nominal_lvf(TRUE_MAP, np.linspace(402.0, 700.0, 16), leakage=0.001)


def bent(seed: int) -> CameraResponse:
    error, curve = CurveError(), HOUSE.sensitivity
    modes = curve_modes(error, HOUSE.wavelength_nm, curve, curve.max(axis=0))
    rng = np.random.default_rng(seed)
    changed = curve + sum(rng.standard_normal() * mode for mode in modes)
    return replace(HOUSE, sensitivity=np.maximum(changed, 0.0))


def card_ratio(camera: CameraResponse, seed: int = 0) -> CardRatio:
    lamp = halogen()
    nodes, weights = quadrature(380.0, 780.0, camera.wavelength_nm, lamp.wavelength_nm)
    light = weights * lamp.at(nodes) * CARD.at(nodes)
    passed = TRUE_SCALE * strip().transmission(nodes) * light
    value = passed @ camera.at(nodes) / (light @ camera.at(nodes))
    sigma = np.full_like(value, 1e-3 * value.max())
    rng = np.random.default_rng(seed)
    value = value + sigma * rng.standard_normal(value.shape)
    return CardRatio(value, sigma, common_sigma=0.0, drift=0.0, rounds=1)


def test_known_curves_give_the_scale() -> None:
    found = strip_scale(card_ratio(HOUSE), strip(), halogen(), CARD, HOUSE)
    np.testing.assert_allclose(found.value, TRUE_SCALE, rtol=0.03)


def test_wrong_curves_are_in_the_sigma_and_neighbours_help() -> None:
    deviations, single, course = [], [], []
    for seed in range(12):
        found = strip_scale(card_ratio(bent(seed), seed), strip(), halogen(), CARD, HOUSE)
        off = np.log(found.value / TRUE_SCALE)
        deviations.append(off / np.sqrt(np.diag(found.covariance)))
        single.append(np.log(found.measured / TRUE_SCALE))
        course.append(off)
    # An unbiased σ: 192 correlated deviations of unit variance.
    assert 0.5 < np.sqrt(np.mean(np.square(deviations))) < 1.4
    assert np.abs(deviations).max() < 4
    assert np.std(course) < 0.7 * np.std(single)
    assert np.std(course) < 0.08


def test_a_position_without_light_is_refused() -> None:
    ratio = card_ratio(HOUSE)
    value = ratio.value.copy()
    value[3] = np.nan
    with pytest.raises(DataError, match="position p03: no light"):
        strip_scale(replace(ratio, value=value), strip(), halogen(), CARD, HOUSE)


def test_shares_of_bands_are_integrals_and_their_sigma_is_of_the_bands() -> None:
    lamp, lvf = halogen(), strip()
    one = np.ones(16)
    unsure = replace(lvf.bands, centre_nm=one, fwhm_nm=one, skew=0 * one, leakage=0 * one)
    value, sigma = in_bands(replace(lvf, sigma=unsure), lamp, EDGES_NM)
    fine = np.arange(400.0, 700.0, 0.01) + 0.005
    whole: FloatArray = (lvf.transmission(fine) * lamp.at(fine)).sum(axis=1) * 0.01
    np.testing.assert_allclose(value.sum(axis=1), whole, rtol=1e-6)
    # A band in the middle of its own: its width counts, its place hardly.
    row = int(np.argmin(np.abs(lvf.bands.centre_nm - 531.25)))
    assert sigma[row].max() == pytest.approx(value[row].max() / 25, rel=0.6)


def test_rounds_are_averaged_and_their_scatter_is_reported() -> None:
    direct = SliceValues(np.full((4, 3), 100.0), np.full((4, 3), 0.1))
    through = [SliceValues(np.full((4, 3), v), np.full((4, 3), 0.01)) for v in (5.0, 5.2)]
    card = mean_ratio([(direct, one) for one in through])
    np.testing.assert_allclose(card.value, 0.051, rtol=1e-3)
    assert card.drift == pytest.approx(0.028, rel=0.05)
    assert card.common_sigma == pytest.approx(np.hypot(0.00707, card.drift) / np.sqrt(2), rel=0.01)


def test_on_the_simulated_bench_it_is_the_rooms(tmp_path: Path) -> None:
    """With a filter calibrated without error: what is left is the card's and the camera's."""
    run = irradiance(tmp_path)
    result = processed_once(run).result
    assert isinstance(result, IrradianceResult)
    file = result.calibration
    assert IRRADIANCE_KIND.read(run / "result" / "irradiance.yaml") == file
    assert_read_back(result)
    expected = true_irradiance(simulation_of(run), file.lvf_strip(), file.bands_nm).sum(axis=1)
    through = np.array(file.through).sum(axis=1)
    sigma = np.array(file.ratio_sigma) / np.array(file.ratio)
    assert np.abs(np.log(through / expected) / sigma).max() < 4
    assert sigma.min() < 0.02
    assert (result.card_ratio.rounds, result.warnings) == (2, ())
