"""Integration of traps with any law, by collocation at Radau's nodes and Newton's iteration.

The Radau IIA method (E. Hairer and G. Wanner, Solving Ordinary Differential Equations II, IV.5) of
order 13: it ends at its last node and damps what decays quickly, such as shallow traps.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre

from labrig.foundation.arrays import FloatArray

from .kinetics import Law

#: Nodes of a step; the error of a step falls with the power 2 × this of its length.
STAGES = 7
#: A step may differ by so much from its two halves, which are kept.
RTOL, ATOL = 1e-7, 1e-10
#: The next step is not shorter than the last by more than this factor, nor longer.
SHORTER, LONGER = 0.1, 10.0
#: Iterations after which a step is too long.
ITERATIONS = 12
#: Least error, to avoid division by zero.
TINY = 1e-30


def _collocation() -> tuple[FloatArray, FloatArray]:
    """Return the nodes in (0, 1], and the integrals up to them of a function known there."""
    highest = np.zeros(STAGES + 1)
    highest[[STAGES - 1, STAGES]] = -1.0, 1.0
    nodes = np.sort(legendre.legroots(highest).real)
    nodes[-1] = 1.0
    coefficients = np.linalg.inv(legendre.legvander(nodes, STAGES - 1))
    below = legendre.legval(nodes, legendre.legint(coefficients, lbnd=-1)).T
    return (nodes + 1) / 2, np.asarray(below, dtype=np.float64) / 2


NODES, INTEGRALS = _collocation()
WEIGHTS: FloatArray = INTEGRALS[-1]
#: From values at the nodes, less that at the start, to their derivatives.
DERIVATIVES: FloatArray = np.asarray(np.linalg.inv(INTEGRALS), dtype=np.float64)


class Drive(NamedTuple):
    """Influences on traps at some times.

    Attributes
    ----------
    generation, escape : ndarray, shape (times, traps)
        Rates f at which carriers are generated, and p at which a filled trap is emptied, in 1/s.
    visible : ndarray, shape (times,)
        Fraction of the sample that is seen.
    """

    generation: FloatArray
    escape: FloatArray
    visible: FloatArray


def integrate(
    law: Law,
    state: FloatArray,
    begin_s: float,
    stop_s: float,
    drive: Callable[[FloatArray], Drive],
) -> FloatArray:
    """Integrate traps over an interval in which what acts on them is smooth.

    Parameters
    ----------
    law
        Law of all these traps.
    state : ndarray, shape (2, traps)
        Filled fractions n at the start, and ∫ visible emission dt up to there.
    begin_s, stop_s
        The interval.
    drive
        Function of times, shape (times,).

    Returns
    -------
    ndarray, shape (2, traps)
        `state` at the end.
    """
    start_s, step_s = begin_s, stop_s - begin_s
    while math.nextafter(start_s, stop_s) < stop_s:
        end_s = min(start_s + step_s, stop_s)
        middle_s = (start_s + end_s) / 2
        if not start_s < middle_s < end_s:
            raise ArithmeticError(f"the traps cannot be integrated at {start_s} s")
        spans = ((start_s, end_s), (start_s, middle_s), (middle_s, end_s))
        driven = drive(np.concatenate([low + (high - low) * NODES for low, high in spans]))
        parts = [_part(driven, number) for number in range(len(spans))]
        half_s = middle_s - start_s
        coarse = _step(law, state, end_s - start_s, parts[0])
        first = None if coarse is None else _step(law, state, half_s, parts[1])
        refined = None if first is None else _step(law, first, end_s - middle_s, parts[2])
        if coarse is None or refined is None:
            step_s = SHORTER * (end_s - start_s)
            continue
        error = float(np.max(np.abs(coarse - refined) / (ATOL + RTOL * np.abs(refined))))
        factor = 0.9 * max(error, TINY) ** (-1 / (2 * STAGES))
        step_s = (end_s - start_s) * min(max(factor, SHORTER), LONGER)
        if error <= 1:
            start_s, state = end_s, refined
    return state


def _part(drive: Drive, number: int) -> Drive:
    nodes = slice(number * STAGES, (number + 1) * STAGES)
    return Drive(drive.generation[nodes], drive.escape[nodes], drive.visible[nodes])


def _step(law: Law, state: FloatArray, step_s: float, drive: Drive) -> FloatArray | None:
    """Return the state after one step; None if it is too long for Newton's iteration."""
    begin, n = state[0], np.tile(state[0], (STAGES, 1))
    for _ in range(ITERATIONS):
        rates = law.rates(n, drive.generation, drive.escape)
        residual = rates.growth - DERIVATIVES @ (n - begin) / step_s
        change = _solved(rates.slope, residual, step_s)
        n = np.clip(n + change, 0.0, 1.0)
        # The iteration converges quadratically: what is left is the square of this.
        if np.max(np.abs(change) / (ATOL + RTOL * n)) <= 1:
            break
    else:
        return None
    emission = law.rates(n, drive.generation, drive.escape).emission
    emitted = step_s * ((WEIGHTS * drive.visible) @ emission)
    return np.array([n[-1], state[1] + emitted])


def _solved(slope: FloatArray, residual: FloatArray, step_s: float) -> FloatArray:
    """Return Newton's change of n at the nodes, all of shape (nodes, traps).

    Gauss's elimination of all traps at once, which needs no pivots: the symmetric part of the
    matrix is positive, with Radau's weights, as long as the slopes are negative or the step short.
    """
    matrix = np.repeat(DERIVATIVES[:, :, None] / step_s, slope.shape[1], axis=2)
    matrix[range(STAGES), range(STAGES)] -= slope
    right = residual.copy()
    for row in range(STAGES - 1):
        factor = matrix[row + 1 :, row] / matrix[row, row]
        matrix[row + 1 :, row + 1 :] -= factor[:, None] * matrix[row, row + 1 :]
        right[row + 1 :] -= factor * right[row]
    for row in reversed(range(STAGES)):
        right[row] -= np.sum(matrix[row, row + 1 :] * right[row + 1 :], axis=0)
        right[row] /= matrix[row, row]
    return right
