"""States of general order against an integrator that does not know their solutions."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.integrate import solve_ivp

from labrig.material import (
    DECAY_LAWS,
    becquerel_of,
    concentration,
    dark_concentration,
    dark_step,
    lit_concentration,
    lit_step,
    mean_emission,
    steady_concentration,
)

rates = st.floats(-4, 0.5).map(lambda exponent: 10.0**exponent)
orders = st.floats(1.0, 4.0)
concentrations = st.one_of(st.just(0.0), st.floats(1e-3, 1.0))
durations = st.floats(-1, 3).map(lambda exponent: 10.0**exponent)


def integrated(start: float, kappa: float, k: float, b: float, duration_s: float) -> float:
    """r(t) by a method for stiff equations."""
    solved = solve_ivp(
        lambda _, r: (1 - r) * kappa - k * np.maximum(r, 0.0) ** b,
        (0.0, duration_s),
        [start],
        method="LSODA",
        rtol=1e-10,
        atol=1e-13,
    )
    return float(solved.y[0, -1])


@settings(max_examples=30)
@given(concentrations, rates, rates, orders, durations)
def test_steps_under_light(start: float, kappa: float, k: float, b: float, t_s: float) -> None:
    value = lit_concentration(start, kappa, k, b, t_s)
    assert value == pytest.approx(integrated(start, kappa, k, b, t_s), rel=1e-6, abs=1e-10)


@settings(max_examples=30)
@given(st.floats(1e-3, 1.0), rates, orders, durations)
def test_steps_in_the_dark(start: float, k: float, b: float, t_s: float) -> None:
    value = dark_concentration(start, k, b, t_s)
    assert value == pytest.approx(integrated(start, 0.0, k, b, t_s), rel=1e-6, abs=1e-10)


@given(concentrations, rates, rates, orders, durations, durations)
def test_two_steps_are_one(
    start: float, kappa: float, k: float, b: float, first_s: float, second_s: float
) -> None:
    between = lit_concentration(start, kappa, k, b, first_s)
    after = lit_concentration(between, kappa, k, b, second_s)
    whole = lit_concentration(start, kappa, k, b, first_s + second_s)
    assert after == pytest.approx(whole, rel=1e-8)


@given(concentrations, rates, rates, durations)
def test_the_first_order_is_the_rate_equation(
    start: float, kappa: float, k: float, t_s: float
) -> None:
    expected = concentration(start, kappa, k, t_s)
    assert lit_concentration(start, kappa, k, 1.0, t_s) == pytest.approx(expected, rel=1e-10)
    # b is no special case at 1, neither under light nor in the dark.
    near = lit_concentration(start, kappa, k, 1 + 1e-9, t_s)
    assert near == pytest.approx(expected, rel=1e-6)
    dark = dark_concentration(start, k, [1.0, 1 + 1e-12], t_s)
    assert dark[0] == pytest.approx(float(concentration(start, 0.0, k, t_s)), rel=1e-12)
    assert dark[1] == pytest.approx(dark[0], rel=1e-6)


def test_the_second_order_is_riccati_s_equation() -> None:
    kappa, k, t_s = 0.01, 0.07, np.array([1.0, 20.0, 300.0])
    # E. L. Ince, Ordinary Differential Equations, 2.15, by the roots of k r² + κ r − κ = 0.
    spread = np.sqrt(kappa**2 + 4 * kappa * k)
    tanh = np.tanh(spread * t_s / 2)
    expected = 2 * kappa * tanh / (spread + kappa * tanh)
    value = lit_concentration(0.0, kappa, k, 2.0, t_s)
    assert value == pytest.approx(expected, rel=1e-12)


@given(concentrations, rates, rates, st.floats(1.01, 3.9), durations)
def test_derivatives(start: float, kappa: float, k: float, b: float, t_s: float) -> None:
    charged = lit_step(start, kappa, k, b, t_s)
    step = 1e-4
    ends = [lit_concentration(start + by, kappa, k, b, t_s) for by in (0.0, 1e-7)]
    assert charged.by_start == pytest.approx((ends[1] - ends[0]) / 1e-7, rel=1e-3, abs=1e-6)
    analytic = (charged.by_kappa * kappa, charged.by_k_r * k, charged.by_order)
    for slope, (up, down) in zip(
        analytic,
        (
            ((kappa * (1 + step), k, b), (kappa * (1 - step), k, b)),
            ((kappa, k * (1 + step), b), (kappa, k * (1 - step), b)),
            ((kappa, k, b + step), (kappa, k, b - step)),
        ),
        strict=True,
    ):
        ends = [lit_concentration(start, *each, t_s) for each in (up, down)]
        numeric = (ends[0] - ends[1]) / (2 * step)
        assert slope == pytest.approx(numeric, rel=1e-4, abs=1e-6 * float(charged.value))


@given(rates, rates, orders)
def test_long_light_ends_in_balance(kappa: float, k: float, b: float) -> None:
    steady = steady_concentration(kappa, k, b)
    assert kappa * (1 - steady) == pytest.approx(k * steady**b, rel=1e-9)
    assert lit_concentration(0.3, kappa, k, b, 1e7) == pytest.approx(steady, rel=1e-9)


def test_next_to_no_light_changes_nothing() -> None:
    kappa = 10.0 ** -np.arange(9.0, 34.0)
    for b in (1.0, 1.5, 2.5, 4.0):
        for t_s in (0.01, 60.0, 1e6):
            dark = dark_concentration(0.999, 0.02, b, t_s)
            level = lit_concentration(0.999, kappa, 0.02, b, t_s)
            assert (level >= dark * (1 - 2e-9)).all()
            assert (level <= dark * (1 + 2e-9) + kappa * t_s).all()


@pytest.mark.parametrize("b", [1.0, 1.3, 2.0, 3.0])
def test_light_in_the_dark_is_becquerel_s_law(b: float) -> None:
    start, k, t_s, exposure_s = 0.6, 0.05, np.array([0.0, 3.0, 200.0]), np.array([2.0, 1.0, 50.0])
    law = becquerel_of(start, k, b)
    means, _ = DECAY_LAWS["becquerel"].means(*law, t_s, exposure_s)
    fall = dark_concentration(start, k, b, t_s) - dark_concentration(start, k, b, t_s + exposure_s)
    assert k * start**b * means == pytest.approx(fall / exposure_s, rel=1e-9)


@given(st.floats(1e-3, 1.0), rates, st.floats(1.01, 3.9), durations)
def test_derivatives_in_the_dark(start: float, k: float, b: float, t_s: float) -> None:
    step = 3e-6
    # Near first order the light changes over b − 1.
    of_order = step * min(b - 1, 1.0)
    for function in (dark_step, mean_emission):
        found = function(start, k, b, t_s)
        for slope, up, down, by in (
            (found.by_start * start, (start * (1 + step), k, b), (start * (1 - step), k, b), step),
            (found.by_k_r * k, (start, k * (1 + step), b), (start, k * (1 - step), b), step),
            (found.by_order, (start, k, b + of_order), (start, k, b - of_order), of_order),
        ):
            numeric = (function(*up, t_s).value - function(*down, t_s).value) / (2 * by)
            assert slope == pytest.approx(numeric, rel=1e-4, abs=1e-6 * float(found.value))


@pytest.mark.parametrize("b", [1.0, 1.5, 3.0])
def test_back_in_the_dark_and_forth_again(b: float) -> None:
    earlier = dark_step(0.6, 0.3, b, -0.4).value
    assert dark_concentration(earlier, 0.3, b, 0.4) == pytest.approx(0.6, rel=1e-13)
    short, shorter = (float(mean_emission(0.6, 0.3, b, T).value) for T in (1e-3, 1e-5))
    assert shorter == pytest.approx(0.6**b, rel=1e-5)
    assert short == pytest.approx(shorter * (1 - b * 0.3 * 0.6 ** (b - 1) * 4.95e-4), rel=1e-7)
