"""Tests of a dependence on angle: level, power, intervals, over many seeds."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy import stats

from labrig.fit.angular import detectable_sigmas, fit_dependence, typical
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.results import AngleMeans

ANGLES = np.array([30.0, 45.0, 60.0, 75.0, 90.0, 105.0])
SEEDS = 300
SCATTER, NOISE, DRIFT = 0.01, 0.002, 0.03

Draw = Callable[[np.random.Generator, int], FloatArray]
#: Scatter of placings with standard deviation 1.
SCATTERS: dict[str, Draw] = {
    "normal": lambda rng, n: rng.standard_normal(n),
    "heavy tails": lambda rng, n: rng.laplace(size=n) / np.sqrt(2),
    "skewed": lambda rng, n: rng.exponential(size=n) - 1,
}
#: The others take as long.
FIRST_OF_SCATTERS = [
    "normal",
    *(pytest.param(name, marks=pytest.mark.campaign) for name in ("heavy tails", "skewed")),
]


def views(
    rng: np.random.Generator, draw: Draw, change: float = 0.0
) -> tuple[FloatArray, FloatArray]:
    """Angles and signals of four rounds between two views at 30°, the change a straight line."""
    rounds = [rng.permutation(ANGLES) for _ in range(4)]
    angle_deg = np.concatenate([[30.0], *rounds, [30.0]])
    count = len(angle_deg)
    log = SCATTER * draw(rng, count) + NOISE * rng.standard_normal(count)
    log += DRIFT * np.linspace(0, 1, count) + change * (angle_deg - 67.5) / 75
    return angle_deg, 1000 * np.exp(log)


def fits(draw: Draw, change: float = 0.0, seeds: int = SEEDS) -> list[AngleMeans]:
    return [
        fit_dependence(angle_deg, signal, NOISE * signal)
        for angle_deg, signal in (
            views(np.random.default_rng([7, seed]), draw, change) for seed in range(seeds)
        )
    ]


@pytest.mark.parametrize("name", FIRST_OF_SCATTERS)
def test_five_in_a_hundred_are_found_where_there_is_none(name: str) -> None:
    means = fits(SCATTERS[name])
    found = sum(fit.test.finds_dependence for fit in means)
    low, high = stats.binom(SEEDS, 0.05).ppf([0.0005, 0.9995])
    assert found <= high
    assert found >= low or name != "normal"
    inside = sum(fit.test.interval[0] < 0 < fit.test.interval[1] for fit in means)
    # σ that is 20 % too small would leave 89 % inside.
    assert inside / SEEDS == pytest.approx(0.95, abs=0.035)


@pytest.mark.campaign
@pytest.mark.parametrize("name", FIRST_OF_SCATTERS)
def test_a_dependence_of_the_stated_size_is_found_in_nine_of_ten(name: str) -> None:
    exact = np.sqrt(SCATTER**2 + NOISE**2)
    stated = float(np.median([fit.test.detectable for fit in fits(SCATTERS["normal"], 0.0, 60)]))
    sizes = [
        fit_dependence(angle_deg, np.exp(exact * normal), np.zeros(26)).test.amplitude.sigma
        for angle_deg, normal in (
            (views(rng, SCATTERS["normal"])[0], rng.standard_normal(26))
            for rng in (np.random.default_rng(seed) for seed in range(40))
        )
    ]
    expected = np.median(sizes) * typical(19) * detectable_sigmas(0.05, 5, 19)
    assert stated == pytest.approx(expected, rel=0.08)
    means = fits(SCATTERS[name], stated, 300)
    power = np.mean([fit.test.finds_dependence for fit in means])
    assert power == pytest.approx(0.9, abs=0.05)
    amplitude = np.array([fit.test.amplitude.value for fit in means])
    assert amplitude.mean() == pytest.approx(stated, rel=0.03)
    sigma = np.sqrt(np.mean([fit.test.amplitude.sigma**2 for fit in means]))
    assert sigma / amplitude.std() == pytest.approx(1.0, abs=0.15)


def test_scatter_and_drift_are_told_with_their_uncertainty() -> None:
    means = fits(SCATTERS["normal"], seeds=300)
    scatter = np.array([(fit.scatter.value, fit.scatter.sigma) for fit in means])
    assert np.median(scatter[:, 0]) == pytest.approx(SCATTER, rel=0.05)
    assert np.mean(scatter[:, 1]) / scatter[:, 0].std() == pytest.approx(1.0, abs=0.15)
    drift = np.array([(fit.drift.value, fit.drift.sigma) for fit in means])
    off = (drift[:, 0] - np.expm1(DRIFT)) / drift[:, 1]
    # Of the variance 19 / 17 by Student, since the scatter is measured, too.
    assert np.sqrt(np.mean(off**2)) == pytest.approx(np.sqrt(19 / 17), abs=0.15)


def test_what_all_views_share_is_no_dependence() -> None:
    """An error of the reflected light, known to 2 %, looks like a dependence of one σ."""
    shape = np.exp((45 - ANGLES) / 60) - 1
    found = found_without = 0
    for seed in range(80):
        rng = np.random.default_rng([3, seed])
        angle_deg, signal = views(rng, SCATTERS["normal"])
        error = 0.02 * np.interp(angle_deg, ANGLES, shape)
        changed = signal * np.exp(error * rng.standard_normal())
        noise = NOISE * signal
        found += fit_dependence(angle_deg, changed, noise, shared=error).test.finds_dependence
        found_without += fit_dependence(angle_deg, changed, noise).test.finds_dependence
    assert found <= 11
    assert found_without > 20


def test_noise_alone_is_enough_where_placings_do_not_scatter() -> None:
    rng = np.random.default_rng(5)
    angle_deg = np.tile(ANGLES, 4)
    signal = 100 + rng.standard_normal(24)
    fit = fit_dependence(angle_deg, signal, np.full(24, 1.3))
    assert fit.scatter.value == 0.0
    assert fit.mean_sigma == pytest.approx(0.01 * np.sqrt(5 / 24), rel=0.4)
    assert fit.mean == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize(
    ("angle_deg", "signal", "said"),
    [
        ([30, 60], [1.0, 1.0], "several views at each"),
        ([30] * 6, [1.0] * 6, "two or more angles"),
        ([30, 60] * 4, [1.0] * 7 + [-1.0], "above 0"),
    ],
)
def test_too_little_is_one_clear_line(angle_deg: list[int], signal: list[float], said: str) -> None:
    with pytest.raises(DataError, match=said):
        fit_dependence(np.array(angle_deg), np.array(signal), np.full(len(signal), 0.01))


def test_the_detectable_size_is_that_of_the_noncentral_distribution() -> None:
    size = detectable_sigmas(0.05, 1, 10)
    t = stats.nct(10, size)
    assert t.sf(stats.t.isf(0.025, 10)) + t.cdf(stats.t.ppf(0.025, 10)) == pytest.approx(0.9, 1e-3)
