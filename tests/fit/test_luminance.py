"""Luminances at the times of trade standards, from readings of laws that are not assumed."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from labrig.fit import fit_luminance
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from labrig.material import DECAY_LAWS, exponential_means
from labrig.results import LuminanceDecay, LuminanceRequirement, Measured, Verdict
from tests.pulls import assert_sigma_is_right
from tests.warned import of_code

LOGGED_S = np.geomspace(60, 40_000, 60)
SCALE = 0.005
Law = Callable[[FloatArray], FloatArray]


def becquerel(t_s: FloatArray) -> FloatArray:
    return np.asarray(300 * (1 + t_s / 60) ** -1.1)


def one_trap(t_s: FloatArray) -> FloatArray:
    return np.asarray(400 * DECAY_LAWS["otor"].value(t_s / 400, np.full(len(t_s), 0.4)))


def states(t_s: FloatArray) -> FloatArray:
    rates = np.array([1e-2, 1.3e-3, 1.8e-4])
    return np.asarray(exponential_means(rates, t_s, np.zeros(len(t_s))) @ [200.0, 40.0, 8.0])


def logged(law: Law, seed: int, t_s: FloatArray = LOGGED_S) -> tuple[FloatArray, FloatArray]:
    """Readings of a meter with a wrong scale, and their σ."""
    random = np.random.default_rng(seed)
    sigma = np.hypot(0.01 * law(t_s), 0.01)
    scale = 1 + SCALE * random.standard_normal()
    return scale * (law(t_s) + sigma * random.standard_normal(len(t_s))), sigma


def end_s(law: Law) -> float:
    """Time at which a law falls below 0.3 mcd/m²."""
    t_s = np.geomspace(60, 80_000, 200_000)
    return float(t_s[np.argmax(law(t_s) < 0.3)])


@pytest.mark.parametrize(
    "known",
    [
        pytest.param(True, id="given σ", marks=pytest.mark.campaign),
        pytest.param(False, id="scatter"),
    ],
)
def test_errors_are_as_large_as_their_sigma(known: bool) -> None:
    pulls = []
    for number, law in enumerate([becquerel, one_trap, states] * 6):
        value, sigma = logged(law, 7000 + number)
        found = fit_luminance(LOGGED_S, value, sigma if known else None, scale_sigma=SCALE)
        for entry in found.at:
            assert entry.luminance is not None
            true = law(np.array([entry.t_s]))[0]
            pulls.append((entry.luminance.value - true) / entry.luminance.sigma)
        assert found.visible_s is not None
        pulls.append((found.visible_s.value - end_s(law)) / found.visible_s.sigma)
        assert found.warnings == ()
    assert_sigma_is_right(pulls)


def test_errors_in_common_may_grow_towards_the_end() -> None:
    """As that of a zero does: a luminance has the σ of its time, a slope what comes on top."""
    value, sigma = logged(becquerel, 3)
    common = np.where(LOGGED_S < 1000, 0.02, 0.05)
    found = fit_luminance(LOGGED_S, value, sigma, scale_sigma=common)
    constant = fit_luminance(LOGGED_S, value, sigma, scale_sigma=0.02)
    early, late = found.at[1].luminance, found.at[3].luminance
    assert early is not None
    assert late is not None
    assert early.sigma / early.value == pytest.approx(0.02, rel=0.1)
    assert late.sigma / late.value == pytest.approx(0.05, rel=0.1)
    assert found.slope is not None
    assert constant.slope is not None
    added = np.sqrt(0.05**2 - 0.02**2) / np.log(6)
    assert found.slope.sigma == pytest.approx(np.hypot(constant.slope.sigma, added))
    assert found.scale_sigma == 0.05
    with pytest.raises(FitError, match="relative σ of the scale"):
        fit_luminance(LOGGED_S, value, sigma, scale_sigma=np.nan)


def test_readings_by_hand_do() -> None:
    """A few readings at round times: the parabola's own misfit is in σ."""
    t_s = 60.0 * np.array([1, 2, 5, 10, 15, 20, 30, 45, 60, 90, 120])
    for seed, law in enumerate((becquerel, one_trap, states)):
        value, sigma = logged(law, seed, t_s)
        found = fit_luminance(t_s, value, sigma, scale_sigma=SCALE)
        for entry in found.at:
            assert entry.luminance is not None
            true = law(np.array([entry.t_s]))[0]
            assert abs(entry.luminance.value - true) < 4 * entry.luminance.sigma
            assert entry.luminance.sigma < 0.12 * true


def test_an_end_that_was_not_measured_is_not_in_the_marking() -> None:
    t_s = LOGGED_S[LOGGED_S < 7200]
    value, sigma = logged(becquerel, 1, t_s)
    found = fit_luminance(t_s, value, sigma, scale_sigma=SCALE, colours="K-W")
    assert found.visible_s is None
    assert found.marking is not None
    assert found.marking.endswith("-K-W")
    assert found.marking.count("-") == 2
    assert found.visible_forecast is not None
    assert found.visible_forecast.between_s is not None
    early, late = found.visible_forecast.between_s
    assert 7200 < early < late
    assert early < 1.1 * end_s(becquerel)
    assert late > 0.9 * end_s(becquerel)


def test_a_luminance_without_readings_around_it_is_not_stated() -> None:
    t_s = LOGGED_S[LOGGED_S > 300]
    value, sigma = logged(becquerel, 2, t_s)
    found = fit_luminance(t_s, value, sigma, required=[LuminanceRequirement(120.0, 10.0)])
    assert found.at[0].luminance is None
    assert found.at[1].luminance is not None
    ((_, entry),) = found.required
    assert entry.verdict(10.0) is Verdict.NOT_MEASURED


def test_a_light_that_stays_is_said() -> None:
    """A lamp that shows the sample as 0.2 mcd/m² spoils the last time."""
    for seed in range(3):
        value, sigma = logged(becquerel, 50 + seed)
        found = fit_luminance(LOGGED_S, value + 0.2, sigma, scale_sigma=SCALE)
        light = of_code(found.warnings, "constant-light").values["light_mcd_per_m2"]
        assert light == pytest.approx(0.2, rel=0.5)


def test_slope_and_sum_are_those_of_a_power_law() -> None:
    value = 5e5 * LOGGED_S**-1.2
    found = fit_luminance(LOGGED_S, value, 1e-3 * value)
    assert found.slope is not None
    assert found.slope.value == pytest.approx(1.2, abs=1e-9)
    first, last = LOGGED_S[0], LOGGED_S[-1]
    expected = 5e5 / 0.2 * (first**-0.2 - last**-0.2)
    assert found.light_sum.value == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(
    ("sigma", "verdict"),
    [(0.5, Verdict.PASS), (2.0, Verdict.UNDECIDED)],
)
def test_a_requirement_is_met_with_a_probability_of_95_percent(
    sigma: float, verdict: Verdict
) -> None:
    value = becquerel(LOGGED_S)
    found = fit_luminance(LOGGED_S, value, 1e-4 * value, scale_sigma=sigma / 21.3)
    entry = found.at[1]
    assert entry.luminance is not None
    assert entry.verdict(entry.luminance.value - 1.0) is verdict
    opposite = Verdict.FAIL if verdict is Verdict.PASS else verdict
    assert entry.verdict(entry.luminance.value + 1.0) is opposite


@pytest.mark.campaign
def test_halves_of_a_real_decay_agree(shared_data: Path) -> None:
    """Every other reading of strontium aluminate: the halves differ by their σ."""
    table = shared_data / "decay/perslqy_sao/sample_400_524_300s.txt"
    t_s, value = np.loadtxt(table, skiprows=1, usecols=(0, 1), unpack=True)
    later = t_s > 340
    t_s, value = t_s[later] - 330.0, value[later]

    def half(first: int) -> LuminanceDecay:
        return fit_luminance(t_s[first::2], value[first::2])

    even, odd = half(0), half(1)
    pairs = [
        (a.luminance, b.luminance)
        for a, b in zip(even.at, odd.at, strict=True)
        if a.luminance and b.luminance
    ]
    assert len(pairs) >= 2
    for first, second in pairs:
        assert isinstance(first, Measured)
        assert abs(first.sigmas_from(second)) < 4
        assert first.sigma < 0.01 * first.value


@pytest.mark.parametrize(
    ("t_s", "value", "sigma"),
    [
        (np.arange(1.0, 5.0), np.ones(4), 0.1),
        (np.arange(1.0, 8.0), np.ones(7), None),
        (np.arange(0.0, 9.0), np.ones(9), 0.1),
        (np.ones(9), np.ones(9), 0.1),
        (np.arange(1.0, 10.0), np.full(9, np.nan), 0.1),
        (np.arange(1.0, 10.0), np.zeros(9), 0.1),
        (np.arange(1.0, 10.0), np.ones(9), 0.0),
    ],
)
def test_readings_that_cannot_be(t_s: FloatArray, value: FloatArray, sigma: float | None) -> None:
    with pytest.raises(FitError, match=r"^expected "):
        fit_luminance(t_s, value, sigma)
