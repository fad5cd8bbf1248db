"""Depths of traps from rates at several temperatures."""

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from labrig.fit import fit_trap_depth
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from labrig.results import TrapDepth
from tests.pulls import assert_sigma_is_right
from tests.warned import codes

CELSIUS = np.array([5.0, 14.0, 22.0, 31.0, 40.0])


def emptied(celsius: FloatArray, depth_ev: float, log10_frequency: float) -> FloatArray:
    """Rates of traps of one depth, with k_B as charge and gas constants give it."""
    kt_ev = 8.314462618 / 6.02214076e23 / 1.602176634e-19 * (celsius + 273.15)
    return np.asarray(10**log10_frequency * np.exp(-depth_ev / kt_ev))


def measured(seed: int, rate_sigma: float, kelvin_sigma: float) -> TrapDepth:
    """Rates with errors of their own, and temperatures that were read wrong."""
    random = np.random.default_rng(seed)
    true_c = CELSIUS - kelvin_sigma * random.standard_normal(CELSIUS.size)
    rate = emptied(true_c, 0.72, 11.0)
    sigma = rate_sigma * rate
    rate = rate + sigma * random.standard_normal(CELSIUS.size)
    return fit_trap_depth(CELSIUS, rate, sigma, temperature_sigma_k=kelvin_sigma)


@pytest.mark.parametrize(("rate_sigma", "kelvin_sigma"), [(0.03, 0.0), (0.003, 0.4), (0.02, 0.3)])
def test_errors_are_as_large_as_their_sigma(rate_sigma: float, kelvin_sigma: float) -> None:
    found = [measured(seed, rate_sigma, kelvin_sigma) for seed in range(300)]
    assert_sigma_is_right([(each.depth_ev.value - 0.72) / each.depth_ev.sigma for each in found])
    assert_sigma_is_right(
        [(each.log10_frequency.value - 11) / each.log10_frequency.sigma for each in found]
    )
    for celsius in (-10.0, 25.0):
        true = float(emptied(np.array([celsius]), 0.72, 11.0)[0])
        rates = [each.rate_at(celsius) for each in found]
        assert_sigma_is_right([(rate.value - true) / rate.sigma for rate in rates])
    assert sum(bool(each.warnings) for each in found) <= 9  # 1 % by chance


@given(
    st.floats(0.3, 1.3),
    st.floats(7.0, 15.0),
    st.lists(st.floats(-40, 120), min_size=2, max_size=8, unique_by=lambda t: round(t / 4)),
)
def test_rates_without_errors_give_the_depth(
    depth_ev: float, log10_frequency: float, celsius: list[float]
) -> None:
    rate = emptied(np.array(celsius), depth_ev, log10_frequency)
    if max(celsius) - min(celsius) < 2:
        return
    found = fit_trap_depth(celsius, rate, 0.001 * rate)
    assert found.depth_ev.value == pytest.approx(depth_ev, rel=1e-6)
    assert found.log10_frequency.value == pytest.approx(log10_frequency, rel=1e-6)
    assert found.rate_at(celsius[0]).value == pytest.approx(rate[0], rel=1e-6)
    assert found.dof == len(celsius) - 2
    assert math.isnan(found.p_value) == (found.dof == 0)


def test_two_traps_that_look_like_one_are_told() -> None:
    celsius = np.linspace(-20, 60, 9)
    rate = emptied(celsius, 0.3, 4.0) + emptied(celsius, 0.9, 14.0)
    (warning,) = fit_trap_depth(celsius, rate, 0.02 * rate).warnings[:1]
    assert warning.code == "depth-misfit"
    assert warning.values["p_value"] < 0.01


@pytest.mark.parametrize(
    ("celsius", "factor", "code"),
    [
        ([15, 21, 27], [1.0, 1.001, 0.999], "rates-not-thermal"),
        ([15, 21, 27], [1.0, 1.25, 1.55], "frequency-unphysical"),
    ],
)
def test_rates_of_no_thermal_release_have_a_warning(
    celsius: list[float], factor: list[float], code: str
) -> None:
    rate = 0.03 * np.array(factor)
    assert codes(fit_trap_depth(celsius, rate, 0.01 * rate).warnings) == [code]


@pytest.mark.parametrize(
    ("celsius", "rate", "sigma", "told"),
    [
        ([20.0], [0.1], [0.01], "at two temperatures"),
        ([20.0, 21.0], [0.1, 0.11], [0.01, 0.01], "differ by 2 K"),
        ([20.0, 30.0], [0.1, -0.1], [0.01, 0.01], "above 0, got -0.1"),
        ([20.0, 30.0], [0.1, 0.2], [0.01, 0.0], "above 0, got 0.2 ± 0"),
        ([20.0, np.nan], [0.1, 0.2], [0.01, 0.01], "above −273.15"),
        ([20.0, -300.0], [0.1, 0.2], [0.01, 0.01], "above −273.15"),
        ([20.0, 30.0, 40.0], [0.1, 0.2], [0.01, 0.01], "got 3 of a temperature, 2 of a rate"),
    ],
)
def test_what_tells_no_depth_is_refused(
    celsius: list[float], rate: list[float], sigma: list[float], told: str
) -> None:
    with pytest.raises(FitError, match=told):
        fit_trap_depth(celsius, rate, sigma)
