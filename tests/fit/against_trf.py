"""A fit from a bad start, and SciPy's trust-region reflective fit from the same one."""

import warnings
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import optimize

from labrig.fit.nonlinear_least_squares import EPSILON, LeastSquaresFit, least_squares
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from tests.fit.fit_problems import Problem

#: Ratio of χ² from which one fit is worse than another.
WORSE = 1.001
#: Fraction of the start's χ², or of 1 or a million, below which a χ² is rounding.
ROUNDING = 1e-20
MAX_EVALUATIONS = 2000
#: Cosine between residuals and a column above which a point is not stationary.
STATIONARY = 1e-4


@dataclass(frozen=True)
class Compared:
    """A problem with labrig's fit, χ² of `trf` and its evaluations, and χ² of rounding."""

    problem: Problem
    fit: LeastSquaresFit
    trf: float
    trf_evaluations: int
    floor: float

    @cached_property
    def best(self) -> float:
        """The least known χ², also of a fit from the truth."""
        truth = self.problem.truth
        near = np.inf if truth is None else trf(self.problem, truth)[0]
        return min(self.fit.chi2, self.trf, near)

    @property
    def ratio(self) -> float:
        """χ² over that of `trf`, both not below rounding."""
        return max(self.fit.chi2, self.floor) / max(self.trf, self.floor)

    @property
    def above_best(self) -> float:
        """χ² over the least known."""
        return max(self.fit.chi2, self.floor) / max(self.best, self.floor)


def trf(problem: Problem, start: FloatArray) -> tuple[float, int]:
    """Return χ² of SciPy's fit and its evaluations; infinite where SciPy gives up."""

    def residuals(x: FloatArray) -> FloatArray:
        return problem.residuals(x)[0]

    def jacobian(x: FloatArray) -> FloatArray:
        return problem.residuals(x)[1]

    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            found = optimize.least_squares(
                residuals,
                start,
                jac=jacobian,
                bounds=(problem.lower, problem.upper),
                x_scale="jac",
                ftol=2 * EPSILON,
                xtol=2 * EPSILON,
                gtol=2 * EPSILON,
                max_nfev=MAX_EVALUATIONS,
            )
        except (ValueError, np.linalg.LinAlgError):
            return np.inf, 0
    return 2 * float(found.cost), int(found.nfev)


def compared(problem: Problem) -> Compared | None:
    """Return both fits; None where the start is not finite."""
    try:
        fit = least_squares(
            problem.residuals, problem.start, lower=problem.lower, upper=problem.upper
        )
    except FitError:
        return None
    with np.errstate(all="ignore"):
        r = problem.residuals(np.clip(problem.start, problem.lower, problem.upper))[0]
    floor = ROUNDING * max(1.0, min(float(r @ r), 1e6))
    other, evaluations = trf(problem, problem.start)
    return Compared(problem, fit, other, evaluations, floor)


def is_at_minimum(result: Compared) -> bool:
    """Whether the fit is at a minimum of full rank, as far as its first derivatives tell."""
    fit = result.fit
    free = fit.jacobian[:, ~fit.at_bound]
    if not free.size:
        return True
    lengths = np.linalg.norm(free, axis=0)
    if not lengths.all() or np.linalg.matrix_rank(free / lengths) < free.shape[1]:
        return False
    cosines = np.abs(free.T @ fit.residuals) / lengths
    is_rounding = fit.chi2 <= result.floor
    return is_rounding or float(cosines.max()) < STATIONARY * float(np.linalg.norm(fit.residuals))
