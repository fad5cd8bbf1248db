"""Levenberg–Marquardt searches from several starts at once.

A search evaluates a few numbers per step, so that a loop over starts would take most of its time
for its bookkeeping. All searches go on together, which makes them as fast as one; the lowest end is
carried to the minimum by `labrig.fit.least_squares`.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import FloatArray

#: Steps of all searches, and the relative gain below which one has ended.
STEPS, LEAST_GAIN = 25, 1e-5
INITIAL_DAMPING, LEAST_FACTOR = 1e-3, 0.1


class Curvature(NamedTuple):
    """Sum of squares at points, its half gradient, and the Gauss–Newton matrix.

    Attributes
    ----------
    cost
        Sums of squares, shape (n,).
    gradient
        Products Jᵀ r, shape (n, p).
    matrix
        Products Jᵀ J, shape (n, p, p).
    """

    cost: FloatArray
    gradient: FloatArray
    matrix: FloatArray


def descend(
    curvature: Callable[[FloatArray], Curvature],
    starts: FloatArray,
    low: FloatArray,
    high: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return where searches from starts (n, p) within bounds (p,) end, and their sums of squares.

    The damping is Nielsen's, the scaling Moré's, as in `labrig.fit`.
    """
    x = np.clip(starts, low, high)
    at = curvature(x)
    damping = np.full(len(x), INITIAL_DAMPING)
    growth = np.full(len(x), 2.0)
    scales = np.zeros_like(x)
    for _ in range(STEPS):
        diagonal = np.diagonal(at.matrix, axis1=1, axis2=2)
        scales = np.maximum(scales, diagonal)
        # A rate at its bound, and pushed against it, stays there.
        is_held = ((x <= low) & (at.gradient > 0)) | ((x >= high) & (at.gradient < 0))
        step = _step(at, scales, damping, is_held)
        trial = np.clip(x + step, low, high)
        there = curvature(trial)
        moved = trial - x
        expected = -2 * (moved * at.gradient).sum(axis=1)
        expected -= np.einsum("ni,nij,nj->n", moved, at.matrix, moved)
        gain = at.cost - there.cost
        ratio = gain / np.maximum(expected, 1e-300)
        is_better = (gain > 0) & np.isfinite(there.cost)
        factor = np.maximum(LEAST_FACTOR, 1 - (2 * np.clip(ratio, 0.0, 1.0) - 1) ** 3)
        damping = np.where(is_better, damping * factor, damping * growth)
        growth = np.where(is_better, 2.0, growth * 2)
        has_ended = gain <= LEAST_GAIN * at.cost
        if (is_better & has_ended).sum() == len(x):
            x, at = trial, there
            break
        x = np.where(is_better[:, np.newaxis], trial, x)
        at = Curvature(
            *(
                np.where(is_better.reshape(-1, *[1] * (new.ndim - 1)), new, old)
                for new, old in zip(there, at, strict=True)
            )
        )
    return x, at.cost


def _step(
    at: Curvature, scales: FloatArray, damping: FloatArray, is_held: NDArray[np.bool_]
) -> FloatArray:
    """Return the damped steps (n, p)."""
    is_free = (~is_held).astype(np.float64)
    size = scales.shape[1]
    matrix = at.matrix * (is_free[:, :, np.newaxis] * is_free[:, np.newaxis, :])
    diagonal = np.arange(size)
    least = 1e-12 * scales.max(axis=1, keepdims=True, initial=1e-300)
    matrix[:, diagonal, diagonal] += damping[:, np.newaxis] * np.maximum(scales, least) + (
        least + is_held * scales
    )
    gradient = (at.gradient * is_free)[..., np.newaxis]
    return np.asarray(-np.linalg.solve(matrix, gradient)[..., 0])
