"""The one nonlinear least-squares core under every fit.

A Levenberg–Marquardt search with Moré's column scaling and Nielsen's damping finds the basin;
undamped Gauss–Newton steps, each by an orthogonal factorisation of the scaled Jacobian (never the
normal equations, which square its condition), then carry the minimum to the precision of the
arithmetic.

References
----------
J. J. Moré, *The Levenberg–Marquardt algorithm*, LNM 630 (1978); H. B. Nielsen, *Damping parameter
in Marquardt's method*, IMM-REP-1999-05; Å. Björck, *Numerical methods for least squares problems*
(1996).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from labrig.errors import FitError

FloatArray = NDArray[np.float64]
#: Parameters (p,) → residuals (m,) and their Jacobian (m, p), in units of the residuals' σ.
Residuals = Callable[[FloatArray], tuple[FloatArray, FloatArray]]

EPSILON = float(np.finfo(np.float64).eps)
#: Relative step below which the damped search hands over to undamped steps.
SEARCH_STEP = 1e-7
#: Relative step above which a stopped search has not converged.
CONVERGED_STEP = 1e-6
INITIAL_DAMPING = 1e-3
POLISH_STEPS = 60
POLISH_PATIENCE = 3


@dataclass(frozen=True)
class LeastSquaresFit:
    """A minimum of ½‖r(x)‖² and what is known about it.

    Attributes
    ----------
    parameters
        (p,) at the minimum.
    covariance
        (p, p) (JᵀJ)⁻¹: the parameters' covariance if the residuals have unit variance, else to be
        multiplied by `reduced_chi2`. Bounds are ignored; a parameter on which no residual depends
        independently of the others has an infinite variance.
    residuals, jacobian
        (m,) and (m, p) at the minimum.
    chi2, dof
        Sum of squared residuals, and m − rank.
    rank, condition
        Numerical rank and 2-norm condition of the Jacobian with its columns scaled to length 1.
    at_bound
        (p,) bool, parameters held by a bound.
    iterations, converged
        Evaluations of the residuals, and whether the last step was negligible.
    """

    parameters: FloatArray
    covariance: FloatArray
    residuals: FloatArray
    jacobian: FloatArray
    chi2: float
    dof: int
    rank: int
    condition: float
    at_bound: NDArray[np.bool_]
    iterations: int
    converged: bool

    @property
    def reduced_chi2(self) -> float:
        """χ² per degree of freedom; NaN if there are none."""
        return self.chi2 / self.dof if self.dof > 0 else float("nan")

    @property
    def sigma(self) -> FloatArray:
        """(p,) standard uncertainties for residuals of unit variance."""
        return np.sqrt(np.diag(self.covariance))


@dataclass
class _Point:
    """Where the search stands: parameters, residuals, Jacobian and χ²."""

    x: FloatArray
    residuals: FloatArray
    jacobian: FloatArray
    chi2: float


def least_squares(
    residuals: Residuals,
    start: ArrayLike,
    *,
    lower: ArrayLike = -np.inf,
    upper: ArrayLike = np.inf,
    max_iterations: int = 20_000,
    tolerance: float = 0.0,
) -> LeastSquaresFit:
    """Minimise ‖r(x)‖² within a box.

    Parameters
    ----------
    residuals
        Function of the parameters (p,) that returns residuals (m,) over their σ and their
        Jacobian (m, p). May overflow at a trial point: such a step is refused.
    start
        (p,) finite; moved into the box if outside.
    lower, upper
        Bounds, scalar or (p,).
    max_iterations
        Evaluations of `residuals` allowed to the damped search.
    tolerance
        Relative step small enough to stop at; 0 goes on to the precision of the arithmetic.

    Raises
    ------
    FitError
        The residuals or the Jacobian at `start` are not finite.
    """
    x = np.array(start, dtype=np.float64)
    low = np.broadcast_to(np.asarray(lower, dtype=np.float64), x.shape)
    high = np.broadcast_to(np.asarray(upper, dtype=np.float64), x.shape)
    # A trial step may overflow an exponential; it is refused below, not reported.
    with np.errstate(all="ignore"):
        point = _evaluate(residuals, np.clip(x, low, high))
        if not (np.isfinite(point.chi2) and np.all(np.isfinite(point.jacobian))):
            raise FitError(
                "expected finite residuals at the start of the fit, got infinite or undefined "
                "ones; start nearer to the solution"
            )
        point, iterations = _damped_search(
            residuals, point, low, high, max_iterations, max(tolerance, SEARCH_STEP)
        )
        point, step = _polish(residuals, point, low, high, tolerance)
        return _result(point, low, high, iterations, step < CONVERGED_STEP)


def _evaluate(residuals: Residuals, x: FloatArray) -> _Point:
    r, jacobian = residuals(x)
    return _Point(x, r, jacobian, float(r @ r))


def _free(point: _Point, low: FloatArray, high: FloatArray) -> NDArray[np.bool_]:
    """Parameters that no bound holds: inside the box, or pulled back into it by the gradient."""
    if np.all((low < point.x) & (point.x < high)):
        return np.ones(point.x.shape, dtype=np.bool_)
    gradient = point.jacobian.T @ point.residuals
    held = ((point.x <= low) & (gradient >= 0)) | ((point.x >= high) & (gradient <= 0))
    return ~held


def _column_norms(jacobian: FloatArray) -> FloatArray:
    norms: FloatArray = np.sqrt(np.einsum("ij,ij->j", jacobian, jacobian))
    return np.where(norms > 0, norms, 1.0)


def _damped_search(
    residuals: Residuals,
    point: _Point,
    low: FloatArray,
    high: FloatArray,
    max_iterations: int,
    tolerance: float,
) -> tuple[_Point, int]:
    scale = _column_norms(point.jacobian)
    damping, growth, evaluations = INITIAL_DAMPING, 2.0, 1
    while evaluations < max_iterations:
        free = _free(point, low, high)
        if not free.any():
            break
        # Moré: scales never shrink, so that a flat stretch does not set a parameter loose.
        scale = np.maximum(scale, _column_norms(point.jacobian))
        u, s, vt = np.linalg.svd(point.jacobian[:, free] / scale[free], full_matrices=False)
        projected = s * (u.T @ point.residuals)
        accepted = False
        while not accepted and evaluations < max_iterations:
            step = np.zeros_like(point.x)
            step[free] = -(vt.T @ (projected / (s * s + damping * s[0] ** 2))) / scale[free]
            trial_x = np.clip(point.x + step, low, high)
            step = trial_x - point.x
            size = np.linalg.norm(step * scale) / (np.linalg.norm(point.x * scale) + EPSILON)
            if size < EPSILON:
                return point, evaluations
            trial = _evaluate(residuals, trial_x)
            evaluations += 1
            change = point.jacobian @ step
            promised = -float(2 * point.residuals @ change + change @ change)
            gain = (point.chi2 - trial.chi2) / promised if promised > 0 else -1.0
            accepted = bool(
                trial.chi2 < point.chi2 and gain > 1e-4 and np.all(np.isfinite(trial.jacobian))
            )
            if accepted:
                damping *= max(1 / 3, 1 - (2 * min(gain, 1.0) - 1) ** 3)
                growth = 2.0
                point = trial
            else:
                damping *= growth
                growth *= 2
        if accepted and size < tolerance and damping < 1:
            break
    return point, evaluations


def _polish(
    residuals: Residuals, point: _Point, low: FloatArray, high: FloatArray, tolerance: float
) -> tuple[_Point, float]:
    """Undamped steps for as long as they shrink; the least relative one tells the convergence.

    Where residuals are large the steps shrink by a constant factor, alternating; so patience.
    """
    least, idle = np.inf, 0
    for _ in range(POLISH_STEPS):
        free = _free(point, low, high)
        if not free.any():
            return point, 0.0
        scale = _column_norms(point.jacobian)
        u, s, vt = np.linalg.svd(point.jacobian[:, free] / scale[free], full_matrices=False)
        kept = s > _rank_tolerance(point.jacobian) * s[0]
        step = np.zeros_like(point.x)
        along = (u.T @ point.residuals)[kept] / s[kept]
        step[free] = -(vt[kept].T @ along) / scale[free]
        size = float(np.linalg.norm(step * scale) / (np.linalg.norm(point.x * scale) + EPSILON))
        idle = 0 if size < 0.9 * least else idle + 1
        least = min(least, size)
        if idle == POLISH_PATIENCE or size < max(tolerance, EPSILON):
            break
        trial = _evaluate(residuals, np.clip(point.x + step, low, high))
        # χ² itself is rounded: near the minimum only the step can tell progress.
        descends = trial.chi2 <= point.chi2 * (1 + 1e-6) or size < 1e-8
        if not (descends and np.all(np.isfinite(trial.jacobian))):
            break
        point = trial
    return point, least


def _rank_tolerance(jacobian: FloatArray) -> float:
    return float(max(jacobian.shape)) * EPSILON


def _result(
    point: _Point, low: FloatArray, high: FloatArray, iterations: int, converged: bool
) -> LeastSquaresFit:
    scale = _column_norms(point.jacobian)
    _, s, vt = np.linalg.svd(point.jacobian / scale, full_matrices=False)
    kept = s > _rank_tolerance(point.jacobian) * s[0]
    rank = int(np.count_nonzero(kept))
    inverse = vt[kept].T / s[kept]
    covariance = (inverse @ inverse.T) / np.outer(scale, scale)
    if rank < len(scale):
        seen = np.einsum("ij,ij->j", vt[kept], vt[kept])
        unseen = seen < 1 - np.sqrt(EPSILON)
        covariance[unseen, :] = 0.0
        covariance[:, unseen] = 0.0
        covariance[unseen, unseen] = np.inf
    return LeastSquaresFit(
        parameters=point.x,
        covariance=covariance,
        residuals=point.residuals,
        jacobian=point.jacobian,
        chi2=point.chi2,
        dof=len(point.residuals) - rank,
        rank=rank,
        condition=float(s[0] / s[-1]) if s[-1] > 0 else float("inf"),
        at_bound=~_free(point, low, high) & ((point.x <= low) | (point.x >= high)),
        iterations=iterations,
        converged=converged,
    )
