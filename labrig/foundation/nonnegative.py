"""Linear least squares with coefficients ≥ 0.

SciPy's `nnls` is fast, but aborts the process on an empty matrix and may stop short of the minimum
(scipy issues 24861 and 25389), which a measurement cannot afford: its solution is used only if it
satisfies the Kuhn–Tucker conditions, else the minimum is found here.

References
----------
C. L. Lawson, R. J. Hanson, *Solving least squares problems* (1974), chapter 23.
"""

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import FloatArray


def nonnegative_least_squares(design: FloatArray, target: FloatArray) -> FloatArray:
    """Minimise ‖A x − b‖ over x ≥ 0.

    Parameters
    ----------
    design
        Matrix A of any rank and scale of columns, shape (m, n).
    target
        Right-hand side b, shape (m,).

    Returns
    -------
    ndarray
        Minimum x, exactly 0 where the bound is active, shape (n,).
    """
    norms = np.sqrt(np.einsum("ij,ij->j", design, design))
    lengths = np.where(norms > 0, norms, 1.0)
    columns = design / lengths
    # Dot products of m terms carry this much rounding.
    rounding = max(len(target), 1) * float(np.finfo(np.float64).eps)
    least_gain = 10 * rounding * float(np.linalg.norm(target))
    solution = _by_scipy(columns, target, least_gain)
    if solution is None:
        solution = _by_active_sets(columns, target, least_gain)
    return solution / lengths


def _by_scipy(columns: FloatArray, target: FloatArray, least_gain: float) -> FloatArray | None:
    """Return SciPy's solution if it is the minimum, else None."""
    # Not above: it takes as long to load as a plan takes to be printed.
    from scipy.optimize import nnls

    if not columns.size:
        return None
    try:
        solution: FloatArray = nnls(columns, target)[0]
    except RuntimeError:  # too many steps
        return None
    gain = columns.T @ (target - columns @ solution)
    is_minimum = (
        gain.max() <= least_gain and np.abs(gain[solution > 0]).max(initial=0) <= least_gain
    )
    return solution if is_minimum else None


def _by_active_sets(columns: FloatArray, target: FloatArray, least_gain: float) -> FloatArray:
    """Run Lawson and Hanson's algorithm for columns of length 1 (or 0), each set solved anew."""
    n = columns.shape[1]
    solution, used = np.zeros(n), np.zeros(n, dtype=np.bool_)
    empty = np.asarray(~columns.any(axis=0), dtype=np.bool_)
    # A column that gains nothing but rounding is not asked again until another one has.
    refused = empty
    residual = target
    for _ in range(3 * n):
        gain = np.where(used | refused, -np.inf, columns.T @ residual)
        new = int(np.argmax(gain))
        if gain[new] <= least_gain:
            break
        used[new] = True
        trial = _solve(columns, target, used)
        if trial[new] <= 0:
            used[new] = False
            refused = refused.copy()
            refused[new] = True
            continue
        while (falling := np.flatnonzero(used & (trial <= 0))).size:
            # Go towards the trial until the first coefficient reaches zero; do without that one.
            fractions = solution[falling] / (solution[falling] - trial[falling])
            solution = solution + fractions.min() * (trial - solution)
            used[falling[np.argmin(fractions)]] = False
            used &= solution > 0
            solution[~used] = 0.0
            trial = _solve(columns, target, used)
        solution, refused = trial, empty
        residual = target - columns @ solution
    return solution


def _solve(columns: FloatArray, target: FloatArray, used: NDArray[np.bool_]) -> FloatArray:
    solution = np.zeros(columns.shape[1])
    solution[used] = np.linalg.lstsq(columns[:, used], target)[0]
    return solution
