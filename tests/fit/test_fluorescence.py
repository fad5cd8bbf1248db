"""Re-radiation matrices estimated from values under several lights."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from labrig.fit.fluorescence import (
    Exposure,
    ExtrapolatedExcitation,
    FluorescenceFit,
    JointEstimator,
    Surfaces,
    UnexplainedValues,
    UnknownBrightness,
    fit_fluorescence,
    gaussian_led,
    predicted_colour,
    study_leds,
)
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.material import ReradiationMatrix, appearance, compare_colours, read_reradiation
from labrig.optics import Spectrum, read_camera, read_light
from tests.fit.fluorescent_samples import (
    CAMERA,
    CENTRES_NM,
    FEW_NM,
    INPUT_NM,
    OUTPUT_NM,
    Dye,
    lights,
    photographed,
    smooth_reflectance,
    surface,
    system_of,
)
from tests.pulls import assert_sigma_is_right

SYSTEM, FEW = system_of(lights()), system_of(lights(FEW_NM))
GREEN, RED = Dye(0.4, 450, 510), Dye(0.3, 545, 610)
EVEN = np.full(len(OUTPUT_NM), 0.4)


@pytest.fixture(scope="module")
def estimator() -> JointEstimator:
    return JointEstimator(SYSTEM)


@pytest.fixture(scope="module")
def quick_estimator() -> JointEstimator:
    return JointEstimator(FEW)


@pytest.fixture(scope="module")
def green_fit(estimator: JointEstimator) -> FluorescenceFit:
    value, variance = photographed(SYSTEM, surface(EVEN, GREEN), np.random.default_rng(1))
    return estimator.fit("green", value, variance)


@pytest.fixture(scope="module")
def quick_fit(quick_estimator: JointEstimator) -> FluorescenceFit:
    """The same surface under fewer lights."""
    value, variance = photographed(FEW, surface(EVEN, GREEN), np.random.default_rng(1))
    return quick_estimator.fit("green", value, variance)


def likely_number(fit: FluorescenceFit) -> int:
    return max(fit.numbers, key=lambda number: number.probability).fluorophores


def worst_delta_e(fit: FluorescenceFit, truth: ReradiationMatrix) -> float:
    lamps = [read_light("D65"), read_light("A")]
    return max(one.delta_e for one in compare_colours(fit.matrix, truth, lamps))


def test_one_dye_is_found_with_its_emission_and_colours(green_fit: FluorescenceFit) -> None:
    assert likely_number(green_fit) == 1
    (dye,) = green_fit.fluorophores
    assert abs(dye.emission.wavelength_nm[dye.emission.value.argmax()] - 510) <= 20
    assert_allclose(dye.emission.value.sum() * 20, 1, rtol=0.02)
    assert worst_delta_e(green_fit, surface(EVEN, GREEN)) < 1.5
    assert green_fit.reduced_chi2 < 3
    assert not any(isinstance(fact, UnexplainedValues) for fact in green_fit.facts)


def test_a_quantum_yield_is_photons_out_over_photons_in(green_fit: FluorescenceFit) -> None:
    truth, (dye,) = surface(EVEN, GREEN), green_fit.fluorophores
    band = int(np.argmax(truth.reradiated_fraction))
    photons = 20 * OUTPUT_NM @ truth.reradiation[:, band] / INPUT_NM[band]
    assert abs(dye.quantum_yield - photons / 0.6) < 3 * dye.quantum_yield_sigma
    assert dye.quantum_yield_sigma < 0.3


def test_two_dyes_are_told_from_one(estimator: JointEstimator) -> None:
    truth = surface(EVEN, Dye(0.3, 420, 460), RED)
    value, variance = photographed(SYSTEM, truth, np.random.default_rng(2))
    fit = estimator.fit("both", value, variance)
    assert likely_number(fit) == 2
    peaks = [dye.emission.wavelength_nm[dye.emission.value.argmax()] for dye in fit.fluorophores]
    assert_allclose(peaks, [460, 610], atol=20)
    assert worst_delta_e(fit, truth) < 2


@pytest.mark.campaign
def test_colours_of_random_surfaces_are_as_uncertain_as_they_say(
    quick_estimator: JointEstimator,
) -> None:
    lamps = [read_light("D65"), read_light("A")]
    pulls = []
    for seed in range(25):
        rng = np.random.default_rng(seed)
        emitted_nm = rng.uniform(440, 620)
        dye = Dye(rng.uniform(0.1, 0.6), emitted_nm - rng.uniform(30, 60), emitted_nm)
        truth = surface(0.8 * smooth_reflectance(rng), dye)
        fit = quick_estimator.fit("", *photographed(FEW, truth, rng, 0.005))
        for lamp in lamps:
            colour = predicted_colour(fit, lamp)
            pulls.append((colour.lab - appearance(truth, lamp).lab) / colour.lab_sigma)
    assert_sigma_is_right(pulls)


def test_fluorescence_is_not_found_where_there_is_none(quick_estimator: JointEstimator) -> None:
    found = 0
    for seed in range(10):
        rng = np.random.default_rng(100 + seed)
        fit = quick_estimator.fit("", *photographed(FEW, surface(smooth_reflectance(rng)), rng))
        found += likely_number(fit) > 0
    assert found == 0


def test_light_of_a_faint_dye_that_no_photograph_shows_is_within_what_is_stated(
    quick_estimator: JointEstimator,
) -> None:
    """Photographs that speak against any dye leave room for a faint one: never 0 ± 0."""
    n_unseen = 0
    for seed in range(6):
        rng = np.random.default_rng(100 + seed)
        true = surface(smooth_reflectance(rng), Dye(0.001, 450, 510))
        fit = quick_estimator.fit("", *photographed(FEW, true, rng))
        n_unseen += likely_number(fit) == 0
        assert fit.surfaces is not None
        light = (fit.surfaces.reradiation * fit.matrix.is_stokes).sum(axis=(1, 2))
        assert light.std() > 0
        assert abs(light.mean() - true.reradiation.sum()) < 3 * light.std()
    assert n_unseen > 3


def test_a_matrix_is_physical_and_known_with_sigma(green_fit: FluorescenceFit) -> None:
    matrix, surfaces = green_fit.matrix, green_fit.surfaces
    assert surfaces is not None
    assert matrix.reradiation_sigma is not None
    assert (surfaces.reflectance >= 0).all()
    assert (surfaces.reradiation >= 0).all()
    assert not matrix.reradiation[~matrix.is_stokes].any()
    assert matrix.reradiation_sigma[matrix.is_stokes].max() > 0
    assert matrix.total_fraction.max() < 1.1


def test_bands_that_no_light_reached_are_told(green_fit: FluorescenceFit) -> None:
    dark = INPUT_NM[green_fit.is_extrapolated]
    assert {300, 320, 340, 700, 720, 740, 760, 780} <= set(dark.tolist())
    assert not {380, 420, 460, 500, 520} & set(dark.tolist())
    (fact,) = (one for one in green_fit.facts if isinstance(one, ExtrapolatedExcitation))
    assert fact.share > 0.1
    assert set(fact.input_nm) <= set(dark.tolist())


def test_brightness_scales_out(quick_fit: FluorescenceFit) -> None:
    factor = np.linspace(0.5, 4.0, len(FEW_NM))[:, np.newaxis]
    brighter = [
        replace(light, brightness=float(one))
        for light, one in zip(lights(FEW_NM), factor[:, 0], strict=True)
    ]
    value, variance = photographed(FEW, surface(EVEN, GREEN), np.random.default_rng(1))
    fit = fit_fluorescence("green", factor * value, factor**2 * variance, system_of(brighter))
    assert_allclose(fit.matrix.reradiation, quick_fit.matrix.reradiation, rtol=1e-6, atol=1e-9)
    assert_allclose(fit.predicted, factor * quick_fit.predicted, rtol=1e-6)


def test_the_order_of_lights_does_not_matter(quick_fit: FluorescenceFit) -> None:
    order = np.random.default_rng(3).permutation(len(FEW_NM))
    shuffled = system_of(lights(np.array(FEW_NM)[order].tolist()))
    value, variance = photographed(FEW, surface(EVEN, GREEN), np.random.default_rng(1))
    fit = fit_fluorescence("green", value[order], variance[order], shuffled)
    assert_allclose(
        [number.log_evidence for number in fit.numbers],
        [number.log_evidence for number in quick_fit.numbers],
        atol=1e-3,
    )
    difference = fit.matrix.reradiation - quick_fit.matrix.reradiation
    assert quick_fit.matrix.reradiation_sigma is not None
    # Other draws from the same density.
    assert (np.abs(difference) <= 0.5 * quick_fit.matrix.reradiation_sigma + 1e-9).all()


def test_of_a_light_of_unknown_brightness_only_the_colour_counts() -> None:
    ultraviolet = Exposure(gaussian_led(365, 12), 1.0, math.inf)
    system = system_of([ultraviolet, *lights(FEW_NM)])
    value, variance = photographed(system, surface(EVEN, GREEN), np.random.default_rng(4))
    fits = []
    for factor in (1.0, 5.0):
        scale = np.ones((len(value), 1))
        scale[0] = factor
        fits.append(fit_fluorescence("green", scale * value, scale**2 * variance, system))
    first, second = (fit.matrix.reradiation for fit in fits)
    assert np.abs(first - second).max() < 0.1 * first.max()
    assert UnknownBrightness(("365 nm",)) in fits[0].facts


def test_a_broadband_exposure_makes_the_ultraviolet_better_known() -> None:
    lamp = Spectrum("lamp", np.array([300.0, 420.0, 430.0]), np.array([1.0, 1.0, 0.0]))
    truth = surface(EVEN, GREEN)
    sigmas = []
    for system in (FEW, system_of([*lights(FEW_NM), Exposure(lamp)])):
        value, variance = photographed(system, truth, np.random.default_rng(5))
        fit = fit_fluorescence("green", value, variance, system)
        sigmas.append(predicted_colour(fit, read_light("365nm")).xyz_covariance[1, 1] ** 0.5)
    assert sigmas[1] < 0.6 * sigmas[0]


def test_values_that_no_surface_has_are_told_and_widen_sigma(
    quick_estimator: JointEstimator, quick_fit: FluorescenceFit
) -> None:
    value, variance = photographed(FEW, surface(EVEN, GREEN), np.random.default_rng(1))
    wrong = value.copy()
    wrong[3, 1] *= 1.4
    fit = quick_estimator.fit("green", wrong, variance)
    (fact,) = (one for one in fit.facts if isinstance(one, UnexplainedValues))
    assert fact.reduced_chi2 > 3
    lamp = read_light("A")
    sigma = predicted_colour(fit, lamp).lab_sigma
    assert (sigma > 1.5 * predicted_colour(quick_fit, lamp).lab_sigma).all()


def test_a_library_helps_where_the_emission_is_in_it() -> None:
    peaks = np.exp(-(((OUTPUT_NM - 480) / 18) ** 2) / 2)
    peaks += 0.8 * np.exp(-(((OUTPUT_NM - 600) / 18) ** 2) / 2)
    shift = np.maximum(OUTPUT_NM[:, np.newaxis] - INPUT_NM, 0.0)
    excitation = 0.5 * np.exp(-(((INPUT_NM - 420) / 30) ** 2) / 2)
    reradiation = np.outer(peaks / (20 * peaks.sum()), excitation) * (1 - np.exp(-shift / 12))
    truth = replace(surface(EVEN), reradiation=reradiation)
    value, variance = photographed(SYSTEM, truth, np.random.default_rng(6))
    library = [Spectrum("two peaks", OUTPUT_NM, peaks)]
    fit = fit_fluorescence("odd", value, variance, SYSTEM, library=library)
    assert likely_number(fit) == 1
    assert_allclose(
        fit.fluorophores[0].emission.value, peaks / (20 * peaks.sum()), atol=0.15 * 0.014
    )
    with pytest.raises(UsageError, match="emission 'dark': expected positive light"):
        fit_fluorescence(
            "odd", value, variance, SYSTEM, library=[Spectrum("dark", OUTPUT_NM, 0 * peaks)]
        )


def test_a_wrong_library_does_no_harm(quick_estimator: JointEstimator) -> None:
    value, variance = photographed(FEW, surface(EVEN, GREEN), np.random.default_rng(8))
    library = [
        Spectrum(f"{peak} nm", OUTPUT_NM, _two_lines(peak)) for peak in (450, 500, 550, 600, 650)
    ]
    without = quick_estimator.fit("green", value, variance)
    fit = JointEstimator(FEW, library).fit("green", value, variance)
    assert likely_number(fit) == likely_number(without) == 1
    apart = np.abs(fit.fluorophores[0].emission.value - without.fluorophores[0].emission.value)
    assert apart.max() < 0.1 * without.fluorophores[0].emission.value.max()
    lamp = read_light("D65")
    sigma, other = (predicted_colour(each, lamp).lab_sigma for each in (fit, without))
    assert_allclose(sigma, other, rtol=0.3)


def _two_lines(peak: float) -> FloatArray:
    away = np.array([[-35.0], [35.0]])
    return np.asarray(np.exp(-(((OUTPUT_NM - peak - away) / 8) ** 2) / 2).sum(axis=0))


def test_a_predicted_colour_is_that_of_the_drawn_surfaces(green_fit: FluorescenceFit) -> None:
    surfaces = green_fit.surfaces
    assert surfaces is not None
    few = Surfaces(surfaces.reflectance[:4], surfaces.reradiation[:4])
    lamp = read_light("FL2")
    each = [
        appearance(replace(green_fit.matrix, reflectance=rho, reradiation=phi.astype(float)), lamp)
        for rho, phi in zip(few.reflectance, few.reradiation, strict=True)
    ]
    colour = predicted_colour(replace(green_fit, surfaces=few), lamp)
    assert_allclose(colour.xyz_covariance, np.cov([one.xyz for one in each], rowvar=False))
    assert_allclose(colour.lab_covariance, np.cov([one.lab for one in each], rowvar=False))
    assert_allclose(colour.lab, appearance(green_fit.matrix, lamp).lab)


@pytest.mark.campaign
def test_more_leds_are_found_better() -> None:
    camera, lamps = read_camera(CAMERA), [read_light("D65")]
    truth = [surface(smooth_reflectance(np.random.default_rng(7)), GREEN, name="green")]
    errors = [
        study_leds([gaussian_led(nm, 22) for nm in those], camera, truth, lamps).quantile(0.5)[0]
        for those in (CENTRES_NM[::4], CENTRES_NM)
    ]
    assert errors[1] < 0.6 * errors[0]


def test_measured_post_its_are_found(shared_data: Path) -> None:
    for name in ("fluorescent_yellow", "fluorescent_green"):
        path = shared_data / f"bispectral/art_postit/{name}.csv"
        measured = read_reradiation(path).rebinned(INPUT_NM, OUTPUT_NM)
        truth = replace(
            measured,
            reradiation=np.where(measured.is_stokes, np.nan_to_num(measured.reradiation), 0.0),
            reradiation_sigma=None,
        )
        value, variance = photographed(SYSTEM, truth, np.random.default_rng(8))
        fit = fit_fluorescence(name, value, variance, SYSTEM)
        assert likely_number(fit) > 0
        assert worst_delta_e(fit, truth) < 2
