"""Numbers as they are written."""

import math

import pytest

from labrig.foundation.number_format import exposure_text, plus_minus, rounded


@pytest.mark.parametrize(
    ("value", "sigma", "text"),
    [
        (0.032084, 0.000268, "0.03208 ± 0.00027"),
        (0.032084, 0.00996, "0.032 ± 0.010"),
        (7958.3, 16.2, "7958 ± 16"),
        (110983.0, 553.0, "110980 ± 550"),
        (31.2, 4.0, "31.2 ± 4.0"),
        (-0.0683, 0.0064, "−0.0683 ± 0.0064"),
        (1.234e-5, 2.1e-7, "(1.234 ± 0.021) × 10⁻⁵"),
        (2.5e7, 1e5, "(2.500 ± 0.010) × 10⁷"),
        (0.0, 0.5, "0.00 ± 0.50"),
        (2e-4, 3500.0, "2 × 10⁻⁴ ± 3500"),
        (0.08, 0.0, "0.08 (held)"),
        (0.0, 0.0, "0 (held)"),
        (31.23456, math.inf, "31.2 ± ?"),
        (1.0, math.nan, "1 ± ?"),
        (math.nan, 1.0, "–"),
    ],
)
def test_a_value_is_rounded_by_its_uncertainty(value: float, sigma: float, text: str) -> None:
    assert plus_minus(value, sigma) == text


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (0.0, 4, "0"),
        (1.9999, 3, "2"),
        (0.05012, 3, "0.0501"),
        (-12345.6, 3, "−12300"),
        (1.5e-9, 2, "1.5 × 10⁻⁹"),
        (3e8, 2, "3 × 10⁸"),
        (5e-324, 3, "4.94 × 10⁻³²⁴"),
        (9.996e-4, 3, "0.001"),
        (math.inf, 3, "–"),
    ],
)
def test_rounding(value: float, digits: int, text: str) -> None:
    assert rounded(value, digits) == text


def test_exposures_are_reported_as_photographers_do() -> None:
    assert exposure_text(1 / 64) == "1/64 s"
    assert exposure_text(0.5) == "0.5 s"
    assert exposure_text(30.0) == "30 s"
