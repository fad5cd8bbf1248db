"""Quadratic functions at their least over x ≥ 0, many in a row.

Block principal pivoting: all coordinates on the wrong side change sides at once (Júdice and Pires,
*A block principal pivoting algorithm for large-scale strictly monotone linear complementarity
problems*, Comput. Oper. Res. 21, 1994). Started from the answer to a neighbouring problem it takes
a few small systems of equations; where it goes round in circles, Lawson and Hanson's active sets
find the way.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cholesky, lapack, solve_triangular

from labrig.fit.least_squares import EPSILON, FloatArray
from labrig.nonnegative import nonnegative_least_squares

#: Exchanges after which it goes round in circles.
MOST_EXCHANGES = 25
#: Slopes, and coordinates relative to the largest, this far on the wrong side are rounding.
ROUNDING = 100 * EPSILON
SMALLEST = 1e-9


def nonnegative_minimum(
    curvature: FloatArray, linear: FloatArray, free: NDArray[np.bool_]
) -> FloatArray:
    """Minimise xᵀGx/2 − bᵀx over x ≥ 0.

    Parameters
    ----------
    curvature, linear
        (n, n) G, positive definite, and (n,) b.
    free
        (n,) guess which coordinates are not zero.

    Returns
    -------
    (n,) x, exactly 0 where the bound holds it.
    """
    free = free.copy()
    size = np.abs(curvature)
    for _ in range(MOST_EXCHANGES):
        x = np.zeros_like(linear)
        if free.any():
            x[free] = _solved(curvature[np.ix_(free, free)], linear[free])
        slope = curvature @ x - linear
        slack = ROUNDING * (size @ np.abs(x) + np.abs(linear))
        below = x < -SMALLEST * float(np.abs(x).max(initial=0.0))
        wrong = np.flatnonzero(np.where(free, below, slope < -slack))
        if not wrong.size:
            return np.maximum(x, 0.0)
        free[wrong] = ~free[wrong]
    upper = cholesky(curvature)
    return nonnegative_least_squares(upper, solve_triangular(upper, linear, trans="T"))


def _solved(curvature: FloatArray, linear: FloatArray) -> FloatArray:
    # SciPy's own Cholesky functions take ten times as long to call as such a system to solve.
    _, solution, info = lapack.dposv(curvature, linear)
    if info:
        raise LinAlgError("expected a positive definite matrix")
    return np.asarray(solution)
