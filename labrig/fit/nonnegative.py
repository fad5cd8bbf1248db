"""Linear least squares with coefficients ≥ 0.

SciPy's own `nnls` aborts the process on an empty matrix and may stop short of the minimum (scipy
issues 24861 and 25389), which a measurement cannot afford.

References
----------
C. L. Lawson, R. J. Hanson, *Solving least squares problems* (1974), chapter 23.
"""

import numpy as np
from numpy.typing import NDArray

from labrig.fit.least_squares import EPSILON, FloatArray


def nonnegative_least_squares(design: FloatArray, target: FloatArray) -> FloatArray:
    """Minimise ‖A x − b‖ over x ≥ 0, by Lawson and Hanson's active sets.

    Parameters
    ----------
    design
        (m, n) A; any shape, rank and scale of columns.
    target
        (m,) b.

    Returns
    -------
    (n,) x, exactly 0 where the bound holds it.
    """
    norms = np.sqrt(np.einsum("ij,ij->j", design, design))
    columns = design / np.where(norms > 0, norms, 1.0)
    n = columns.shape[1]
    solution, used = np.zeros(n), np.zeros(n, dtype=np.bool_)
    # A column that gains nothing but rounding is not asked again until another one has.
    refused = norms == 0
    # Dot products of m terms carry this much rounding.
    least_gain = 10 * max(len(target), 1) * EPSILON * float(np.linalg.norm(target))
    residual = target
    for _ in range(3 * n):
        gain = np.where(used | refused, -np.inf, columns.T @ residual)
        new = int(np.argmax(gain)) if n else 0
        if n == 0 or gain[new] <= least_gain:
            break
        used[new] = True
        trial = _solve(columns, target, used)
        if trial[new] <= 0:
            used[new], refused[new] = False, True
            continue
        while (falling := np.flatnonzero(used & (trial <= 0))).size:
            # Go towards the trial until the first coefficient reaches zero; do without that one.
            shares = solution[falling] / (solution[falling] - trial[falling])
            solution = solution + shares.min() * (trial - solution)
            used[falling[np.argmin(shares)]] = False
            used &= solution > 0
            solution[~used] = 0.0
            trial = _solve(columns, target, used)
        solution, refused = trial, norms == 0
        residual = target - columns @ solution
    return solution / np.where(norms > 0, norms, 1.0)


def _solve(columns: FloatArray, target: FloatArray, used: NDArray[np.bool_]) -> FloatArray:
    solution = np.zeros(columns.shape[1])
    solution[used] = np.linalg.lstsq(columns[:, used], target)[0]
    return solution
