"""The nonlinear least-squares core of every fit.

A Levenberg–Marquardt search with Moré's column scaling and Nielsen's damping finds the basin;
undamped Gauss–Newton steps, each by an orthogonal factorisation of the scaled Jacobian (never the
normal equations, which square its condition), then carry the minimum to the precision of the
arithmetic. The search solves a large problem by its normal equations, in a third of the time: a
trial step need not be exact.

From a start that is far off, which of several basins a search falls into is chance. There, and
where the fit did not end at a minimum of full rank, SciPy's trust-region reflective search goes
from the same start, too, and the lower of both ends is taken.

References
----------
J. J. Moré, *The Levenberg–Marquardt algorithm*, LNM 630 (1978); H. B. Nielsen, *Damping parameter
in Marquardt's method*, IMM-REP-1999-05; Å. Björck, *Numerical methods for least squares problems*
(1996); M. A. Branch, T. F. Coleman and Y. Li, *A subspace, interior, and conjugate gradient method
for large-scale bound-constrained minimization problems*, SIAM J. Sci. Comput. 21 (1999).
"""

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import Enum
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import lapack

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError


def propagated_covariance(covariance: FloatArray, transform: FloatArray) -> FloatArray:
    """Return T Cov Tᵀ; an infinite variance stays infinite and correlates with nothing."""
    is_finite = np.isfinite(np.diag(covariance))
    finite = np.where(np.multiply.outer(is_finite, is_finite), covariance, 0.0)
    # What the data say nothing about may overflow: that is as good as infinite.
    with np.errstate(over="ignore", invalid="ignore"):
        result: FloatArray = transform @ finite @ transform.T
    variance = np.diag(result)
    # Below 0 is what rounding leaves of variances that are as good as infinite, too.
    is_bounded = np.isfinite(variance) & (variance >= 0)
    unbounded = (transform[:, ~is_finite] != 0).any(axis=1) | ~is_bounded
    result[unbounded, :] = 0.0
    result[:, unbounded] = 0.0
    result[unbounded, unbounded] = np.inf
    return np.where(np.isfinite(result) | np.eye(len(result), dtype=bool), result, 0.0)


#: Parameters (p,) → residuals (m,) and their Jacobian (m, p), in units of the residuals' σ.
Residuals = Callable[[FloatArray], tuple[FloatArray, FloatArray]]

EPSILON = float(np.finfo(np.float64).eps)
#: Relative step below which the damped search hands over to undamped steps.
SEARCH_STEP = 1e-7
#: Relative step above which a stopped search has not converged.
CONVERGED_STEP = 1e-6
#: Gain of the next step, in parts of χ², above which a search has not converged, and the relative
#: step below which that gain is rounding.
CONVERGED_GAIN = 1e-8
ROUNDED_STEP = 1e-10
#: Number of evaluations after which a search begins anew, with the scales of the place it reached.
SEARCH_EVALUATIONS = 500
#: Ratio of χ² at the start to that at the end above which the start was far.
FAR_START = 4.0
#: Gain, in parts of χ², below which a search gains nothing.
NO_GAIN = 1e-12
#: Number of evaluations of the search that is made from a far start, too.
SECOND_EVALUATIONS = 2000
INITIAL_DAMPING = 1e-3
#: Smallest factor of the damping after a step as good as predicted; Nielsen's 1/3 takes 50 % more
#: steps.
MIN_DAMPING_FACTOR = 1 / 10
#: Number of entries of the Jacobian from which the search uses the normal equations, and the
#: covariance a triangle.
LARGE_JACOBIAN = 100_000
POLISH_STEPS = 60
#: Fall of χ² that matters: it moves no parameter by more than a tenth of its σ.
GAIN_THAT_MATTERS = 0.01
POLISH_PATIENCE = 3
#: Part of a step by which χ² has to begin to fall.
BEGUN = 1 / 64


class Ending(Enum):
    """Reason for the end of a fit."""

    #: At a minimum that determines every parameter that no bound holds.
    MINIMUM = "minimum"
    #: Where some combination of the parameters changes no residual: it is not determined by the
    #: data, or the search was lost on a plateau.
    RANK_DEFICIENT = "rank deficient"
    #: Still descending, along a flat valley or for want of evaluations.
    SLOW_PROGRESS = "creeping"


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
    iterations
        Number of evaluations of the residuals.
    ending
        How the fit ended.
    creeps
        Whether it ended early and a step more would gain what matters, residuals being in σ. Where
        residuals are large, or slopes do not follow how weights depend on the parameters, steps
        alternate about a minimum that is near enough for any use: χ² does not fall along them.
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
    ending: Ending
    creeps: bool

    @property
    def converged(self) -> bool:
        """Whether the fit ended at a minimum that determines its parameters."""
        return self.ending is Ending.MINIMUM

    @property
    def reduced_chi2(self) -> float:
        """χ² per degree of freedom; NaN without any."""
        return self.chi2 / self.dof if self.dof > 0 else float("nan")

    @property
    def sigma(self) -> FloatArray:
        """Standard uncertainties of the parameters for residuals of unit variance, shape (p,)."""
        return np.sqrt(np.diag(self.covariance))


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
        Largest number of evaluations of `residuals` in a damped search.
    tolerance
        Relative step at which to stop; 0 continues to the precision of the arithmetic and, from a
        start far off, tries another way, too.
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
        problem = _Problem(residuals, low, high)
        at_start = problem.at(np.clip(x, low, high))
        if not at_start.is_finite:
            raise FitError(
                "expected finite residuals at the start of the fit, got infinite or undefined "
                "ones; start nearer to the solution"
            )
        end = _fit_from(problem, at_start, max_iterations, tolerance, least_gain)
        is_approximate = tolerance > 0 or least_gain > 0
        is_far = at_start.chi2 > FAR_START * end.point.chi2
        if not is_approximate and (is_far or end.ending is not Ending.MINIMUM):
            end = _second_opinion(problem, at_start, end, max_iterations)
        return _result(problem, end)


@dataclass
class _Point:
    """Current point of the search: parameters, residuals, Jacobian and χ²."""

    x: FloatArray
    residuals: FloatArray
    jacobian: FloatArray
    chi2: float

    @property
    def is_finite(self) -> bool:
        return math.isfinite(self.chi2) and bool(np.isfinite(self.jacobian).all())


@dataclass(frozen=True)
class _Problem:
    """Residuals within a box."""

    residuals: Residuals
    low: FloatArray
    high: FloatArray

    def at(self, x: FloatArray) -> _Point:
        r, jacobian = self.residuals(x)
        return _Point(x, r, jacobian, float(r @ r))

    def nearest(self, x: FloatArray) -> FloatArray:
        return np.minimum(np.maximum(x, self.low), self.high)

    def free(self, point: _Point) -> NDArray[np.bool_]:
        """Return which parameters are inside the box, or pulled back into it by the gradient."""
        low, high = self.low, self.high
        inside = (low < point.x) & (point.x < high)
        if inside.all():
            return inside
        gradient = point.jacobian.T @ point.residuals
        is_held = ((point.x <= low) & (gradient >= 0)) | ((point.x >= high) & (gradient <= 0))
        return ~is_held


@dataclass(frozen=True)
class _End:
    """Where a fit ended, how, and after how many evaluations."""

    point: _Point
    ending: Ending
    evaluations: int


def _fit_from(
    problem: _Problem, start: _Point, max_iterations: int, tolerance: float, least_gain: float
) -> _End:
    """Search and polish, again and again where damped steps were short too early."""
    point, evaluations, search_step = start, 0, max(tolerance, SEARCH_STEP)
    is_compared = tolerance >= CONVERGED_STEP or least_gain > 0
    while True:
        before, limit = point.chi2, min(SEARCH_EVALUATIONS, max_iterations - evaluations)
        point, spent = _damped_search(problem, point, limit, search_step, least_gain)
        point, ending = _polish(problem, point, tolerance)
        evaluations += spent
        gains = spent == limit or search_step > 0 or point.chi2 < before * (1 - NO_GAIN)
        goes_on = ending is Ending.SLOW_PROGRESS and gains and not is_compared
        if not goes_on or evaluations >= max_iterations:
            return _End(point, ending, evaluations)
        # Along a flat, curved valley damped steps are short long before its lowest place.
        search_step = 0.0


def _second_opinion(problem: _Problem, start: _Point, first: _End, max_iterations: int) -> _End:
    """Return the lower of a fit's end and that of another search from the same start."""
    point, evaluations = _reflective_search(problem, start, min(SECOND_EVALUATIONS, max_iterations))
    evaluations += first.evaluations
    if point.chi2 >= first.point.chi2 and first.ending is Ending.MINIMUM:
        return replace(first, evaluations=evaluations)
    second = _fit_from(problem, point, max_iterations, 0.0, 0.0)
    lower = second if second.point.chi2 < first.point.chi2 else first
    return replace(lower, evaluations=evaluations + second.evaluations)


class _NoSlopeError(Exception):
    """A search came to a point from which no direction descends."""


def _reflective_search(
    problem: _Problem, start: _Point, max_evaluations: int
) -> tuple[_Point, int]:
    """Return where SciPy's trust-region reflective search ends, and its number of evaluations."""
    # Not above: it takes as long to load as a plan takes to be printed.
    from scipy import optimize

    fitted = problem.low < problem.high
    latest, lowest, evaluations = start, start, 0

    def at(part: FloatArray) -> _Point:
        nonlocal latest, lowest, evaluations
        x = start.x.copy()
        x[fitted] = part
        if not np.array_equal(x, latest.x):
            latest, evaluations = problem.at(x), evaluations + 1
            if latest.is_finite and latest.chi2 < lowest.chi2:
                lowest = latest
        return latest

    def residuals(part: FloatArray) -> FloatArray:
        point = at(part)
        return point.residuals if point.is_finite else np.full_like(point.residuals, np.inf)

    def slopes(part: FloatArray) -> FloatArray:
        point = at(part)
        if not (point.jacobian.T @ point.residuals)[fitted].any():
            raise _NoSlopeError
        return point.jacobian[:, fitted]

    # SciPy refuses what is not finite a step away from a start at a bound.
    with suppress(_NoSlopeError, ValueError, np.linalg.LinAlgError):
        optimize.least_squares(
            residuals,
            start.x[fitted],
            jac=slopes,
            bounds=(problem.low[fitted], problem.high[fitted]),
            x_scale="jac",
            ftol=NO_GAIN,
            # Where a parameter without effect is huge, every step is relatively short.
            xtol=2 * EPSILON,
            gtol=None,
            max_nfev=max_evaluations,
        )
    return lowest, evaluations


def _column_lengths(columns: FloatArray) -> FloatArray:
    lengths: FloatArray = np.sqrt(np.einsum("ij,ij->j", columns, columns))
    return lengths


def _or_1(lengths: FloatArray) -> FloatArray:
    """Return lengths, 1 where they are 0."""
    return lengths if lengths.all() else np.where(lengths > 0, lengths, 1.0)


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
    lengths, norms
        Lengths of the columns of J, and the same with 1 where they are 0, shape (p,).
    """

    def __init__(self, factors: FloatArray) -> None:
        p = factors.shape[1] - 1
        self.triangle: FloatArray = factors[:, :p] * _upper(len(factors), p)
        self.rotated: FloatArray = factors[:, p]
        self.lengths = _column_lengths(self.triangle)
        self.norms = _or_1(self.lengths)

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
    problem: _Problem, point: _Point, max_iterations: int, tolerance: float, least_gain: float
) -> tuple[_Point, int]:
    largest_norms = np.zeros_like(point.x)
    damping, growth, evaluations = INITIAL_DAMPING, 2.0, 1
    while evaluations < max_iterations:
        free = problem.free(point)
        if not free.any():
            break
        linearised = _Linearised.by_normal_equations(point)
        # Moré: scales never shrink, so that a flat stretch does not set a parameter loose.
        largest_norms = np.maximum(largest_norms, linearised.lengths)
        scale = _or_1(largest_norms)
        directions = linearised.directions(free, scale)
        if not directions[2].any():
            break
        length = _length(point.x * scale) + EPSILON
        accepted = False
        while not accepted and evaluations < max_iterations:
            step = _damped_step(directions, damping)
            step = _stopped_at_bounds(
                step, linearised, free, scale, damping,
                problem.low - point.x, problem.high - point.x,
            )  # fmt: skip
            trial_x = problem.nearest(point.x + step)
            step = trial_x - point.x
            size = _length(step * scale) / length
            # Not a number where all columns underflow.
            if not size >= EPSILON:
                return point, evaluations
            trial = problem.at(trial_x)
            evaluations += 1
            change = linearised.triangle @ step
            predicted = -float((2 * linearised.rotated + change) @ change)
            gain = (point.chi2 - trial.chi2) / predicted if predicted > 0 else -1.0
            accepted = trial.chi2 < point.chi2 and gain > 1e-4 and trial.is_finite
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


def _polish(problem: _Problem, point: _Point, tolerance: float) -> tuple[_Point, Ending]:
    """Take undamped steps while they shrink; return the point and how it ended.

    Where residuals are large the steps shrink by a constant factor, alternating, hence the
    patience.
    """
    least, idle, ending = np.inf, 0, Ending.SLOW_PROGRESS
    for _ in range(POLISH_STEPS):
        free = problem.free(point)
        if not free.any():
            return point, Ending.MINIMUM
        linearised = _Linearised.by_qr(point)
        s, directions, along = linearised.directions(free, linearised.norms)
        kept = s > _rank_tolerance(point.jacobian) * s[0]
        step = -(along[kept] / s[kept]) @ directions[kept]
        size = _length(step * linearised.norms) / (_length(point.x * linearised.norms) + EPSILON)
        idle = 0 if size < 0.9 * least else idle + 1
        least = min(least, size)
        if np.count_nonzero(kept) < np.count_nonzero(free):
            ending = Ending.RANK_DEFICIENT
        else:
            is_still = along @ along < CONVERGED_GAIN * point.chi2 or least < ROUNDED_STEP
            ending = Ending.MINIMUM if least < CONVERGED_STEP and is_still else Ending.SLOW_PROGRESS
        if idle == POLISH_PATIENCE or size < max(tolerance, EPSILON):
            break
        trial = problem.at(problem.nearest(point.x + step))
        # χ² itself is rounded: near the minimum only the step can tell progress.
        descends = trial.chi2 <= point.chi2 * (1 + 1e-6) or size < 1e-8
        if not (descends and trial.is_finite):
            break
        point = trial
    return point, ending


def _rank_tolerance(jacobian: FloatArray) -> float:
    return float(max(jacobian.shape)) * EPSILON


def parameter_covariance(jacobian: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (JᵀJ)⁻¹ of J (m, p), defined as `LeastSquaresFit.covariance`, and singular values.

    The singular values (p,) are those of J with its columns scaled to length 1.
    """
    scale = _or_1(_column_lengths(jacobian))
    scaled = jacobian / scale
    if scaled.size >= LARGE_JACOBIAN:
        scaled = np.asarray(np.linalg.qr(scaled, mode="r"))
    _, s, vt = np.linalg.svd(scaled, full_matrices=False)
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


def _result(problem: _Problem, end: _End) -> LeastSquaresFit:
    point = end.point
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
        at_bound=~problem.free(point),
        iterations=end.evaluations,
        ending=end.ending,
        creeps=end.ending is Ending.SLOW_PROGRESS and _gains_by_a_step(problem, point),
    )


def _gains_by_a_step(problem: _Problem, point: _Point) -> bool:
    """Return whether χ² would fall by what matters, and begins to fall as its slopes say."""
    free = problem.free(point)
    slopes = point.jacobian[:, free]
    norms = _or_1(_column_lengths(slopes))
    step = np.zeros_like(point.x)
    step[free] = -np.linalg.lstsq(slopes / norms, point.residuals, rcond=None)[0] / norms
    gain = float(np.linalg.norm(slopes @ step[free])) ** 2
    if not gain > GAIN_THAT_MATTERS:
        return False
    begun = problem.at(problem.nearest(point.x + BEGUN * step))
    return point.chi2 - begun.chi2 > BEGUN * (2 - BEGUN) * gain / 2
