"""Slopes with both axes logarithmic."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from labrig.fit import PowerLaw, fit_power_law
from labrig.foundation.errors import FitError
from labrig.results import Measured
from tests.pulls import assert_sigma_is_right

DOSES = [20.0, 60.0, 60.0, 300.0, 1200.0]


def measured(seed: int, saturates: bool = False) -> PowerLaw:
    random = np.random.default_rng(seed)
    dose = np.array(DOSES)
    true = -np.expm1(-dose / 200) if saturates else 3 * dose**0.8
    value = true * (1 + 0.02 * random.standard_normal(len(dose)))
    return fit_power_law(dose, [Measured(float(each), float(0.02 * each)) for each in value])


def test_errors_are_as_large_as_their_sigma() -> None:
    found = [measured(seed) for seed in range(300)]
    assert_sigma_is_right([(law.exponent.value - 0.8) / law.exponent.sigma for law in found])
    assert 0.002 <= np.mean([law.p_value < 0.05 for law in found]) < 0.1


def test_a_sample_that_saturates_has_no_single_slope() -> None:
    assert max(measured(seed, saturates=True).p_value for seed in range(20)) < 1e-6


@given(st.floats(-3, 3), st.floats(1e-6, 1e6), st.floats(1e-6, 1e6))
def test_units_do_not_matter(exponent: float, x_unit: float, y_unit: float) -> None:
    x = np.array([1.0, 3.0, 11.0, 40.0])
    values = [Measured(float(y), float(0.01 * y)) for y in y_unit * x**exponent]
    law = fit_power_law(x_unit * x, values)
    assert law.exponent.value == pytest.approx(exponent, abs=1e-9)
    assert law.exponent.sigma == pytest.approx(fit_power_law(x, values).exponent.sigma)


def test_an_error_common_to_all_values_has_no_part_in_the_slope() -> None:
    x, own = np.array([1.0, 3.0, 11.0, 40.0]), np.array([0.01, 0.02, 0.05, 0.01])
    y = x**0.7 * np.array([1.01, 0.98, 1.03, 1.0])
    alone = fit_power_law(x, [Measured(*each) for each in zip(y, own * y, strict=True)])
    both = y * np.hypot(own, 0.1)
    scaled = [Measured(*each) for each in zip(1.1 * y, 1.1 * both, strict=True)]
    found = fit_power_law(x, scaled, common_sigma=0.1)
    assert found.exponent.value == pytest.approx(alone.exponent.value)
    assert found.exponent.sigma == pytest.approx(alone.exponent.sigma)
    assert found.p_value == pytest.approx(alone.p_value)


@pytest.mark.parametrize(
    ("x", "values"),
    [
        ([1.0, 1.0, 2.0], [(1, 0.1)] * 3),
        ([1.0, 2.0, 3.0], [(1, 0.1)] * 2),
        ([0.0, 2.0, 3.0], [(1, 0.1)] * 3),
        ([1.0, 2.0, 3.0], [(1, 0.1), (-1, 0.1), (1, 0.1)]),
        ([1.0, 2.0, 3.0], [(1, 0.1), (1, 0.0), (1, 0.1)]),
        ([1.0, 2.0, 3.0], [(1, 0.1), (1, np.inf), (1, 0.1)]),
    ],
)
def test_what_tells_no_slope_is_refused(x: list[float], values: list[tuple[float, float]]) -> None:
    with pytest.raises(FitError, match="expected"):
        fit_power_law(x, [Measured(*each) for each in values])
