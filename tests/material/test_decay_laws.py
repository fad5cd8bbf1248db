"""Laws of decay against numerical integration, differential equations and differences."""

import math

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from labrig.foundation.arrays import FloatArray
from labrig.material import DECAY_LAWS

T_S = np.array([0.0, 0.3, 5.0, 50.0, 175.0])
EXPOSURE_S = np.array([0.0, 1e-3, 0.5, 2.0, 5.0])
CASES = [
    ("becquerel", 0.0),
    ("becquerel", 1e-6),
    ("becquerel", 0.3),
    ("becquerel", 1.0),
    ("becquerel", 2.5),
    ("otor", 1e-3),
    ("otor", 0.3),
    ("otor", 1.0),
    ("stretched", 0.3),
    ("stretched", 0.9),
]


def value(name: str, shape: float, phase: float) -> float:
    """The laws as their papers write them, in another form than the product's."""
    if name == "stretched":
        return math.exp(-(phase**shape))
    if name == "becquerel":
        return math.exp(-phase) if shape == 0 else (1 + shape * phase) ** (-1 / shape)
    if phase == 0:
        return 1.0
    # The level falls by dm/d(kt) = −m²/(g + (1 − g) m), in log m so that it stays exact.
    fallen = solve_ivp(
        lambda _, log_m: -np.exp(log_m) / (shape + (1 - shape) * np.exp(log_m)),
        (0.0, phase),
        [0.0],
        rtol=1e-11,
        atol=1e-13,
        method="DOP853",
    )
    level = math.exp(fallen.y[0, -1])
    return level**2 / (shape + (1 - shape) * level)


@pytest.mark.parametrize(("name", "shape"), CASES)
def test_a_law_has_its_value_at_any_time(name: str, shape: float) -> None:
    phase = np.array([0.0, 0.01, 0.5, 3.0, 20.0])
    expected = [value(name, shape, float(x)) for x in phase]
    law = DECAY_LAWS[name]
    np.testing.assert_allclose(law.value(phase, np.full(5, shape)), expected, rtol=1e-8)
    means, _ = law.means(1.0, shape, phase, np.zeros(5))
    np.testing.assert_allclose(means, expected, rtol=1e-8)


@pytest.mark.parametrize("name", sorted(DECAY_LAWS))
def test_several_rates_and_shapes_at_once_are_those_one_by_one(name: str) -> None:
    law = DECAY_LAWS[name]
    rates, shapes = np.array([0.01, 0.3, 2.0]), np.array([law.shapes[0], 0.4, law.shapes[1]])
    means, slopes = law.means(rates[:, None], shapes[:, None], T_S, EXPOSURE_S)
    for row, (rate, shape) in enumerate(zip(rates, shapes, strict=True)):
        mean, slope = law.means(float(rate), float(shape), T_S, EXPOSURE_S)
        np.testing.assert_allclose(means[row], mean, rtol=1e-13)
        np.testing.assert_allclose(slopes[row], slope, rtol=1e-13, atol=1e-300)


@pytest.mark.parametrize(("name", "shape"), CASES)
@pytest.mark.parametrize("rate_per_s", [0.01, 0.3])
def test_an_exposure_averages_the_value(name: str, shape: float, rate_per_s: float) -> None:
    law = DECAY_LAWS[name]

    def at(t_s: float) -> float:
        return float(law.value(np.array([rate_per_s * t_s]), np.array([shape]))[0])

    means, _ = law.means(rate_per_s, shape, T_S, EXPOSURE_S)
    expected = [at(0.0)] + [
        quad(at, t_s, t_s + exposure_s, epsrel=1e-10)[0] / exposure_s
        for t_s, exposure_s in zip(T_S[1:], EXPOSURE_S[1:], strict=True)
    ]
    # A stretched exponential is averaged with eight points an exposure.
    np.testing.assert_allclose(means, expected, rtol=1e-6 if name == "stretched" else 1e-8)


@pytest.mark.parametrize(("name", "shape"), CASES)
@pytest.mark.parametrize("exposure_s", [np.zeros(5), EXPOSURE_S])
def test_slopes_are_the_differences(name: str, shape: float, exposure_s: FloatArray) -> None:
    law, rate_per_s, step = DECAY_LAWS[name], 0.03, 1e-5
    low, high = max(shape - step, law.shapes[0]), min(shape + step, law.shapes[1])

    def mean(log_factor: float, shape: float) -> FloatArray:
        return law.means(rate_per_s * math.exp(log_factor), shape, T_S, exposure_s)[0]

    _, slopes = law.means(rate_per_s, shape, T_S, exposure_s)
    by_log_rate = (mean(step, shape) - mean(-step, shape)) / (2 * step)
    by_shape = (mean(0.0, high) - mean(0.0, low)) / (high - low)
    np.testing.assert_allclose(slopes[:, 0], by_log_rate, atol=1e-6)
    np.testing.assert_allclose(slopes[:, 1], by_shape, atol=1e-4)


def test_at_their_limits_all_laws_are_an_exponential() -> None:
    phase = np.linspace(0.0, 10.0, 20)
    for name in ("becquerel", "otor"):
        limit = DECAY_LAWS[name].value(phase, np.zeros(20))
        np.testing.assert_allclose(limit, np.exp(-phase), rtol=1e-12)
