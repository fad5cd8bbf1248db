"""Mixtures fitted to re-radiation matrices."""

import csv
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.testing import assert_allclose
from scipy.stats import skewnorm

from labrig.fit import MixtureFit, fit_mixture
from labrig.foundation.errors import DataError, UsageError
from labrig.material import ReradiationMatrix, ReradiationMixture, compare_colours
from labrig.optics import read_light
from labrig.report import FittedMatrix, describe_mixture

INPUT_NM = np.arange(300.0, 781.0, 10.0)
OUTPUT_NM = np.arange(380.0, 781.0, 10.0)
IS_STOKES = OUTPUT_NM[:, np.newaxis] > INPUT_NM
#: Threshold of physics.md's reference for the Post-Its, and its errors by K.
POSTIT_THRESHOLD = 0.004
POSTIT_MSE = {
    "yellow": {1: 9.0e-6, 2: 4.3e-6, 3: 2.7e-6, 6: 2.1e-6},
    "green": {1: 7.0e-6, 2: 3.4e-6, 3: 2.4e-6, 6: 2.1e-6},
}


def dye(peak_nm: float, emission_nm: float, strength: float) -> np.ndarray:
    """A dye as real ones are: steep towards the other spectrum, with a tail away from it."""
    excitation = skewnorm.pdf(INPUT_NM, -4, peak_nm + 20, 60)
    emission = skewnorm.pdf(OUTPUT_NM, 4, emission_nm - 15, 45)
    values = np.outer(emission / emission.sum(), excitation / excitation.max())
    return np.where(IS_STOKES, strength * values, 0.0)


def one_dye() -> np.ndarray:
    return dye(460, 515, 0.3)


def two_dyes() -> np.ndarray:
    return np.asarray(dye(370, 440, 0.25) + dye(520, 590, 0.2))


def measured(truth: np.ndarray, seed: int, with_sigma: bool = True) -> ReradiationMatrix:
    """Noise that falls with the wavelength of the input, and spill beside the reflectance."""
    sigma = np.broadcast_to(np.geomspace(4e-3, 4e-4, len(INPUT_NM)), truth.shape)
    noise = sigma * np.random.default_rng(seed).standard_normal(truth.shape)
    distance = np.abs(OUTPUT_NM[:, np.newaxis] - INPUT_NM)
    mirror = np.where(distance == 0, 0.5, np.where(distance == 10, 2e-4, 0.0))
    return ReradiationMatrix.from_bands(
        "paper", INPUT_NM, OUTPUT_NM, truth + mirror + noise, sigma if with_sigma else None
    )


def bands(mixture: ReradiationMixture) -> np.ndarray:
    """Re-radiation per band, as the definition says."""
    density = mixture.density(INPUT_NM, OUTPUT_NM[:, np.newaxis])
    return np.where(IS_STOKES, 10 * mixture.scale * density, 0.0)


def thresholded(matrix: ReradiationMatrix, threshold: float) -> np.ndarray:
    values = np.where(IS_STOKES, 10 * matrix.reradiation, 0.0)
    return np.where(values >= threshold, values, 0.0)


def error(mixture: ReradiationMixture, values: np.ndarray) -> float:
    return float(((bands(mixture) - values)[IS_STOKES] ** 2).mean())


def two_components(seed: int) -> ReradiationMixture:
    """Components as wide as those of dyes, on the Stokes side."""
    rng = np.random.default_rng(seed)
    sd = rng.uniform(15, 30, (2, 2))
    ab = rng.uniform(-0.5, 0.5, 2) * sd.prod(axis=1)
    mean = np.array([[380.0, 480], [480, 600]]) + rng.uniform(-15, 15, (2, 2))
    covariance = [[[s**2, c], [c, t**2]] for (s, t), c in zip(sd, ab, strict=True)]
    return ReradiationMixture(30.0, np.array([0.6, 0.4]), mean, np.array(covariance))


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_a_mixture_is_found_again(seed: int) -> None:
    truth = two_components(seed)
    fit = fit_mixture(truth.to_matrix(INPUT_NM, OUTPUT_NM), 2, "least-squares", 1e-12)
    assert fit.converged
    assert_allclose(fit.mixture.scale, truth.scale, rtol=1e-5)
    assert_allclose(fit.mixture.weights, truth.weights, rtol=1e-5)
    assert_allclose(fit.mixture.mean_nm, truth.mean_nm, rtol=1e-5)
    assert_allclose(fit.mixture.covariance_nm2, truth.covariance_nm2, rtol=1e-3, atol=0.1)


@pytest.mark.parametrize(("truth", "seed"), [(one_dye, 11), (two_dyes, 12)])
@pytest.mark.parametrize("scaling", ["integral", "least-squares"])
def test_the_error_is_that_of_the_thresholded_entries(
    truth: Callable[[], np.ndarray], seed: int, scaling: str
) -> None:
    matrix = measured(truth(), seed)
    fit = fit_mixture(matrix, 3, scaling, 0.004)  # type: ignore[arg-type]
    wanted = thresholded(matrix, 0.004)
    assert fit.entries == 1148
    assert fit.kept_entries == (wanted > 0).sum()
    assert_allclose(fit.masked_mse, error(fit.mixture, wanted), rtol=1e-9)
    if scaling == "integral":
        assert_allclose(bands(fit.mixture).sum(), wanted.sum(), rtol=1e-9)
    assert fit.masked_mse < fit.likelihood_mse


def test_no_small_change_of_the_refined_mixture_lessens_the_error() -> None:
    matrix = measured(one_dye(), 13)
    fit = fit_mixture(matrix, 2, "least-squares", 0.004)
    wanted, found = thresholded(matrix, 0.004), fit.mixture

    def changed(scale: float, weight: float, mean: np.ndarray, sd: np.ndarray) -> float:
        weights = found.weights + np.array([weight, -weight])
        return error(
            ReradiationMixture(
                found.scale * scale,
                weights,
                found.mean_nm + mean,
                found.covariance_nm2 * sd[:, :, np.newaxis] * sd[:, np.newaxis],
            ),
            wanted,
        )

    least = error(found, wanted)
    no_shift, no_stretch = np.zeros((2, 2)), np.ones((2, 2))
    for sign in (-1, 1):
        assert changed(1 + sign * 1e-3, 0, no_shift, no_stretch) > least
        assert changed(1, sign * 1e-3, no_shift, no_stretch) > least
        for index in np.ndindex(2, 2):
            shift, stretch = no_shift.copy(), no_stretch.copy()
            shift[index], stretch[index] = sign * 0.1, 1 + sign * 1e-3
            assert changed(1, 0, shift, no_stretch) > least
            assert changed(1, 0, no_shift, stretch) > least


@pytest.mark.parametrize(("truth", "seed"), [(one_dye, 14), (two_dyes, 15)])
def test_a_mixture_is_nearer_to_the_truth_than_the_noisy_entries(
    truth: Callable[[], np.ndarray], seed: int
) -> None:
    matrix = measured(truth(), seed)
    fit = fit_mixture(matrix, 4)
    assert fit.false_discovery_rate == 0.05
    raw = ((10 * matrix.reradiation - truth())[IS_STOKES] ** 2).mean()
    assert error(fit.mixture, truth()) < raw / 3
    assert_allclose(bands(fit.mixture).sum(), truth().sum(), rtol=0.02)
    # Four normal densities miss two skewed dyes by a little more than the noise.
    assert 0.9 < (fit.reduced_chi2 or 0.0) < 1.3


def uneven(truth: np.ndarray, seed: int) -> tuple[np.ndarray, ReradiationMatrix]:
    """Noise of each column of its own: 1 to 20 % of the peak, in any order."""
    rng = np.random.default_rng(seed)
    part = rng.permutation(np.geomspace(0.01, 0.2, len(INPUT_NM)))
    sigma = np.broadcast_to(truth.max() * part, truth.shape)
    values = truth + sigma * rng.standard_normal(truth.shape)
    return sigma, ReradiationMatrix.from_bands("", INPUT_NM, OUTPUT_NM, values, sigma)


def test_noise_takes_no_light_and_scatters_as_chi2_says() -> None:
    """A mixture under uneven noise, 24 times: all of its light is kept, and χ² is noise."""
    light, chi2 = [], []
    for seed in range(24):
        truth = bands(two_components(7100 + seed))
        fit = fit_mixture(uneven(truth, 7200 + seed)[1], 2, "least-squares")
        light.append(bands(fit.mixture).sum() / truth.sum())
        chi2.append(fit.reduced_chi2 or 0.0)
    # With a threshold 9.5 % would be lost.
    assert abs(np.mean(light) - 1) < 3 * np.std(light) / np.sqrt(24) < 0.02
    # σ that is 20 % off changes χ² by 0.3 or 0.4.
    assert_allclose(np.mean(chi2), 1, atol=0.03)


@pytest.mark.parametrize("components", [1, 3])
def test_light_kept_is_that_of_all_entries(components: int) -> None:
    sigma, matrix = uneven(one_dye(), 7300)
    fit = fit_mixture(matrix, components)
    values = np.where(IS_STOKES, 10 * matrix.reradiation, 0.0)
    kept, columns = fit.light_kept, values.sum(axis=0)
    of_column = np.sqrt((np.where(IS_STOKES, sigma, 0.0) ** 2).sum(axis=0))
    found = bands(fit.mixture).sum(axis=0)
    assert kept.total == pytest.approx(found.sum() / columns.sum())
    assert kept.total_sigma == pytest.approx(
        kept.total * np.sqrt((of_column**2).sum()) / columns.sum()
    )
    at = int(np.searchsorted(INPUT_NM, kept.worst_input_nm))
    assert kept.worst == pytest.approx(found[at] / columns[at])
    known = (columns > 5 * of_column) & (columns > 0.01 * columns.sum())
    off = np.abs(found - columns) / np.maximum(of_column, 1e-12)
    assert known[at]
    assert off[at] == off[known].max()


def test_misfit_moves_the_scale_to_the_integral_and_noise_does_not() -> None:
    truth = two_dyes()
    for sigma, moved in ((1e-5, True), (4e-3, False)):
        values = truth + sigma * np.random.default_rng(7400).standard_normal(truth.shape)
        noise = np.full(truth.shape, sigma)
        matrix = ReradiationMatrix.from_bands("", INPUT_NM, OUTPUT_NM, values, noise)
        # One component for two dyes, or as many as noise lets be seen.
        number: Literal[1, "auto"] = 1 if moved else "auto"
        integral, least = (
            fit_mixture(matrix, number, scaling) for scaling in ("integral", "least-squares")
        )
        light = np.where(IS_STOKES, values, 0.0).sum()
        if moved:
            assert_allclose(bands(integral.mixture).sum(), light, rtol=1e-4)
            assert bands(least.mixture).sum() < 0.98 * light
        else:
            assert abs(bands(least.mixture).sum() - light) < 2 * sigma * np.sqrt(1148)
            assert_allclose(integral.mixture.scale, least.mixture.scale, rtol=1e-12)


@pytest.mark.parametrize("seed", [24, pytest.param(25, marks=pytest.mark.campaign)])
def test_more_components_have_less_error(seed: int) -> None:
    matrix = measured(two_dyes(), seed)
    thresholded_errors = [one.masked_mse for one in fit_mixture(matrix, threshold=0.004).candidates]
    assert (np.diff(thresholded_errors) < 0).all()
    parameters = 6 * np.arange(1, 7)
    chi2 = [
        (one.reduced_chi2 or 0.0) * (1148 - number)
        for one, number in zip(fit_mixture(matrix).candidates, parameters, strict=False)
    ]
    assert len(chi2) > 2
    assert (np.diff(chi2) < 0).all()


def test_of_the_kept_entries_one_in_twenty_is_noise() -> None:
    strong = np.zeros((len(OUTPUT_NM), len(INPUT_NM)))
    strong[10:24, 2:16] = np.where(IS_STOKES[10:24, 2:16], 1.0, 0.0)
    count = int((strong > 0).sum())
    sigma = np.full(strong.shape, 0.02)
    false = []
    for seed in range(120):
        noise = sigma * np.random.default_rng(1500 + seed).standard_normal(strong.shape)
        matrix = ReradiationMatrix.from_bands("", INPUT_NM, OUTPUT_NM, strong + noise, sigma)
        kept = fit_mixture(matrix, 1, refine=False).kept_entries
        false.append((kept - count) / kept)
    # A σ that is 20 % too large halves this, one that is too small doubles it.
    assert_allclose(np.mean(false), 0.05 * (1148 - count) / 1148, rtol=0.15)


@pytest.mark.parametrize(("truth", "seed"), [(one_dye, 16), (two_dyes, 17)])
def test_the_number_of_components_is_that_of_the_least_bic(
    truth: Callable[[], np.ndarray], seed: int
) -> None:
    fit = fit_mixture(measured(truth(), seed))
    least = min(fit.candidates, key=lambda candidate: candidate.bic)
    assert fit.selection == "bic"
    assert fit.components == least.components > 1
    assert [one.components for one in fit.candidates] == list(range(1, len(fit.candidates) + 1))


def test_two_normal_densities_under_noise_are_two_components() -> None:
    matrix = measured(bands(two_components(18)), 18, with_sigma=False)
    assert fit_mixture(matrix, threshold=0.004).components == 2


@pytest.mark.campaign
def test_cross_validation_takes_the_least_number_within_a_standard_error() -> None:
    matrix = measured(two_dyes(), 27)
    fit = fit_mixture(matrix, selection="cross-validation")
    held_out = [row.held_out for row in fit.candidates]
    least = min((error for error in held_out if error is not None), key=lambda error: error.mse)
    within = [error is not None and error.mse <= least.mse + least.standard_error
              for error in held_out]  # fmt: skip
    assert fit.selection == "cross-validation"
    assert fit.components == 1 + within.index(True) > 1
    chosen = held_out[fit.components - 1]
    assert chosen is not None
    # Entries that the fit has not seen are predicted as well as noise and scatter allow.
    assert fit.masked_mse < chosen.mse < 3 * fit.masked_mse


@pytest.mark.campaign
def test_cross_validation_finds_the_number_of_normal_densities() -> None:
    matrix = measured(bands(two_components(28)), 28, with_sigma=False)
    fit = fit_mixture(matrix, threshold=0.004, selection="cross-validation")
    assert fit.components == 2


@pytest.mark.parametrize(
    ("truth", "seed"), [(one_dye, 29), pytest.param(two_dyes, 30, marks=pytest.mark.campaign)]
)
def test_colours_set_the_scale(truth: Callable[[], np.ndarray], seed: int) -> None:
    matrix = measured(truth(), seed)
    lights = [read_light("D65"), read_light("A")]

    def mean_delta_e(mixture: ReradiationMixture, factor: float = 1.0) -> float:
        smooth = replace(mixture, scale=factor * mixture.scale).to_matrix(
            INPUT_NM, OUTPUT_NM, reflectance=matrix.reflectance
        )
        return float(np.mean([each.delta_e for each in compare_colours(smooth, matrix, lights)]))

    by_integral = fit_mixture(matrix, 2)
    fit = fit_mixture(matrix, 2, "colour", lights=lights)
    assert fit.lights == ("D65", "A")
    assert_allclose(fit.mixture.mean_nm, by_integral.mixture.mean_nm)
    best = mean_delta_e(fit.mixture)
    assert best <= mean_delta_e(by_integral.mixture) + 1e-6
    assert all(mean_delta_e(fit.mixture, factor) >= best for factor in (0.8, 0.99, 1.01, 1.25))


def test_colours_need_lights_and_a_surface_that_can_be_seen() -> None:
    matrix = measured(one_dye(), 31)
    with pytest.raises(UsageError, match="expected lights"):
        fit_mixture(matrix, 2, "colour")
    black = ReradiationMatrix("", INPUT_NM, OUTPUT_NM, np.zeros(41), matrix.reradiation)
    with pytest.raises(DataError, match="can be seen under 620nm"):
        fit_mixture(
            replace(black, reradiation=np.where(INPUT_NM < 500, black.reradiation, 0.0)),
            2,
            "colour",
            1e-3,
            lights=[read_light("620nm")],
        )


def test_the_likelihood_alone_is_what_refinement_starts_from() -> None:
    matrix = measured(two_dyes(), 35)
    alone, whole = (fit_mixture(matrix, 3, refine=refine) for refine in (False, True))
    assert_allclose(alone.masked_mse, whole.likelihood_mse, rtol=1e-9)
    assert alone.refinement_iterations == 0
    for options in ({"components": "auto"}, {"components": 2, "skewed": True}):
        with pytest.raises(UsageError, match="without refinement"):
            fit_mixture(matrix, refine=False, **options)


def test_skewed_components_are_found_again_and_said() -> None:
    truth = replace(two_components(32), skew=np.array([[-0.5, 0.4], [0.3, 0.6]]))
    fit = fit_mixture(truth.to_matrix(INPUT_NM, OUTPUT_NM), 2, "least-squares", 1e-9, skewed=True)
    assert_allclose(fit.mixture.skews, truth.skews, atol=1e-3)
    assert_allclose(fit.mixture.mean_nm, truth.mean_nm, rtol=1e-4)
    said = json.loads(fit.to_json())["components"]
    assert_allclose([component["skew"] for component in said], fit.mixture.skews)


@pytest.mark.parametrize("seed", [33, 34])
def test_skewed_components_follow_a_dye_better_than_normal_ones(seed: int) -> None:
    matrix = measured(one_dye(), seed)
    normal, skewed = (fit_mixture(matrix, 2, skewed=skewed) for skewed in (False, True))
    assert error(skewed.mixture, one_dye()) < 0.8 * error(normal.mixture, one_dye())


def test_unequal_bands_count_by_their_width() -> None:
    truth = two_components(19)
    output_nm = np.concatenate([np.arange(380.0, 560, 10), np.arange(560.0, 781, 5)])
    matrix = truth.to_matrix(INPUT_NM, output_nm)
    fit = fit_mixture(matrix, 2, threshold=1e-12)
    assert_allclose(fit.mixture.mean_nm, truth.mean_nm, rtol=1e-5)
    assert_allclose(fit.mixture.scale, truth.scale, rtol=1e-5)
    assert fit.band_nm == 1


def test_what_was_not_measured_is_left_out() -> None:
    truth = two_components(20)
    whole = truth.to_matrix(INPUT_NM, OUTPUT_NM)
    table = np.where(INPUT_NM == 400, np.nan, whole.reradiation)
    matrix = ReradiationMatrix("", INPUT_NM, OUTPUT_NM, whole.reflectance, table)
    fit = fit_mixture(matrix, 2, threshold=1e-12)
    assert fit.entries == 1148 - int((OUTPUT_NM > 400).sum())
    assert_allclose(fit.mixture.mean_nm, truth.mean_nm, rtol=1e-5)


@pytest.mark.parametrize("skewed", [False, True])
def test_light_of_a_single_wavelength_is_a_narrow_component(skewed: bool) -> None:
    values = np.zeros((41, 49))
    values[22, 10:16] = 0.1
    matrix = ReradiationMatrix.from_bands("", INPUT_NM, OUTPUT_NM, values)
    fit = fit_mixture(matrix, 1, threshold=0.01, skewed=skewed)
    assert_allclose(fit.mixture.mean_nm, [[425, 600]], atol=1)
    assert_allclose(bands(fit.mixture).sum(), 0.6, rtol=1e-9)


@pytest.mark.parametrize(("peak_nm", "held"), [(840.0, True), (700.0, False)])
@pytest.mark.parametrize("skewed", [False, True])
def test_a_peak_beyond_the_measured_wavelengths_is_named(
    peak_nm: float, held: bool, skewed: bool
) -> None:
    dye = ReradiationMixture(
        20.0, np.ones(1), np.array([[460.0, peak_nm]]), np.array([[[900.0, 100], [100, 1600]]])
    )
    matrix = dye.to_matrix(INPUT_NM, OUTPUT_NM)
    fit = fit_mixture(matrix, 1, threshold=1e-9, skewed=skewed)
    name = f"{'median' if skewed else 'mean'} of the returning light"
    assert json.loads(fit.to_json())["at_bound"] == held * [{"component": 1, "parameter": name}]
    text = describe_mixture(FittedMatrix(matrix, fit))
    assert ("at its bound" in text, name in text) == (held, held)


def test_the_same_matrix_gives_the_same_text() -> None:
    texts = [fit_mixture(measured(two_dyes(), 21), 2).to_json() for _ in range(2)]
    assert texts[0] == texts[1]


def test_json_says_the_mixture_per_band() -> None:
    fit = fit_mixture(measured(two_dyes(), 22), 3)
    content = json.loads(fit.to_json())
    keys = {"weight", "mean", "covariance"}
    assert {"scale", "components", "threshold", "masked_mse"} <= set(content)
    assert [set(component) for component in content["components"]] == [keys] * 3
    assert_allclose(sum(component["weight"] for component in content["components"]), 1)
    parts = [np.array([component[key] for component in content["components"]]) for key in keys]
    read = ReradiationMixture(1.0, **dict(zip(names(keys), parts, strict=True)))
    density = np.where(IS_STOKES, read.density(INPUT_NM, OUTPUT_NM[:, np.newaxis]), 0)
    assert_allclose(content["scale"] * density, bands(fit.mixture), rtol=1e-9)


def names(keys: set[str]) -> list[str]:
    return [
        {"weight": "weights", "mean": "mean_nm", "covariance": "covariance_nm2"}[key]
        for key in keys
    ]


@pytest.mark.parametrize(
    ("components", "threshold", "kind", "message"),
    [
        (0, 0.004, UsageError, "expected 1 to"),
        (500, 0.004, UsageError, "components for"),
        (3, 10.0, DataError, "above the noise"),
        (3, 0.0, UsageError, "threshold above 0"),
        (3, float("nan"), UsageError, "threshold above 0"),
        (3, None, UsageError, "σ of the re-radiation or a threshold"),
    ],
)
def test_what_cannot_be_fitted_is_refused_in_one_line(
    components: int, threshold: float | None, kind: type[Exception], message: str
) -> None:
    matrix = measured(one_dye(), 23, with_sigma=False)
    with pytest.raises(kind, match=message) as caught:
        fit_mixture(matrix, components, threshold=threshold)
    assert "\n" not in str(caught.value)


def postit(path: Path) -> ReradiationMatrix:
    with path.open(encoding="utf-8") as file:
        rows = list(csv.reader(file))[1:]
    values = np.array([row[1:] for row in rows], dtype=np.float64)
    return ReradiationMatrix.from_bands(path.stem, INPUT_NM, OUTPUT_NM, values)


def bfc(path: Path) -> ReradiationMatrix:
    lines = path.read_text(encoding="iso-8859-1").splitlines()
    first = next(number for number, line in enumerate(lines) if line.startswith("r:c"))
    values = np.array([line.split()[1:] for line in lines[first + 1 :] if line[:1].isdigit()])
    return ReradiationMatrix.from_bands(
        path.stem, INPUT_NM, OUTPUT_NM, values.astype(np.float64)
    )  # fmt: skip


@pytest.mark.parametrize("colour", [pytest.param("yellow", marks=pytest.mark.campaign), "green"])
def test_postits_have_at_most_the_reference_error(shared_data: Path, colour: str) -> None:
    matrix = postit(shared_data / f"bispectral/art_postit/fluorescent_{colour}.csv")
    fits: dict[int, MixtureFit] = {}
    for components, reference in POSTIT_MSE[colour].items():
        fit = fit_mixture(matrix, components, threshold=POSTIT_THRESHOLD)
        assert fit.likelihood_mse <= reference
        fits[components] = fit
    assert fits[3].masked_mse <= POSTIT_MSE[colour][3] / 2
    wanted = thresholded(matrix, POSTIT_THRESHOLD)
    assert_allclose(fits[3].masked_mse, error(fits[3].mixture, wanted), rtol=1e-9)


@pytest.mark.campaign
def test_measured_materials_are_four_components_to_a_millionth(shared_data: Path) -> None:
    paths = sorted((shared_data / "bispectral/rit_bfc450").glob("*.BFC"))
    matrices = (bfc(path) for path in paths)
    glowing = [one for one in matrices if one.reradiated_fraction.max() > 0.1]
    assert len(glowing) == 44
    # Every fourth, for time.
    errors = [fit_mixture(one, 4, threshold=POSTIT_THRESHOLD).masked_mse for one in glowing[::4]]
    assert np.median(errors) <= 1.1e-6
