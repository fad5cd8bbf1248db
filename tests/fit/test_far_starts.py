"""Fits from starts that are far off, or where the data do not determine the parameters."""

import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st

from labrig.fit import Ending, least_squares
from labrig.foundation.arrays import FloatArray
from tests.fit.against_trf import WORSE, compared, is_at_minimum
from tests.fit.fit_problems import FAMILIES, PLACES, Problem, classical, generated

#: With these no data determine all parameters.
UNDETERMINED = ("product", "duplicate column", "no effect", "fewer values than parameters")


# The same examples every time: from one start in some hundreds, either method misses a minimum.
@settings(max_examples=15, derandomize=True)
@given(kind=st.sampled_from(list(FAMILIES)), seed=st.integers(0, 10**6))
def test_never_worse_than_trf_from_the_same_start(kind: str, seed: int) -> None:
    result = compared(generated(kind, seed, farthest=3.0))
    assume(result is not None)
    assert result is not None
    assert result.ratio <= WORSE
    assert not result.fit.converged or is_at_minimum(result)
    assert kind not in UNDETERMINED or result.fit.at_bound.any() or not result.fit.converged


@pytest.mark.parametrize("problem", list(classical((1.0,))), ids=lambda problem: problem.name)
def test_classical_problems(problem: Problem) -> None:
    result = compared(problem)
    assert result is not None
    assert result.ratio <= WORSE
    assert not result.fit.converged or is_at_minimum(result)


def test_a_product_is_determined_and_its_factors_are_not() -> None:
    def residuals(x: FloatArray) -> tuple[FloatArray, FloatArray]:
        decayed = np.exp(-x[2] * PLACES)
        model = x[0] * x[1] * decayed
        jacobian = np.column_stack([x[1] * decayed, x[0] * decayed, -PLACES * model])
        return model - 6.0 * np.exp(-0.7 * PLACES), jacobian

    fit = least_squares(residuals, [1.0, 1.0, 0.1])
    assert fit.parameters[0] * fit.parameters[1] == pytest.approx(6.0, rel=1e-9)
    assert (fit.ending, fit.rank) == (Ending.RANK_DEFICIENT, 2)
    assert np.isinf(fit.sigma).tolist() == [True, True, False]
    # At 0 nothing shows a way out: this is said, not taken for a minimum.
    saddle = least_squares(residuals, [0.0, 0.0, 0.1])
    assert not saddle.converged


def test_a_column_of_zeros_at_the_start() -> None:
    """Without an amplitude the rate has no effect; a small scale must not be taken for 1."""

    def residuals(x: FloatArray) -> tuple[FloatArray, FloatArray]:
        decayed = np.exp(-x[1] * PLACES)
        jacobian = np.column_stack([decayed, -x[0] * PLACES * decayed])
        return x[0] * decayed - 1e-9 * np.exp(-0.7 * PLACES), jacobian

    fit = least_squares(residuals, [0.0, 5.0])
    assert fit.converged
    assert fit.parameters == pytest.approx([1e-9, 0.7], rel=1e-9)


def test_a_plateau_is_no_minimum() -> None:
    """Where every residual has underflowed there is no slope, and no end of steps without one."""

    def residuals(x: FloatArray) -> tuple[FloatArray, FloatArray]:
        decayed = np.exp(-x[0] * PLACES)
        return decayed - np.exp(-0.7 * PLACES), (-PLACES * decayed)[:, np.newaxis]

    fit = least_squares(residuals, [1e6])
    assert fit.ending is Ending.RANK_DEFICIENT
    assert fit.iterations < 100


def test_a_parameter_that_a_bound_holds_needs_no_slope() -> None:
    """The rest is determined, although two columns are the same."""

    def residuals(x: FloatArray) -> tuple[FloatArray, FloatArray]:
        return (x[0] + x[1]) * PLACES + PLACES, np.column_stack([PLACES, PLACES])

    fit = least_squares(residuals, [3.0, 2.0], lower=[-np.inf, 4.0], upper=[-4.5, np.inf])
    assert fit.converged
    assert fit.at_bound.tolist() == [False, True]
    assert fit.parameters.tolist() == pytest.approx([-5.0, 4.0])
