"""The least of a quadratic function of variables that are not negative."""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cholesky, lapack, solve_triangular

from labrig.fit.least_squares import EPSILON
from labrig.foundation.arrays import FloatArray
from labrig.foundation.nonnegative import nonnegative_least_squares

#: Number of exchanges after which block pivoting counts as cycling.
MAX_EXCHANGES = 25
#: Rounding errors of slopes, and of coordinates relative to the largest.
ROUNDING = 100 * EPSILON
SMALLEST = 1e-9


def nonnegative_minimum(
    curvature: FloatArray, linear: FloatArray, free: NDArray[np.bool_]
) -> FloatArray:
    """Minimise xᵀGx/2 − bᵀx over x ≥ 0, started from the solution of a similar problem.

    Block principal pivoting: all coordinates on the wrong side change sides at once (Júdice and
    Pires, *A block principal pivoting algorithm for large-scale strictly monotone linear
    complementarity problems*, Comput. Oper. Res. 21, 1994). Where that cycles, Lawson and Hanson's
    active sets are used.

    Parameters
    ----------
    curvature, linear
        Positive definite G (n, n) and b (n,).
    free
        Initial guess of the coordinates that are not zero, shape (n,).

    Returns
    -------
    ndarray
        Minimum x, exactly 0 where the bound is active, shape (n,).
    """
    free = free.copy()
    size = np.abs(curvature)
    for _ in range(MAX_EXCHANGES):
        x = np.zeros_like(linear)
        if free.any():
            x[free] = _solved(curvature[free][:, free], linear[free])
        slope = curvature @ x - linear
        slack = ROUNDING * (size @ np.abs(x) + np.abs(linear))
        below = x < -SMALLEST * float(np.abs(x).max(initial=0.0))
        wrong = np.where(free, below, slope < -slack)
        if not wrong.any():
            return np.maximum(x, 0.0)
        free ^= wrong
    upper = cholesky(curvature)
    return nonnegative_least_squares(upper, solve_triangular(upper, linear, trans="T"))


def _solved(curvature: FloatArray, linear: FloatArray) -> FloatArray:
    # SciPy's own Cholesky functions take ten times as long to call as such a system to solve.
    _, solution, info = lapack.dposv(curvature, linear)
    if info:
        raise LinAlgError("expected a positive definite matrix")
    return np.asarray(solution)
