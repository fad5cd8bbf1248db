"""Numbers with their uncertainties, as they are written."""

import pytest

from labrig.results import with_uncertainty


@pytest.mark.parametrize(
    ("value", "sigma", "text"),
    [
        (0.08021, 0.00131, "0.0802(13)"),
        (12.53, 1.31, "12.5(1.3)"),
        (10851.3, 172.0, "10850(170)"),
        (0.5, 0.0, "0.5"),
        (0.5, float("inf"), "0.5(?)"),
        (0.0802, 0.000996, "0.0802(10)"),
        (2.5e-10, 3.1e-12, "2.500(31)e-10"),
    ],
)
def test_value_with_uncertainty(value: float, sigma: float, text: str) -> None:
    assert with_uncertainty(value, sigma) == text
