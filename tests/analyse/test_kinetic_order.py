"""Decays from several levels of charge tell a kinetic order by their rate at lamp off."""

import numpy as np
import pytest

from labrig.material import dark_concentration
from labrig.protocols.saturation.analysis import compare_levels
from labrig.protocols.saturation.result import Curve, OrderTest
from tests.pulls import assert_sigma_is_right

T_S = np.arange(1.0, 120.0, 4.0)


def noisy(light: np.ndarray, seed: int) -> Curve:
    rng, sigma, offset_sigma = np.random.default_rng(seed), 0.005 * light + 0.01, 0.05
    noise = sigma * rng.standard_normal(len(light)) + offset_sigma * rng.standard_normal()
    return Curve(T_S, np.zeros_like(T_S), light + noise, sigma, offset_sigma)


def of_order(order: float, levels: tuple[float, ...], seed: int) -> OrderTest:
    k = 0.05
    decays = [1e3 * k * dark_concentration(level, k, order, T_S) ** order for level in levels]
    found = compare_levels([noisy(light, 100 * seed + n) for n, light in enumerate(decays)])
    assert found is not None
    return found


@pytest.mark.parametrize(
    ("order", "verdict"), [(1.0, "first order"), (1.3, "general order"), (2.0, "general order")]
)
def test_the_shift_of_the_rate_tells_the_order(order: float, verdict: str) -> None:
    found = of_order(order, (0.1, 0.25, 0.8), 0)
    assert found.verdict == verdict
    assert abs(found.order.value - order) < 4 * found.order.sigma
    assert found.order.sigma < 0.05


@pytest.mark.campaign
def test_the_sigma_of_the_shift_is_right() -> None:
    pulls = []
    for seed in range(80):
        found = of_order(1.6, (0.2, 0.5), seed)
        expected = 0.6 / 1.6
        pulls.append((found.shift.value - expected) / found.shift.sigma)
        pulls.append((found.shape.value - expected) / found.shape.sigma)
        pulls.append((found.shape.value - found.shift.value) / found.difference_sigma)
    assert abs(np.mean(pulls)) < 0.35
    assert_sigma_is_right(pulls)


def test_a_fixed_mixture_of_exponentials_is_no_order() -> None:
    mixture = np.exp(-0.1 * T_S) + 0.5 * np.exp(-0.03 * T_S)
    found = compare_levels([noisy(scale * mixture, int(scale)) for scale in (100.0, 30.0, 10.0)])
    assert found is not None
    assert found.verdict == "first order"
    assert found.shape.value > 0.1


def test_charges_that_hardly_differ_decide_nothing() -> None:
    assert of_order(1.6, (0.5, 0.51), 1).verdict == "not decided"


def test_one_decay_or_darkness_tells_nothing() -> None:
    light = np.exp(-0.1 * T_S)
    assert compare_levels([noisy(light, 0)]) is None
    dark = Curve(T_S, np.zeros_like(T_S), -light, np.ones_like(light), 0.0)
    assert compare_levels([noisy(light, 0), dark]) is None
