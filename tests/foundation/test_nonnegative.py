"""Non-negative least squares meets the conditions of its minimum, whatever the matrix."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from labrig.foundation.arrays import FloatArray
from labrig.foundation.nonnegative import nonnegative_least_squares


@pytest.fixture(params=["SciPy as it is", "SciPy stops short", "SciPy gives up"], autouse=True)
def scipy_fails(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same minimum, whatever SciPy finds."""

    def short(columns: FloatArray, _: FloatArray) -> tuple[FloatArray, float]:
        return np.zeros(columns.shape[1]), 0.0

    def gives_up(*_: FloatArray) -> None:
        raise RuntimeError("Maximum number of iterations reached.")

    if request.param == "SciPy stops short":
        monkeypatch.setattr("scipy.optimize.nnls", short)
    elif request.param == "SciPy gives up":
        monkeypatch.setattr("scipy.optimize.nnls", gives_up)


def _assert_minimum(design: FloatArray, target: FloatArray) -> None:
    """Kuhn and Tucker: no gain along any column, no slope along a used one."""
    x = nonnegative_least_squares(design, target)
    assert x.shape == (design.shape[1],)
    assert np.all(x >= 0)
    norms = np.linalg.norm(design, axis=0)
    slope = design.T @ (target - design @ x) / np.where(norms > 0, norms, 1)
    tolerance = 1e-10 * max(float(np.linalg.norm(target)), 1e-300)
    assert slope.max(initial=0) <= tolerance
    assert np.abs(slope[x > 0]).max(initial=0) <= tolerance


@settings(
    deadline=None,
    max_examples=30,
    # the same fixture is right for every example
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(seed=st.integers(0, 10**6), rows=st.integers(1, 40), columns=st.integers(1, 40))
def test_random_matrices(seed: int, rows: int, columns: int) -> None:
    rng = np.random.default_rng(seed)
    scales = 10 ** rng.uniform(-8, 8, columns)
    _assert_minimum(rng.normal(size=(rows, columns)) * scales, rng.normal(size=rows))


@pytest.mark.parametrize("width", [10.0, 0.5, 1e-3])
def test_exponentials_of_nearly_equal_rates(width: float) -> None:
    t = np.linspace(0, 180, 37)
    rates = np.exp(np.linspace(-4 - width / 2, -4 + width / 2, 48))
    noise = 1e-3 * np.random.default_rng(0).normal(size=37)
    _assert_minimum(np.exp(-np.multiply.outer(t, rates)), np.exp(-0.02 * t) + noise)


def test_where_other_implementations_fail() -> None:
    # scipy issues 24861 (aborts the process) and 25389 (stops at the wrong corner).
    assert nonnegative_least_squares(np.zeros((3, 0)), np.ones(3)).shape == (0,)
    assert nonnegative_least_squares(np.zeros((0, 2)), np.zeros(0)).tolist() == [0, 0]
    assert nonnegative_least_squares(np.zeros((3, 2)), np.ones(3)).tolist() == [0, 0]
    assert nonnegative_least_squares(-np.eye(3), np.ones(3)).tolist() == [0, 0, 0]
