"""Variable projection: search in the space of rates, the amplitudes being linear.

For given rates the amplitudes (≥ 0) and the offsets follow by linear least squares, so the search
has one dimension per state: every combination of a grid of rates, then BOBYQA in log k from the
best. It is deterministic; the joint fit adds the last digits.

References
----------
G. H. Golub, V. Pereyra, *Inverse Problems* 19 (2003) R1; M. J. D. Powell, *The BOBYQA algorithm*,
DAMTP 2009/NA06, by way of NLopt.
"""

from dataclasses import dataclass
from itertools import combinations
from math import comb

import nlopt
import numpy as np

from labrig.fit.decay.whitening import WhitenedSeries
from labrig.foundation.arrays import FloatArray
from labrig.material import exponential_means

#: Largest number of combinations of rates, which limits the grid.
COMBINATIONS = 2000
FINEST_GRID = 36
#: Precision in log k at which the search ends and the joint fit starts.
LOG_RATE_TOLERANCE = 0.1
MAX_EVALUATIONS = 200


@dataclass(frozen=True)
class Projection:
    """Linear part of the problem at given channel weights, with the offsets eliminated.

    Attributes
    ----------
    data
        The whitened series.
    unit
        Whitened signal of 1, shape (n, C).
    offset_directions
        Orthonormal basis of what the offsets explain, shape (n C + p, m).
    target
        Whitened values without that part, shape (n C + p,).
    information, pull
        Squared length of `unit` in each frame, and its product with the target, shape (n,).
    shadow
        Product of `unit` in each frame with the offset directions, shape (m, n).
    """

    data: WhitenedSeries
    unit: FloatArray
    offset_directions: FloatArray
    target: FloatArray
    information: FloatArray
    pull: FloatArray
    shadow: FloatArray

    def normal_equations(self, shapes: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return AᵀA (q, q) and Aᵀb (q,) of the columns A of shapes (n, q) and the target b."""
        shadow = self.shadow @ shapes
        gram = shapes.T @ (self.information[:, None] * shapes) - shadow.T @ shadow
        return gram, self.pull @ shapes

    def of_rates(self, log_rates: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the normal equations of exponentials (q,) of amplitude 1 at the first frame."""
        series = self.data.series
        means = exponential_means(np.exp(log_rates), series.t, series.exposure)
        return self.normal_equations(means)

    def columns(self, shapes: FloatArray) -> FloatArray:
        """Return columns (n C + p, q) of shapes (n, q) without what the offsets explain."""
        design = self.data.signal_design(self.unit, shapes)
        return design - self.offset_directions @ (self.offset_directions.T @ design)

    def amplitudes(self, log_rates: FloatArray) -> tuple[FloatArray, float]:
        """Return the best amplitudes ≥ 0 and the remaining χ²."""
        gram, moments = self.of_rates(log_rates)
        values = nonnegative(gram, moments)
        explained = float((2 * moments - gram @ values) @ values)
        return values, float(self.target @ self.target) - explained


def projection(data: WhitenedSeries, weights: FloatArray) -> Projection:
    """Return the linear problem of `data` at channel weights (C,)."""
    directions = np.linalg.qr(data.offset_design)[0]
    target = data.target - directions @ (directions.T @ data.target)
    unit = data.constant(weights)
    frames = slice(0, unit.size)
    return Projection(
        data=data,
        unit=unit,
        offset_directions=directions,
        target=target,
        information=np.einsum("fc,fc->f", unit, unit),
        pull=np.einsum("fc,fc->f", unit, target[frames].reshape(unit.shape)),
        shadow=np.einsum("fc,fcm->mf", unit, directions[frames].reshape(*unit.shape, -1)),
    )


def nonnegative(gram: FloatArray, moments: FloatArray) -> FloatArray:
    """Minimise ½ aᵀGa − mᵀa over a ≥ 0 for a few columns by trying all active sets.

    The search calls it thousands of times with no need of exact results: the exact
    `nonnegative_least_squares` would make a decay fit take half as long again.
    """
    n = len(moments)
    best, best_cost = np.zeros(n), 0.0
    for n_kept in range(n, 0, -1):
        for kept in combinations(range(n), n_kept):
            rows = list(kept)
            try:
                a = np.linalg.solve(gram[rows][:, rows], moments[rows])
            except np.linalg.LinAlgError:
                continue
            cost = -0.5 * float(moments[rows] @ a)
            if cost < best_cost and a.min() >= 0:
                best, best_cost = np.zeros(n), cost
                best[rows] = a
                if n_kept == n:
                    return best
    return best


def search_rates(problem: Projection, n_free: int, fixed: FloatArray) -> FloatArray | None:
    """Return log rates (n_free,) near the global best, or None if fewer states always fit as well.

    Parameters
    ----------
    problem
        Linear problem at the channel weights to be used.
    n_free
        Number of rates to find, ≥ 1.
    fixed
        Fixed log rates, shape (f,).
    """
    low, high = problem.data.series.log_rate_bounds
    start = _best_on_grid(problem, n_free, fixed, low, high)
    if start is None or n_free == 1:
        # The joint fit finds the nearest minimum, which a single rate has between two of the grid.
        return start

    def chi2(log_rates: FloatArray, gradient: FloatArray) -> float:
        return problem.amplitudes(np.concatenate([log_rates, fixed]))[1]

    optimiser = nlopt.opt(nlopt.LN_BOBYQA, n_free)
    optimiser.set_min_objective(chi2)
    optimiser.set_lower_bounds(np.full(n_free, low))
    optimiser.set_upper_bounds(np.full(n_free, high))
    optimiser.set_initial_step((high - low) / grid_size(n_free))
    optimiser.set_xtol_abs(LOG_RATE_TOLERANCE)
    optimiser.set_maxeval(MAX_EVALUATIONS)
    try:
        # An exception must not pass through NLopt's C code.
        with np.errstate(all="ignore"):
            log_rates = np.asarray(optimiser.optimize(start), dtype=np.float64)
    except nlopt.RoundoffLimited:
        # Noise-free data: χ² is all rounding before the rates have settled. The grid will do.
        return start
    return log_rates


def grid_size(n_free: int) -> int:
    """Return the number of rates on the grid with at most `COMBINATIONS` combinations."""
    return max(
        size for size in range(n_free + 2, FINEST_GRID + 1) if comb(size, n_free) <= COMBINATIONS
    )


def _best_on_grid(
    problem: Projection, n_free: int, fixed: FloatArray, low: float, high: float
) -> FloatArray | None:
    """Return the best combination with all amplitudes positive, None if there is none."""
    grid = np.linspace(low, high, grid_size(n_free))
    log_rates = np.concatenate([grid, fixed])
    gram, moments = problem.of_rates(log_rates)
    norms = np.sqrt(np.maximum(np.diag(gram), 0.0))
    norms = np.where(norms > 0, norms, 1.0)
    gram, moments = gram / np.outer(norms, norms), moments / norms
    chosen = np.array(list(combinations(range(len(grid)), n_free)))
    fixed_columns = np.broadcast_to(np.arange(len(grid), len(log_rates)), (len(chosen), len(fixed)))
    chosen = np.hstack([chosen, fixed_columns])
    matrices = gram[chosen[:, :, None], chosen[:, None, :]]
    # Neighbours on the grid are nearly alike; a hint of a ridge keeps the batch solvable.
    matrices = matrices + 1e-13 * np.eye(chosen.shape[1])
    rhs = moments[chosen]
    amplitudes = np.linalg.solve(matrices, rhs[:, :, None])[:, :, 0]
    explained = np.einsum("ij,ij->i", amplitudes, rhs)
    explained[~np.all(amplitudes[:, :n_free] > 0, axis=1)] = -np.inf
    best = int(np.argmax(explained))
    return grid[chosen[best, :n_free]] if np.isfinite(explained[best]) else None
