"""Mixtures of normal densities as re-radiation: densities, matrices, conditionals, samples."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.testing import assert_allclose
from scipy.stats import chi2, multivariate_normal

from labrig.material import ConditionalDensity, ReradiationMixture
from tests.material.reradiation.mixtures import random_mixture

DRAWS = 300_000
BINS = 200
#: Chance that a right sampler fails a test of its draws.
LEVEL = 1e-4


def conditional(mixture: ReradiationMixture, given: str) -> ConditionalDensity:
    return mixture.output_given_input if given == "input" else mixture.input_given_output


def stokes_grid(given: str, given_nm: float) -> np.ndarray:
    """Middles of narrow steps from the given wavelength on, closer together near it."""
    shift = np.geomspace(1e-3, 1500, 20_001)
    return given_nm + shift if given == "input" else given_nm - shift


def trapezoid(values: np.ndarray, nm: np.ndarray) -> float:
    return float(abs(np.trapezoid(values, nm)))


both_ways = pytest.mark.parametrize("given", ["input", "output"])
seeds = st.integers(0, 10_000)
wavelengths = st.floats(300, 780)


@given(seed=seeds)
def test_the_density_is_that_of_normal_densities(seed: int) -> None:
    mixture = replace(random_mixture(seed), skew=None)
    points = np.random.default_rng(seed).uniform(300, 780, (20, 2))
    expected = sum(
        weight * multivariate_normal(mean, covariance).pdf(points)
        for weight, mean, covariance in zip(
            mixture.weights, mixture.mean_nm, mixture.covariance_nm2, strict=True
        )
    )
    assert_allclose(mixture.density(*points.T), expected, rtol=1e-8, atol=1e-300)
    is_stokes = points[:, 1] > points[:, 0]
    assert_allclose(
        mixture.reradiation(*points.T), np.where(is_stokes, mixture.scale * expected, 0), rtol=1e-8
    )


@given(seed=seeds)
def test_no_skew_is_a_skew_of_zero(seed: int) -> None:
    mixture = replace(random_mixture(seed), skew=None)
    points = np.random.default_rng(seed).uniform(300, 780, (20, 2)).T
    not_skewed = replace(mixture, skew=np.zeros((3, 2)))
    assert_allclose(not_skewed.density(*points), mixture.density(*points), rtol=1e-12)


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("skew", [-0.9, 0.6])
def test_a_skew_is_half_the_log_of_the_ratio_of_widths_and_keeps_median_and_peak_width(
    axis: int, skew: float
) -> None:
    skews = np.where(np.arange(2) == axis, skew, 0.0)[np.newaxis]
    mean, covariance = np.array([[500.0, 500.0]]), np.diag([400.0, 400.0])[np.newaxis]
    component = ReradiationMixture(1.0, np.ones(1), mean, covariance, skews)

    def along(nm: np.ndarray) -> np.ndarray:
        pair = (nm, 500.0) if axis == 0 else (500.0, nm)
        return component.density(*pair) / component.density(500.0, 500.0)

    nm = np.linspace(-3000.0, 4000.0, 700_001)
    total = np.cumsum(along(nm))
    assert_allclose(nm[np.searchsorted(total, total[-1] / 2)], 500, atol=0.02)
    # At the median the density is that of the median of a normal one of 20 nm.
    assert_allclose(total[-1] * 0.01, 20 * np.sqrt(2 * np.pi), rtol=1e-6)
    # Far out, the logarithm falls with the square of the distance over the width.
    widths = [
        far_nm / np.sqrt(-2 * np.log(along(np.array([500.0 + side * far_nm]))[0]))
        for side, far_nm in ((1, 300 * np.exp(skew)), (-1, 300 * np.exp(-skew)))
    ]
    assert_allclose(0.5 * np.log(widths[0] / widths[1]), skew, rtol=0.1)


@both_ways
@settings(max_examples=25)
@given(seed=seeds, given_nm=wavelengths)
def test_a_conditional_times_its_integral_is_the_joint_density(
    given: str, seed: int, given_nm: float
) -> None:
    mixture = random_mixture(seed)
    density = conditional(mixture, given)
    other_nm = stokes_grid(given, given_nm)[::100]
    joint = (
        mixture.density(given_nm, other_nm)
        if given == "input"
        else mixture.density(other_nm, given_nm)
    )
    product = density.pdf(other_nm, given_nm) * density.integral(given_nm)
    assert_allclose(product, joint, rtol=1e-6, atol=1e-280)


@both_ways
@settings(max_examples=6)
@given(seed=seeds, given_nm=wavelengths)
def test_pdf_and_cdf_agree_and_end_at_the_diagonal(given: str, seed: int, given_nm: float) -> None:
    density = conditional(random_mixture(seed), given)
    nm = stokes_grid(given, given_nm)
    pdf, cdf = density.pdf(nm, given_nm), density.cdf(nm, given_nm)
    start = abs(nm[0] - given_nm) * pdf[0]
    assert_allclose(trapezoid(pdf, nm) + start, 1, rtol=2e-4)
    half = len(nm) // 2
    assert_allclose(trapezoid(pdf[half:], nm[half:]), abs(cdf[-1] - cdf[half]), atol=1e-4)
    side = 1 if given == "input" else -1
    assert density.pdf(given_nm - side * np.array([0, 1e-9, 50]), given_nm).tolist() == [0, 0, 0]
    beyond = density.cdf(given_nm - side * np.array([0, 50]), given_nm)
    assert beyond.tolist() == ([0, 0] if given == "input" else [1, 1])


@both_ways
@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.campaign)])
def test_draws_have_the_density(given: str, seed: int) -> None:
    density = conditional(random_mixture(seed), given)
    given_nm = 470.0 if given == "input" else 540.0
    drawn = density.sample(np.full(DRAWS, given_nm), np.random.default_rng(seed))
    assert ((drawn > given_nm) if given == "input" else (drawn < given_nm)).all()
    edges = np.quantile(drawn[:10_000], np.linspace(0, 1, BINS + 1)[1:-1])
    counts = np.bincount(np.searchsorted(edges, drawn), minlength=BINS)
    expected = DRAWS * np.diff(np.concatenate([[0], density.cdf(edges, given_nm), [1]]))
    assert ((counts - expected) ** 2 / expected).sum() < chi2.isf(LEVEL, BINS - 1)


@pytest.mark.parametrize("given", ["input", pytest.param("output", marks=pytest.mark.campaign)])
@pytest.mark.parametrize("seed", [3])
def test_the_mean_weight_of_draws_is_the_integral(given: str, seed: int) -> None:
    # Weighted by a re-radiation that is not the sampled one, as of a measured matrix.
    sampled, wanted = random_mixture(seed, 2), random_mixture(seed + 100, 2)
    mixed = ReradiationMixture(
        7.0,
        np.concatenate([0.5 * sampled.weights, 0.5 * wanted.weights]),
        np.concatenate([sampled.mean_nm, wanted.mean_nm]),
        np.concatenate([sampled.covariance_nm2, wanted.covariance_nm2]),
        np.concatenate([sampled.skews, wanted.skews]),
    )
    given_nm = 470.0 if given == "input" else 540.0
    density = conditional(mixed, given)
    drawn = density.sample(np.full(DRAWS, given_nm), np.random.default_rng(seed))
    pair = (given_nm, drawn) if given == "input" else (drawn, given_nm)
    weight = wanted.reradiation(*pair) / density.pdf(drawn, given_nm)
    nm = stokes_grid(given, given_nm)
    line = (given_nm, nm) if given == "input" else (nm, given_nm)
    assert_allclose(weight.mean(), trapezoid(wanted.reradiation(*line), nm), rtol=3e-3)
    assert_allclose(
        weight.mean(), wanted.scale * conditional(wanted, given).integral(given_nm), rtol=3e-3
    )


@both_ways
@given(seed=seeds, given_nm=st.floats(1, 1e5))
@settings(max_examples=25)
def test_draws_are_uniform_in_the_cdf_however_far_the_tail(
    given: str, seed: int, given_nm: float
) -> None:
    density = conditional(random_mixture(seed), given)
    drawn = density.sample(np.full(2000, given_nm), np.random.default_rng(seed))
    uniform = np.sort(density.cdf(drawn, given_nm))
    assert np.isfinite(drawn).all()
    # Kolmogorov and Smirnov's distance at a chance of 1e-7, for the many examples.
    assert abs(uniform - (np.arange(2000) + 0.5) / 2000).max() < 2.9 / np.sqrt(2000)


def test_sampling_takes_arrays_of_any_shape_and_repeats_by_its_generator() -> None:
    density = random_mixture(5).output_given_input
    given_nm = np.linspace(320, 600, 12).reshape(3, 4)
    first, second = (density.sample(given_nm, np.random.default_rng(9)) for _ in range(2))
    assert first.shape == (3, 4)
    assert (first == second).all()
    assert (first > given_nm).all()
    assert density.pdf(first, given_nm).shape == (3, 4)


def test_a_matrix_has_the_mixture_at_its_centres_on_the_stokes_side() -> None:
    mixture = random_mixture(6)
    input_nm, output_nm = np.arange(300.0, 781, 10), np.arange(380.0, 781, 10)
    matrix = mixture.to_matrix(
        input_nm, output_nm, reflectance=np.full(41, 0.5), name="dye"
    )  # fmt: skip
    assert matrix.name == "dye"
    assert_allclose(matrix.reflectance, 0.5)
    expected = mixture.scale * mixture.density(input_nm, output_nm[:, np.newaxis])
    assert_allclose(matrix.reradiation, np.where(matrix.is_stokes, expected, 0))
    assert np.isnan(mixture.to_matrix(input_nm, output_nm).reflectance).all()


def test_columns_of_a_fine_matrix_sum_to_the_fraction_that_is_reradiated() -> None:
    mixture = random_mixture(7)
    input_nm = np.arange(300.0, 781, 40)
    matrix = mixture.to_matrix(input_nm, np.arange(300.25, 1200, 0.5))
    assert_allclose(matrix.reradiated_fraction, mixture.reradiated_fraction(input_nm), rtol=1e-3)


@pytest.mark.parametrize(
    ("scale", "weights", "mean", "covariance", "message"),
    [
        (1.0, [0.5, 0.4], [[450, 520]] * 2, [np.eye(2)] * 2, "sum to 1"),
        (1.0, [1.5, -0.5], [[450, 520]] * 2, [np.eye(2)] * 2, "at least 0"),
        (-1.0, [1.0], [[450, 520]], [np.eye(2)], "at least 0"),
        (1.0, [1.0], [[450, 520]] * 2, [np.eye(2)], "shapes"),
        (1.0, [], np.empty((0, 2)), np.empty((0, 2, 2)), "shapes"),
        (1.0, [1.0], [[450, np.nan]], [np.eye(2)], "finite"),
        (1.0, [1.0], [[450, 520]], [[[1, 2], [2, 1]]], "positive definite"),
        (1.0, [1.0], [[450, 520]], [[[2, 1], [0, 2]]], "symmetric"),
    ],
)
def test_what_is_no_mixture_is_refused(
    scale: float, weights: list[float], mean: object, covariance: object, message: str
) -> None:
    arrays = (np.asarray(numbers, dtype=np.float64) for numbers in (weights, mean, covariance))
    with pytest.raises(ValueError, match=message):
        ReradiationMixture(scale, *arrays)
