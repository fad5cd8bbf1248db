"""Numbers with their uncertainties, as they are written."""

import math

import pytest

from labrig.results import OneSided, with_uncertainty


@pytest.mark.parametrize(
    ("value", "sigma", "text"),
    [
        (0.08021, 0.00131, "0.0802(13)"),
        (12.53, 1.31, "12.5(1.3)"),
        (10851.3, 172.0, "10850(170)"),
        (0.5, 0.0, "0.5"),
        (0.5, float("inf"), "0.5(?)"),
        (0.0802, 0.000996, "0.0802(10)"),
        (2.5e-10, 3.1e-12, "2.500(31) × 10⁻¹⁰"),
        (6.23e7, 1e5, "6.230(10) × 10⁷"),
        (-3.2, 0.5, "−3.20(50)"),
        (1200.0, 3500.0, "1200(3500)"),
        (2e-4, 3500.0, "2 × 10⁻⁴ ± 3500"),
    ],
)
def test_value_with_uncertainty(value: float, sigma: float, text: str) -> None:
    assert with_uncertainty(value, sigma) == text


@pytest.mark.parametrize("is_upper", [False, True])
def test_a_value_at_its_bound_has_a_limit_where_chi2_is_higher_by_that_of_95_percent(
    is_upper: bool,
) -> None:
    sign = -1 if is_upper else 1
    held = OneSided.held(1.0, 0.1, 0.0, is_upper=is_upper)
    assert held.limit == pytest.approx(1 + sign * 0.1645, abs=1e-4)
    assert held.sigma == pytest.approx(0.1)
    # χ² = ((x − x̂)/σ)² with its minimum x̂ a pull of 2 beyond the bound.
    pulled = OneSided.held(1.0, 0.1, 2.0, is_upper=is_upper)
    distance = abs(pulled.limit - 1)
    assert (distance / 0.1 + 2) ** 2 - 2**2 == pytest.approx(1.6449**2, rel=1e-3)
    assert pulled.sigma < held.sigma
    assert math.isinf(OneSided.held(1.0, math.inf, 0.0, is_upper=is_upper).sigma)
