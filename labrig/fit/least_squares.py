"""The nonlinear least-squares core of every fit.

A Levenberg–Marquardt search with Moré's column scaling and Nielsen's damping finds the basin;
undamped Gauss–Newton steps, each by an orthogonal factorisation of the scaled Jacobian (never the
normal equations, which square its condition), then carry the minimum to the precision of the
arithmetic. The search solves a large problem by its normal equations, in a third of the time: a
trial step need not be exact.

References
----------
J. J. Moré, *The Levenberg–Marquardt algorithm*, LNM 630 (1978); H. B. Nielsen, *Damping parameter
in Marquardt's method*, IMM-REP-1999-05; Å. Björck, *Numerical methods for least squares problems*
(1996).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import lapack

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
#: Smallest factor of the damping after a step as good as predicted; Nielsen's 1/3 takes 50 % more
#: steps.
MIN_DAMPING_FACTOR = 1 / 10
#: Number of entries of the Jacobian from which the search uses the normal equations.
LARGE_JACOBIAN = 100_000
POLISH_STEPS = 60
POLISH_PATIENCE = 3


@dataclass(frozen=True)
class LeastSquaresFit:
    """A minimum of ½‖r(x)‖² with its covariance and diagnostics.

    Attributes
    ----------
    parameters
        Parameters at the minimum, shape (p,).
    covariance
        Covariance (JᵀJ)⁻¹ of the parameters if the residuals have unit variance, else to be
        multiplied by `reduced_chi2`, shape (p, p). Bounds are ignored; a parameter on which no
        residual depends independently of the others has an infinite variance.
    residuals, jacobian
        Residuals (m,) and Jacobian (m, p) at the minimum.
    chi2, dof
        Sum of squared residuals, and degrees of freedom m − rank.
    rank, condition
        Numerical rank and 2-norm condition of the Jacobian with its columns scaled to length 1.
    at_bound
        Whether a bound holds the parameter, shape (p,), bool.
    iterations, converged
        Number of evaluations of the residuals, and whether the last step was negligible.
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
        """χ² per degree of freedom; NaN without any."""
        return self.chi2 / self.dof if self.dof > 0 else float("nan")

    @property
    def sigma(self) -> FloatArray:
        """Standard uncertainties of the parameters for residuals of unit variance, shape (p,)."""
        return np.sqrt(np.diag(self.covariance))


@dataclass
class _Point:
    """Current point of the search: parameters, residuals, Jacobian and χ²."""

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
    least_gain: float = 0.0,
) -> LeastSquaresFit:
    """Minimise ‖r(x)‖² within a box.

    Parameters
    ----------
    residuals
        Function of the parameters (p,) that returns the residuals (m,) in units of their σ and
        their Jacobian (m, p). It may overflow at a trial point, which is then rejected.
    start
        Finite start values, shape (p,), moved into the box if outside.
    lower, upper
        Bounds, scalar or of shape (p,).
    max_iterations
        Largest number of evaluations of `residuals` in the damped search.
    tolerance
        Relative step at which to stop; 0 continues to the precision of the arithmetic.
    least_gain
        Gain in χ² of a step at which the damped search ends, for fits that are only compared: along
        a flat valley it would creep for long without a gain that matters.

    Returns
    -------
    LeastSquaresFit
        The minimum with covariance, residuals, Jacobian and convergence.

    Raises
    ------
    FitError
        The residuals or the Jacobian at `start` are not finite.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.fit import least_squares
    >>> t, y = np.array([0.0, 1.0, 2.0, 3.0]), np.array([2.02, 1.21, 0.73, 0.45])
    >>> def residuals(x):
    ...     model = x[0] * np.exp(-x[1] * t)
    ...     return (model - y) / 0.02, np.column_stack([model / x[0], -t * model]) / 0.02
    >>> fit = least_squares(residuals, [1.0, 1.0], lower=0.0)
    >>> fit.parameters.round(3).tolist(), fit.sigma.round(3).tolist()
    ([2.017, 0.506], [0.019, 0.01])
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
            residuals, point, low, high, max_iterations, max(tolerance, SEARCH_STEP), least_gain
        )
        point, step = _polish(residuals, point, low, high, tolerance)
        if step >= CONVERGED_STEP > tolerance and iterations < max_iterations and not least_gain:
            # Along a flat, curved valley damped steps are short long before its lowest place.
            remaining = max_iterations - iterations
            point, extra = _damped_search(residuals, point, low, high, remaining, 0.0, 0.0)
            point, step = _polish(residuals, point, low, high, tolerance)
            iterations += extra
        return _result(point, low, high, iterations, step < CONVERGED_STEP)


def _evaluate(residuals: Residuals, x: FloatArray) -> _Point:
    r, jacobian = residuals(x)
    return _Point(x, r, jacobian, float(r @ r))


def _free(point: _Point, low: FloatArray, high: FloatArray) -> NDArray[np.bool_]:
    """Return which parameters are free: inside the box, or pulled back into it by the gradient."""
    inside = (low < point.x) & (point.x < high)
    if inside.all():
        return inside
    gradient = point.jacobian.T @ point.residuals
    is_held = ((point.x <= low) & (gradient >= 0)) | ((point.x >= high) & (gradient <= 0))
    return ~is_held


def _column_norms(columns: FloatArray) -> FloatArray:
    norms: FloatArray = np.sqrt(np.einsum("ij,ij->j", columns, columns))
    return norms if norms.all() else np.where(norms > 0, norms, 1.0)


def _length(vector: FloatArray) -> float:
    return math.sqrt(float(vector @ vector))


@cache
def _upper(rows: int, columns: int) -> FloatArray:
    """Return a matrix of 1 on and above the diagonal, else 0."""
    return np.triu(np.ones((rows, columns)))


class _Linearised:
    """Linear problem at a point, rotated so that p rows are equivalent to the m rows of J and r.

    Attributes
    ----------
    triangle
        R of J = Q R, shape (p, p); fewer rows if m < p.
    turned
        Rotated residuals Qᵀ r, shape (p,).
    norms
        Lengths of the columns of J, 1 where they are 0, shape (p,).
    """

    def __init__(self, factors: FloatArray) -> None:
        p = factors.shape[1] - 1
        self.triangle: FloatArray = factors[:, :p] * _upper(len(factors), p)
        self.rotated: FloatArray = factors[:, p]
        self.norms = _column_norms(self.triangle)

    @classmethod
    def by_qr(cls, point: _Point) -> "_Linearised":
        """Linearise by an orthogonal factorisation."""
        m, p = point.jacobian.shape
        columns = np.empty((m, p + 1), order="F")
        columns[:, :p], columns[:, p] = point.jacobian, point.residuals
        return cls(lapack.dgeqrf(columns, overwrite_a=True)[0][: min(m, p)])

    @classmethod
    def by_normal_equations(cls, point: _Point) -> "_Linearised":
        """Linearise by the normal equations if the problem is large and they can be solved."""
        m, p = point.jacobian.shape
        if m <= p or m * p < LARGE_JACOBIAN:
            return cls.by_qr(point)
        products = np.empty((p + 1, p + 1))
        products[:p, :p] = point.jacobian.T @ point.jacobian
        products[:p, p] = point.jacobian.T @ point.residuals
        products[p, p] = point.chi2
        lengths = np.sqrt(np.where(np.diag(products) > 0, np.diag(products), 1.0))
        factors, failed = lapack.dpotrf(products / np.outer(lengths, lengths))
        return cls.by_qr(point) if failed else cls((factors * lengths)[:p])

    def directions(
        self, free: NDArray[np.bool_], scale: FloatArray, before: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Decompose the free columns of J over `scale` into singular values.

        Returns
        -------
        values, directions, along
            Singular values s (k,), their directions v (k, p) in units of the parameters, and r
            along them (k,), after a step `before` (p,) of others: the undamped step is
            −Σ_i (r_i/s_i) v_i.
        """
        scaled = self.triangle * (free / scale)
        u, s, vt, _ = lapack.dgesdd(scaled[:, free], full_matrices=0)
        in_parameters = np.zeros((len(s), len(scale)))
        in_parameters[:, free] = vt
        rotated = self.rotated if before is None else self.rotated + self.triangle @ before
        return s, in_parameters / scale, rotated @ u


def _damped_step(
    decomposed: tuple[FloatArray, FloatArray, FloatArray], damping: float
) -> FloatArray:
    s, directions, along = decomposed
    step: FloatArray = -(s * along / (s * s + damping * s[0] ** 2)) @ directions
    return step


def _stopped_at_bounds(
    step: FloatArray,
    linearised: _Linearised,
    free: NDArray[np.bool_],
    scale: FloatArray,
    damping: float,
    low: FloatArray,
    high: FloatArray,
) -> FloatArray:
    """Return a damped step within a box: parameters that leave it stop at their bound.

    The others are solved for again, given those: without it a step that a bound cuts off may be as
    good as none, and the search crawls along the bound.
    """
    stopped = np.zeros_like(step)
    while (leaving := free & ((step < low) | (step > high))).any():
        stopped[leaving] = np.clip(step, low, high)[leaving]
        free = free & ~leaving
        if not free.any():
            return stopped
        step = stopped + _damped_step(linearised.directions(free, scale, stopped), damping)
    return step


def _damped_search(
    residuals: Residuals,
    point: _Point,
    low: FloatArray,
    high: FloatArray,
    max_iterations: int,
    tolerance: float,
    least_gain: float,
) -> tuple[_Point, int]:
    scale = np.zeros_like(point.x)
    damping, growth, evaluations = INITIAL_DAMPING, 2.0, 1
    while evaluations < max_iterations:
        free = _free(point, low, high)
        if not free.any():
            break
        linearised = _Linearised.by_normal_equations(point)
        # Moré: scales never shrink, so that a flat stretch does not set a parameter loose.
        scale = np.maximum(scale, linearised.norms)
        directions = linearised.directions(free, scale)
        length = _length(point.x * scale) + EPSILON
        accepted = False
        while not accepted and evaluations < max_iterations:
            step = _damped_step(directions, damping)
            step = _stopped_at_bounds(
                step, linearised, free, scale, damping, low - point.x, high - point.x
            )
            trial_x = np.minimum(np.maximum(point.x + step, low), high)
            step = trial_x - point.x
            size = _length(step * scale) / length
            if size < EPSILON:
                return point, evaluations
            trial = _evaluate(residuals, trial_x)
            evaluations += 1
            change = linearised.triangle @ step
            predicted = -float((2 * linearised.rotated + change) @ change)
            gain = (point.chi2 - trial.chi2) / predicted if predicted > 0 else -1.0
            accepted = (
                trial.chi2 < point.chi2 and gain > 1e-4 and bool(np.isfinite(trial.jacobian).all())
            )
            if accepted:
                damping *= max(MIN_DAMPING_FACTOR, 1 - (2 * min(gain, 1.0) - 1) ** 3)
                growth = 2.0
                gained, point = point.chi2 - trial.chi2, trial
            else:
                damping *= growth
                growth *= 2
        if accepted and damping < 1 and (size < tolerance or gained < least_gain):
            break
    return point, evaluations


def _polish(
    residuals: Residuals, point: _Point, low: FloatArray, high: FloatArray, tolerance: float
) -> tuple[_Point, float]:
    """Take undamped steps while they shrink; return the point and the smallest relative step.

    Where residuals are large the steps shrink by a constant factor, alternating, hence the
    patience.
    """
    least, idle = np.inf, 0
    for _ in range(POLISH_STEPS):
        free = _free(point, low, high)
        if not free.any():
            return point, 0.0
        linearised = _Linearised.by_qr(point)
        s, directions, along = linearised.directions(free, linearised.norms)
        kept = s > _rank_tolerance(point.jacobian) * s[0]
        step = -(along[kept] / s[kept]) @ directions[kept]
        size = _length(step * linearised.norms) / (_length(point.x * linearised.norms) + EPSILON)
        idle = 0 if size < 0.9 * least else idle + 1
        least = min(least, size)
        if idle == POLISH_PATIENCE or size < max(tolerance, EPSILON):
            break
        trial = _evaluate(residuals, np.minimum(np.maximum(point.x + step, low), high))
        # χ² itself is rounded: near the minimum only the step can tell progress.
        descends = trial.chi2 <= point.chi2 * (1 + 1e-6) or size < 1e-8
        if not (descends and np.isfinite(trial.jacobian).all()):
            break
        point = trial
    return point, least


def _rank_tolerance(jacobian: FloatArray) -> float:
    return float(max(jacobian.shape)) * EPSILON


def parameter_covariance(jacobian: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (JᵀJ)⁻¹ of J (m, p), defined as `LeastSquaresFit.covariance`, and singular values.

    The singular values (p,) are those of J with its columns scaled to length 1.
    """
    scale = _column_norms(jacobian)
    _, s, vt = np.linalg.svd(jacobian / scale, full_matrices=False)
    kept = s > _rank_tolerance(jacobian) * s[0]
    inverse = vt[kept].T / s[kept]
    covariance = (inverse @ inverse.T) / np.outer(scale, scale)
    if not kept.all() or len(kept) < len(scale):
        resolved = np.einsum("ij,ij->j", vt[kept], vt[kept])
        unresolved = resolved < 1 - np.sqrt(EPSILON)
        covariance[unresolved, :] = 0.0
        covariance[:, unresolved] = 0.0
        covariance[unresolved, unresolved] = np.inf
    return covariance, s


def _result(
    point: _Point, low: FloatArray, high: FloatArray, iterations: int, converged: bool
) -> LeastSquaresFit:
    covariance, s = parameter_covariance(point.jacobian)
    rank = int(np.count_nonzero(s > _rank_tolerance(point.jacobian) * s[0]))
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
