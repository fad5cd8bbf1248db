"""The rate equation's exact steps against an integrator that does not know them."""

from decimal import Decimal, getcontext

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.integrate import solve_ivp

from labrig.material.rates import (
    concentration,
    concentration_integral,
    equilibrium,
    phi1,
    phi2,
    relaxation,
    relaxation_with_slopes,
)

rates = st.one_of(st.just(0.0), st.floats(1e-12, 50.0))
durations = st.floats(0.0, 1e4)
concentrations = st.floats(0.0, 1.0)


@pytest.mark.parametrize(
    ("kappa", "k_r", "tau"),
    [
        (0.05, 0.03, 40.0),
        (2.0, 0.5, 10.0),
        (1e-9, 0.02, 600.0),
        (0.3, 0.0, 5.0),
        (1e-8, 1e-8, 5400.0),
        (0.0, 1e-12, 1e3),
        (0.1, 0.1, 2.4999),
        (0.1, 0.1, 2.5001),
    ],
)
def test_steps_against_dop853(kappa: float, k_r: float, tau: float) -> None:
    for start in (0.0, 0.2, 1.0):
        solved = solve_ivp(
            lambda _, y: [(1 - y[0]) * kappa - k_r * y[0], y[0]],
            (0.0, tau),
            [start, 0.0],
            method="DOP853",
            rtol=1e-13,
            atol=1e-15,
        ).y[:, -1]
        assert concentration(start, kappa, k_r, tau) == pytest.approx(solved[0], rel=1e-10)
        assert concentration_integral(start, kappa, k_r, tau) == pytest.approx(
            solved[1], rel=1e-10, abs=1e-13
        )


@given(rates, rates, durations, durations, concentrations)
def test_two_steps_are_one(
    kappa: float, k_r: float, first_s: float, second_s: float, start: float
) -> None:
    between = concentration(start, kappa, k_r, first_s)
    together = concentration_integral(start, kappa, k_r, first_s + second_s)
    assert 0 <= between <= 1 + 1e-15
    assert concentration(between, kappa, k_r, second_s) == pytest.approx(
        concentration(start, kappa, k_r, first_s + second_s), rel=1e-11, abs=1e-15
    )
    assert concentration_integral(start, kappa, k_r, first_s) + concentration_integral(
        between, kappa, k_r, second_s
    ) == pytest.approx(together, rel=1e-11, abs=1e-14)


@given(st.one_of(st.just(0.0), st.floats(1e-300, 1e4)))
def test_all_digits_of_phi(x: float) -> None:
    getcontext().prec = 60
    exact = Decimal(x)
    first = (1 - (-exact).exp()) / exact if x > 1e-18 else 1 - exact / 2
    second = (1 - first) / exact if x > 1e-18 else Decimal(1) / 2 - exact / 6
    assert float(phi1(x)) == pytest.approx(float(first), rel=1e-15)
    assert float(phi2(x)) == pytest.approx(float(second), rel=4e-15)


@given(rates, rates, st.floats(0.0, 1e3))
def test_slopes_are_those_of_the_steps(kappa: float, k_r: float, tau: float) -> None:
    step, found = relaxation_with_slopes(kappa, k_r, tau)
    assert step == pytest.approx(relaxation(kappa, k_r, tau), rel=1e-15, abs=1e-300)
    h = 1e-5 * max(kappa + k_r, 1e-3)
    # to both sides, also where the rate is 0 and the formula goes on smoothly
    up, down = relaxation(kappa + h, k_r, tau), relaxation(kappa - h, k_r, tau)

    def near(difference: object) -> object:
        return pytest.approx(difference, rel=1e-4, abs=1e-6 * (1 + tau))

    if kappa >= h:
        assert found.kept == near((up.kept - down.kept) / (2 * h))
        assert found.gained_by_kappa == near((up.gained - down.gained) / (2 * h))
    if k_r >= h:
        up, down = relaxation(kappa, k_r + h, tau), relaxation(kappa, k_r - h, tau)
        assert found.gained_by_k_r == near((up.gained - down.gained) / (2 * h))


def test_equilibrium_is_where_it_ends() -> None:
    kappa, k_r = np.array([0.0, 0.01, 3.0]), 0.02
    assert equilibrium(kappa, k_r) == pytest.approx(concentration(0.7, kappa, k_r, 1e5), abs=1e-15)
    assert equilibrium(0.0, 0.0) == 0
