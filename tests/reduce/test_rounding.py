"""Rounding to whole numbers, against numbers that are rounded."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.special import ndtri

from labrig.reduce import (
    rounded_variance,
    rounding_slope,
    shared_rounding_variance,
    unrounded_variance,
)


@pytest.mark.parametrize("s", [0.02, 0.1, 0.2, 0.3, 0.5, 0.8])
def test_variances_are_those_of_rounded_numbers(s: float) -> None:
    """At each of many levels within a step: pixels' own scatter, and the shift of their mean."""
    levels = (np.arange(400) + 0.5) / 400
    normal = ndtri((np.arange(20_000) + 0.5) / 20_000)
    rounded = np.round(levels[:, np.newaxis] + s * normal)
    own = rounded.var(axis=1).mean()
    shift = rounded.mean(axis=1) - levels
    variance = np.array([s**2])
    assert rounded_variance(variance)[0] == pytest.approx(own, rel=0.01)
    assert shared_rounding_variance(variance)[0] == pytest.approx(
        np.mean(shift**2), rel=0.01, abs=1e-7
    )


@given(st.floats(1e-3, 5.0))
def test_the_inverse_and_the_slope_are_of_the_same_function(s: float) -> None:
    v = np.array([s**2])
    assert unrounded_variance(rounded_variance(v))[0] == pytest.approx(v[0], rel=2e-3, abs=1e-6)
    step = 1e-3 * v
    slope = (rounded_variance(v + step) - rounded_variance(v - step)) / (2 * step)
    assert rounding_slope(v)[0] == pytest.approx(slope[0], rel=1e-2)
