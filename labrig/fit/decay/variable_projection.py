"""Search of rates by variable projection, and the joint fit of shape, channel weights and offsets.

The model is w_c h(t; θ) + b_c: a shape h shared by all channels, times one weight per channel
(rank one, Nalbach et al. sec. 4.3), plus the error of each channel's dark level. The brightest
channel's weight is held at 1, which fixes the scale of h.

For given rates the amplitudes (≥ 0) and the offsets follow by linear least squares, so the search
has one dimension per state: every combination of a grid of rates, then BOBYQA in log k from the
best. It is deterministic; the joint fit adds the last digits.

References
----------
G. H. Golub, V. Pereyra, *Inverse Problems* 19 (2003) R1; M. J. D. Powell, *The BOBYQA algorithm*,
DAMTP 2009/NA06, by way of NLopt.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations
from math import comb

import nlopt
import numpy as np

from labrig.fit.decay.series import WhitenedSeries
from labrig.fit.nonlinear_least_squares import LeastSquaresFit, least_squares
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


#: Shape parameters (q,) → h (n,) and its Jacobian (n, q).
Shape = Callable[[FloatArray], tuple[FloatArray, FloatArray]]


#: Largest number of attempts to identify the brightest channel.
CHANGES_OF_LEAD = 3


@dataclass(frozen=True)
class JointFit:
    """Fitted shape, weights and offsets in the series' own units.

    Attributes
    ----------
    shape
        Parameters θ of the shape, shape (q,).
    weights
        Weights of the channels with maximum 1, shape (C,).
    offsets
        Offsets of the channels, 0 where held, shape (C,).
    least_squares
        Solution in `[θ, weights of all but the brightest channel, fitted offsets]`.
    brightest
        Index of the channel whose weight is held at 1.
    """

    shape: FloatArray
    weights: FloatArray
    offsets: FloatArray
    least_squares: LeastSquaresFit
    brightest: int

    @property
    def chi2(self) -> float:
        """Sum of squared whitened residuals, the offsets' priors included."""
        return self.least_squares.chi2

    @property
    def n_parameters(self) -> int:
        """Number of fitted parameters."""
        return len(self.least_squares.parameters)

    def frame_residuals(self, data: WhitenedSeries) -> tuple[FloatArray, FloatArray]:
        """Return each frame's residual of unit variance along the signal, and squared SNR, (n,)."""
        unit = data.constant(self.weights)
        length = np.linalg.norm(unit, axis=1)
        residuals = self.least_squares.residuals[: unit.size].reshape(unit.shape)
        along = np.einsum("fc,fc->f", unit, residuals) / np.where(length > 0, length, 1.0)
        signal = residuals + data.values - data.constant(self.offsets)
        return along, np.einsum("fc,fc->f", signal, signal)

    def leverage(self, data: WhitenedSeries) -> tuple[float, float]:
        """Return the degrees of freedom that the fit took along and across the signal."""
        along, across = data.leverage(self.weights, self.least_squares.jacobian)
        return float(along.sum()), float(across.sum())


def fit_jointly(
    data: WhitenedSeries,
    shape: Shape,
    start: FloatArray,
    weights: FloatArray,
    offsets: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    max_iterations: int,
    tolerance: float,
    least_gain: float = 0.0,
) -> JointFit:
    """Fit θ, weights and offsets by least squares.

    Parameters
    ----------
    data
        Whitened series of n frames and C channels.
    shape
        Function that returns h and its Jacobian.
    start, lower, upper
        Start values and bounds of θ, shape (q,).
    weights, offsets
        Start values of the channels, shape (C,).
    max_iterations
        Number of evaluations after which a slowly converging fit is accepted.
    tolerance
        Relative step at which to stop; 0 for full precision.
    least_gain
        Gain in χ² of a step at which to stop; 0 for full precision.
    """
    theta = start
    for _ in range(CHANGES_OF_LEAD):
        brightest = int(np.argmax(weights))
        others = [c for c in range(len(weights)) if c != brightest]
        problem = JointProblem(data, shape, len(start), others)
        solution = least_squares(
            problem.residuals,
            problem.pack(theta, weights / weights[brightest], offsets),
            lower=problem.pack(lower, np.zeros_like(weights), np.full_like(weights, -np.inf)),
            upper=problem.pack(upper, np.full_like(weights, np.inf), np.full_like(weights, np.inf)),
            max_iterations=max_iterations,
            tolerance=tolerance,
            least_gain=least_gain,
        )
        theta, weights, offsets = problem.unpack(solution.parameters)
        # Of two channels about equally bright the other one may turn out to lead.
        if weights.max() <= 1:
            break
    return JointFit(theta, weights, offsets, solution, brightest)


@dataclass(frozen=True)
class JointProblem:
    """Residuals as a function of [θ, weights of the other channels, fitted offsets]."""

    data: WhitenedSeries
    shape: Shape
    n_shape: int
    others: list[int]

    def pack(self, theta: FloatArray, weights: FloatArray, offsets: FloatArray) -> FloatArray:
        """Return the parameters as one vector."""
        fitted = self.data.series.fitted_offsets
        return np.concatenate([theta, weights[self.others], offsets[fitted]])

    def unpack(self, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return θ, weights (C,) and offsets (C,) of all channels."""
        first_offset = self.n_shape + len(self.others)
        weights, offsets = np.ones(len(self.others) + 1), np.zeros(len(self.others) + 1)
        weights[self.others] = x[self.n_shape : first_offset]
        offsets[self.data.series.fitted_offsets] = x[first_offset:]
        return x[: self.n_shape], weights, offsets

    def residuals(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return whitened model − target (n C + p,), the last p rows priors, and its Jacobian."""
        data, q, others = self.data, self.n_shape, self.others
        theta, weights, _ = self.unpack(x)
        h, slopes = self.shape(theta)
        unit, first_offset = data.constant(weights), q + len(others)
        jacobian = np.zeros((len(data.target), len(x)))
        frames = jacobian[: unit.size].reshape(*unit.shape, len(x))
        frames[:, :, :q] = unit[:, :, None] * slopes[:, None, :]
        if others:
            frames[:, :, q:first_offset] = h[:, None, None] * data.matrices[:, :, others]
        jacobian[:, first_offset:] = data.offset_design
        residuals = data.offset_design @ x[first_offset:] - data.target
        residuals[: unit.size] += (unit * h[:, None]).ravel()
        return residuals, jacobian


def covariance_under_flicker(
    fit: JointFit, data: WhitenedSeries, signal: FloatArray, added_square: float
) -> FloatArray:
    """Return the covariance A V Aᵀ (p, p) of a fit if its frames flicker otherwise than weighed.

    The parameters follow the whitened values with A = (JᵀJ)⁻¹Jᵀ, whose weights are those of the
    flicker assumed. Values of another one have V = 1 + (ρ² − ρ₀²) s sᵀ, and no smaller covariance
    than if they were weighed by ρ: that is more than the (JᵀJ)⁻¹ of ρ's own weights.

    Parameters
    ----------
    fit
        The fit.
    data
        The series in units of its noise.
    signal
        What the fit says without offsets, shape (n, C).
    added_square
        Mean of ρ² − ρ₀², ρ₀ the flicker in the units of `data`.
    """
    covariance = fit.least_squares.covariance
    along = np.einsum("fcd,fd->fc", data.matrices, signal)
    jacobian = fit.least_squares.jacobian[: along.size].reshape(*along.shape, -1)
    # What is not determined at all has an infinite variance, whatever the flicker.
    determined = np.where(np.isfinite(covariance), covariance, 0.0)
    effect = determined @ np.einsum("fc,fcp->pf", along, jacobian)
    return np.asarray(covariance + added_square * effect @ effect.T)


def weight_sigma(fit: JointFit, covariance: FloatArray) -> FloatArray:
    """Return σ of the channel weights (C,), 0 for the held one, from the full covariance (p, p)."""
    n_shape, others = len(fit.shape), np.arange(len(fit.weights)) != fit.brightest
    sigma = np.zeros(len(fit.weights))
    variances = np.diag(covariance)[n_shape : n_shape + np.count_nonzero(others)]
    sigma[others] = np.sqrt(variances)
    return sigma
