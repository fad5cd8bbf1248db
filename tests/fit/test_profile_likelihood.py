"""Intervals by profile likelihood: against linear theory, lmfit, and their own probability."""

from collections.abc import Callable

import lmfit  # type: ignore[import-untyped]
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.special import ndtr, ndtri

from labrig.fit.nonlinear_least_squares import Residuals
from labrig.fit.profile_likelihood import (
    Likelihood,
    LowerMinimumError,
    NoiseScale,
    Quantity,
    away_from_bound,
    parameter,
    toward_bound,
)
from labrig.foundation.arrays import FloatArray
from labrig.results import NORMAL_95, ProfileInterval

T_S = np.arange(0.0, 60.0, 1.5)
NO_BOUND = np.full(4, np.inf)


def two_states(sigma: float, seed: int, unit: float = 1.0) -> Residuals:
    """Return residuals of exponentials by [log k₁, a₁, log k₂, a₂], in a unit."""
    rng = np.random.default_rng(seed)
    y = np.exp(-0.3 * T_S) + 0.6 * np.exp(-0.05 * T_S) + sigma * rng.standard_normal(len(T_S))

    def residuals(x: FloatArray) -> tuple[FloatArray, FloatArray]:
        rates = np.exp(x[[0, 2]])
        decays = np.exp(-np.multiply.outer(T_S, rates))
        slopes = -T_S[:, None] * rates * x[[1, 3]] * decays
        columns = [slopes[:, 0], decays[:, 0], slopes[:, 1], decays[:, 1]]
        return (decays @ x[[1, 3]] - y) / unit, np.stack(columns, axis=1) / unit

    return residuals


def test_limits_are_those_of_lmfit() -> None:
    """The scale of the noise is free: the F-test. lmfit ends within a part in 10³ of σ."""
    residuals = two_states(0.04, 3)
    likelihood = Likelihood.at_minimum(
        residuals, np.array([-1.0, 1.0, -3.0, 0.6]), -NO_BOUND, NO_BOUND
    )
    fit = likelihood.fit
    noise = NoiseScale(fit.reduced_chi2, fit.dof)
    parameters = lmfit.Parameters()
    for name, value in zip("abcd", fit.parameters, strict=True):
        parameters.add(name, value)

    def plain(values: lmfit.Parameters) -> FloatArray:
        return residuals(np.array([values[name].value for name in "abcd"]))[0]

    minimizer = lmfit.Minimizer(plain, parameters)
    limits = lmfit.conf_interval(
        minimizer, minimizer.leastsq(), p_names=["a", "c"], sigmas=[ndtr(1) - ndtr(-1), 0.95]
    )
    for number, name in ((0, "a"), (2, "c")):
        own = likelihood.interval(Quantity(parameter(number)), noise)
        found = np.array([own.low_95, own.low_68, own.value, own.high_68, own.high_95])
        theirs = np.array([value for _, value in limits[name]])
        sigma = fit.sigma[number] * np.sqrt(fit.reduced_chi2)
        assert np.abs(found - theirs).max() < 2e-3 * sigma
        # What is compared is not ±σ.
        asymmetry = np.log((own.high_95 - own.value) / (own.value - own.low_95))
        assert abs(asymmetry) > 0.1


@given(
    st.integers(0, 10_000),
    st.floats(0.5, 2.0),
    st.sampled_from([np.inf, 5.0]),
)
@settings(max_examples=20, deadline=None)
def test_limits_of_a_linear_model_are_its_sigma(seed: int, variance: float, dof: float) -> None:
    rng = np.random.default_rng(seed)
    design, y = rng.normal(size=(9, 3)), rng.normal(size=9)
    likelihood = Likelihood.at_minimum(
        lambda x: (design @ x - y, design), np.zeros(3), -NO_BOUND[:3], NO_BOUND[:3]
    )
    interval = likelihood.interval(Quantity(parameter(1)), NoiseScale(variance, dof))
    sigma = float(likelihood.fit.sigma[1]) * np.sqrt(variance)
    quantiles = (1.0, NORMAL_95) if np.isinf(dof) else (1.11, 2.5706)
    expected = [interval.value + side * q * sigma for q in quantiles for side in (-1, 1)]
    found = [interval.low_68, interval.high_68, interval.low_95, interval.high_95]
    assert found == pytest.approx(expected, abs=5e-3 * sigma)
    assert not likelihood.is_asymmetric(Quantity(parameter(1)), float)


def test_limits_follow_the_quantity() -> None:
    """Those of a product of parameters are found as if it were one."""
    residuals = two_states(0.06, 5, unit=0.06)
    likelihood = Likelihood.at_minimum(
        residuals,
        np.array([-1.0, 1.0, -3.0, 0.6]), -NO_BOUND, NO_BOUND,
    )  # fmt: skip

    def rate(x: FloatArray) -> tuple[float, FloatArray]:
        return float(np.exp(x[0])), np.array([np.exp(x[0]), 0, 0, 0])

    # The weight of a curved quantity leads to the same point of the profile.
    of_rate = likelihood.interval(Quantity(rate, least=0.0))
    of_log = likelihood.interval(Quantity(parameter(0))).mapped(lambda value: float(np.exp(value)))
    assert of_rate.low_95 == pytest.approx(of_log.low_95, rel=1e-3)
    assert of_rate.high_95 == pytest.approx(of_log.high_95, rel=1e-3)
    assert likelihood.is_asymmetric(Quantity(rate), float)
    assert of_rate.differs_from(float(likelihood.fit.sigma[0] * of_rate.value))


@pytest.mark.parametrize("sigmas", [1.0, NORMAL_95])
@pytest.mark.parametrize("mu", [0.0, 0.3, 0.9, 1.7, 3.0])
def test_limits_near_a_bound_hold_the_truth_as_often_as_they_say(mu: float, sigmas: float) -> None:
    """The estimates x of μ ≥ 0 with σ 1 are in steps of equal probability."""
    steps = 1000
    estimates = ndtri((np.arange(steps) + 0.5) / steps) + mu
    held = 0
    for x in estimates.tolist():
        if x < 0:
            high = -abs(x) + np.sqrt(x * x + away_from_bound(-x, sigmas) ** 2)
            low = 0.0
        else:
            toward = toward_bound(x, sigmas)
            low, high = 0.0 if toward is None else x - toward, x + sigmas
        held += low <= mu <= high
    assert held / steps == pytest.approx(ndtr(sigmas) - ndtr(-sigmas), abs=0.004)


@pytest.mark.parametrize("pull", [-2.0, -0.5, 0.2, 1.2, 5.0])
def test_a_parameter_with_a_bound_has_the_limits_of_the_normal_distribution(pull: float) -> None:
    """Whatever else is fitted: the slope of a line through noise-free points, with σ 0.3."""
    x = np.linspace(-1, 1, 11)
    design = np.stack([x, np.ones(11)], axis=1) / (0.3 * np.sqrt(x @ x))
    y = design @ [0.3 * pull, 0.7]
    likelihood = Likelihood.at_minimum(
        lambda theta: (design @ theta - y, design),
        np.array([0.5, 0.0]), np.array([0.0, -np.inf]), NO_BOUND[:2],
    )  # fmt: skip
    interval = likelihood.interval(Quantity(parameter(0), least=0.0, searched=(0.0, np.inf)))
    toward = toward_bound(max(pull, 0.0), NORMAL_95)
    assert interval.low_95 == pytest.approx(
        0.0 if toward is None else 0.3 * (pull - toward), abs=2e-3
    )
    if pull >= 0:
        assert interval.high_95 == pytest.approx(0.3 * (pull + NORMAL_95), abs=2e-3)
    else:
        far = away_from_bound(-pull, NORMAL_95)
        assert interval.high_95 == pytest.approx(0.3 * (np.sqrt(pull**2 + far**2) + pull), abs=2e-3)
    assert interval.is_one_sided == (toward is None)


def test_a_limit_that_the_data_do_not_tell_is_none() -> None:
    """The time constant of a decay that is over before the second value."""
    t_s = np.array([0.0, 5.0, 10.0, 15.0])
    y = np.array([1.0, 0.0, 0.05, -0.02]) / 0.1

    def residuals(x: FloatArray) -> tuple[FloatArray, FloatArray]:
        rate = np.exp(x[0])
        decay = np.exp(-rate * t_s)
        slopes = [-x[1] * rate * t_s * decay, decay]
        return x[1] * decay / 0.1 - y, np.stack(slopes, axis=1) / 0.1

    likelihood = Likelihood.at_minimum(
        residuals, np.array([0.0, 1.0]), np.array([-5.0, 0.0]), np.array([4.0, np.inf])
    )
    interval = likelihood.interval(Quantity(parameter(0), searched=(-5.0, 4.0)))
    assert np.isinf(interval.high_68)
    assert interval.is_one_sided
    # exp(−5 k) 1 = 0.2, two σ, but for the share of the other values.
    assert np.exp(interval.low_95) == pytest.approx(np.log(5) / 5, rel=0.15)


def test_a_profile_that_falls_below_the_fit_is_no_interval() -> None:
    """From a minimum that is none of the lowest: (x² − 1)² with a tilt."""

    def residuals(x: FloatArray) -> tuple[FloatArray, FloatArray]:
        return np.array([2 * (x[0] ** 2 - 1), x[0] - 1.0]), np.array([[4 * x[0]], [1.0]])

    likelihood = Likelihood.at_minimum(residuals, np.array([-0.9]), -NO_BOUND[:1], NO_BOUND[:1])
    assert likelihood.fit.parameters[0] < 0
    with pytest.raises(LowerMinimumError):
        likelihood.interval(Quantity(parameter(0)))


def test_states_do_not_change_places() -> None:
    """The profile of the fast rate is not that of the slow where one exponential does as well."""
    residuals = two_states(0.3, 4, unit=0.3)
    likelihood = Likelihood.at_minimum(
        residuals,
        np.array([-1.0, 1.0, -3.0, 0.6]),
        np.array([-8.0, 0.0, -8.0, 0.0]), np.array([3.0, np.inf, 3.0, np.inf]),
    )  # fmt: skip
    searched = (-8.0, 3.0)
    fast = likelihood.interval(Quantity(parameter(0), searched=searched, not_above=(2,)))
    slow = likelihood.interval(Quantity(parameter(2), searched=searched, not_below=(0,)))
    assert fast.low_95 > slow.low_95
    assert fast.value > slow.value
    assert fast.low_68 <= fast.value <= fast.high_68
    assert slow.low_95 <= slow.low_68 <= slow.value


POSITIVE = ProfileInterval(2.0, 1.5, 3.0, 1.1, 5.0, least=0.0)


@pytest.mark.parametrize("function", [lambda value: 1 / value if value else np.inf, np.log1p])
def test_a_monotone_function_keeps_the_sides(function: Callable[[float], float]) -> None:
    interval = POSITIVE.mapped(function)
    assert interval.low_95 < interval.low_68 < interval.value < interval.high_68 < interval.high_95
    assert not interval.is_one_sided


def test_an_error_of_the_light_moves_limits_by_its_own_share() -> None:
    widened = POSITIVE.widened(0.1)
    assert widened.high_68 == pytest.approx(2 * np.exp(np.hypot(np.log(1.5), 0.1)))
    assert widened.low_95 == pytest.approx(2 / np.exp(np.hypot(np.log(2 / 1.1), 0.1 * NORMAL_95)))
