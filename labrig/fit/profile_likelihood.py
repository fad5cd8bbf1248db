"""Intervals by the profile of the likelihood.

The profile of a quantity is the least χ² at each of its values, all other parameters fitted anew. A
limit is where it exceeds the minimum by 1 (68.3 %) or 3.84 (95 %); where the scale of the noise was
told by ν degrees of freedom, by the squared quantile of Student's t, which is the F-test's. Unlike
±σ, such limits do not depend on how the model is parametrised (D. M. Bates and D. G. Watts,
*Nonlinear Regression Analysis and Its Applications*, 1988, ch. 6; D. J. Venzon and S. H.
Moolgavkar, Appl. Statist. 37, 1988, 87).

A point of the profile is the minimum of χ² + w² (g − g₀)²: it lies on the profile exactly, at a
value of the quantity g near g₀, whatever the weight w. √Δχ² is nearly linear along the profile, so
that a limit is met after few points.

Δχ² = 1 and 3.84 give 68 and 95 % where the estimate may lie on either side of the truth. Near a
bound it may not, and they would give more: 84 and 97.5 % if the truth is at the bound. Values are
therefore ranked by their likelihood over that of the best possible value, and kept if that rank has
the probability: the unified approach of G. J. Feldman and R. D. Cousins (Phys. Rev. D 57, 1998,
3873), for a normal estimate x of a parameter μ ≥ 0, in σ. In it Δχ² ≤ c(μ), with

    Φ(√c) − Φ(−√c) = P                   where √c ≤ μ,
    Φ(√c) − Φ(−(μ² + c)/(2 μ)) = P       nearer to the bound.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri, stdtrit

from labrig.fit.nonlinear_least_squares import (
    LeastSquaresFit,
    Residuals,
    least_squares,
    parameter_covariance,
)
from labrig.foundation.arrays import FloatArray
from labrig.results import ASYMMETRIC, NORMAL_95, ProfileInterval

#: Distance from the bound below which the threshold is that at the bound, and relative precision.
AT_BOUND, ROOT_PRECISION = 1e-6, 1e-8


def toward_bound(distance: float, sigmas: float) -> float | None:
    """Return the root of Δχ² at the limit between an estimate and the bound below it.

    Parameters
    ----------
    distance
        Root of Δχ² at the bound, ≥ 0.
    sigmas
        Root of Δχ² at a limit of the same probability far from bounds, > 0.

    Returns
    -------
    float or None
        The root; None if the interval reaches the bound.
    """
    if distance >= 2 * sigmas:
        return sigmas
    if distance <= _threshold(0.0, sigmas):
        return None
    return _root(
        lambda root: root - _threshold(distance - root, sigmas), 0.0, min(sigmas, distance)
    )


def away_from_bound(pull: float, sigmas: float) -> float:
    """Return the root of Δχ² at the limit of an estimate that a bound holds.

    Parameters
    ----------
    pull
        Distance in σ by which the unbounded estimate would be beyond the bound, ≥ 0.
    sigmas
        Root of Δχ² at a limit of the same probability far from bounds, > 0.
    """
    if pull <= AT_BOUND:
        return sigmas

    def excess(mu: float) -> float:
        return mu * mu + 2 * mu * pull - _threshold(mu, sigmas) ** 2

    return _threshold(_root(excess, 0.0, sigmas), sigmas)


@lru_cache(maxsize=1024)
def _threshold(mu: float, sigmas: float) -> float:
    """Return √c(μ) of a probability, that within so many σ of a normal distribution."""
    if mu >= sigmas:
        return sigmas
    probability = float(ndtr(sigmas) - ndtr(-sigmas))
    at_bound = float(ndtri(probability))
    if mu < AT_BOUND:
        return at_bound

    def excess(root: float) -> float:
        return float(ndtr(root) - ndtr(-(mu * mu + root * root) / (2 * mu))) - probability

    return _root(excess, at_bound, sigmas)


def _root(function: Callable[[float], float], low: float, high: float) -> float:
    # Not above: it takes long to load.
    from scipy.optimize import brentq

    return float(brentq(function, low, high, rtol=ROOT_PRECISION))


#: Parameters (p,) → value of a quantity, and its derivatives (p,).
Value = Callable[[FloatArray], tuple[float, FloatArray]]

#: Probabilities of the two intervals: within 1 and 1.96 σ of a normal distribution.
PROBABILITIES = (math.erf(math.sqrt(0.5)), 0.95)
SIGMAS = (1.0, NORMAL_95)
#: Weight of a quantity's distance from its target, in units of 1/σ².
STIFFNESS = 30.0
#: Steps of a search for a limit, relative precision of √Δχ² at its end, largest ratio of a step to
#: the way made so far, and part of that way by which a step aims beyond.
MAX_POINTS, PRECISION, MAX_STEP, BEYOND = 25, 3e-3, 2.0, 0.03
#: Relative step and gain in χ² at which a point of the profile is near enough, and its evaluations.
TOLERANCE, MIN_GAIN, MAX_ITERATIONS = 1e-4, 1e-4, 200
#: Part of a quantity's σ within which it is at the end of its range, and of a step below which a
#: parameter's bound has stopped it.
AT_END, STOPPED = 0.01, 0.1
#: Largest σ that a search goes by, as a part of the range searched.
PART_OF_RANGE = 0.2
#: Largest number with an exponential.
MAX_LOG = 700.0
#: Gain in χ² over the fit from which it was not at the minimum.
LOWER_MINIMUM = 0.01


@dataclass(frozen=True)
class Quantity:
    """A quantity whose likelihood is profiled: a parameter, or a function of parameters.

    Attributes
    ----------
    value
        Function of the parameters (p,) that returns the quantity and its derivatives (p,).
    least, largest
        Range of possible values.
    searched
        Range in which limits are sought; a limit beyond is that of all possible values.
    not_above, not_below
        Numbers of parameters that may not exceed the quantity, or fall below it: states keep their
        order.
    """

    value: Value
    least: float = -math.inf
    largest: float = math.inf
    searched: tuple[float, float] = (-math.inf, math.inf)
    not_above: tuple[int, ...] = ()
    not_below: tuple[int, ...] = ()


def exponential(value: float) -> float:
    """Return e^x, infinite beyond what a number holds."""
    return math.exp(value) if value < MAX_LOG else math.inf


def parameter(number: int) -> Value:
    """Return a parameter as a quantity's value."""

    def value(x: FloatArray) -> tuple[float, FloatArray]:
        gradient = np.zeros(len(x))
        gradient[number] = 1.0
        return float(x[number]), gradient

    return value


@dataclass(frozen=True)
class NoiseScale:
    """Scale of the noise in whitened residuals.

    Attributes
    ----------
    variance
        Variance of a quantity over that by the curvature of χ², ≥ 0: what else is in its σ.
    dof
        Degrees of freedom that told the scale; infinite where σ is known.
    """

    variance: float = 1.0
    dof: float = math.inf

    @property
    def factors(self) -> tuple[float, float]:
        """Root of Δχ² at the limits over 1 and 1.96."""
        return tuple(  # type: ignore[return-value]
            math.sqrt(self.variance) * self._quantile(probability) / sigmas
            for probability, sigmas in zip(PROBABILITIES, SIGMAS, strict=True)
        )

    def _quantile(self, probability: float) -> float:
        if math.isinf(self.dof):
            return SIGMAS[PROBABILITIES.index(probability)]
        return float(stdtrit(max(self.dof, 1.0), (1 + probability) / 2))


@dataclass(frozen=True, eq=False)
class _Point:
    """A point of the profile: where the quantity was pulled to and is, √Δχ², and the parameters."""

    target: float
    value: float
    root: float
    x: FloatArray


@dataclass(frozen=True)
class Likelihood:
    """Whitened residuals within bounds, at their minimum.

    Attributes
    ----------
    residuals
        Function of the parameters (p,) that returns residuals (m,) and Jacobian (m, p).
    fit
        The minimum.
    lower, upper
        Bounds of the parameters, shape (p,).
    """

    residuals: Residuals
    fit: LeastSquaresFit
    lower: FloatArray
    upper: FloatArray

    @classmethod
    def at_minimum(
        cls, residuals: Residuals, near: FloatArray, lower: FloatArray, upper: FloatArray
    ) -> "Likelihood":
        """Return the likelihood at the minimum next to parameters (p,)."""
        fit = least_squares(
            residuals, near, lower=lower, upper=upper, max_iterations=MAX_ITERATIONS, tolerance=1e-8
        )
        return cls(residuals, fit, lower, upper)

    def interval(self, quantity: Quantity, noise: NoiseScale | None = None) -> ProfileInterval:
        """Return the limits of a quantity at 68 and 95 %.

        Parameters
        ----------
        quantity
            The quantity.
        noise
            Scale of the noise; by default that of the residuals' unit.

        Raises
        ------
        LowerMinimumError
            The profile falls below the minimum: there is a better fit.
        """
        ends = [_Way(self, quantity, side, noise or NoiseScale()).limits() for side in (-1.0, 1.0)]
        (low_68, low_95), (high_68, high_95) = ends
        value, _ = quantity.value(self.fit.parameters)
        return ProfileInterval(
            value, low_68, high_68, low_95, high_95, quantity.least, quantity.largest
        )

    def sigma(self, quantity: Quantity) -> float:
        """Return σ of a quantity by the curvature; NaN where it is not determined."""
        _, gradient = quantity.value(self.fit.parameters)
        variance = float(gradient @ self.direction(gradient))
        return math.sqrt(variance) if 0 < variance < math.inf else math.nan

    def direction(self, gradient: FloatArray) -> FloatArray:
        """Return the covariance times a gradient (p,): the way of the profile from the minimum.

        Parameters at a bound stay there, unless they are part of the gradient.
        """
        free, involved = self._free(gradient), gradient != 0
        direction = np.zeros(len(gradient))
        if free.all():
            covariance = self.fit.covariance
        else:
            covariance, _ = parameter_covariance(self.fit.jacobian[:, free])
        direction[free] = covariance[:, involved[free]] @ gradient[involved]
        return direction

    def way(self, gradient: FloatArray) -> FloatArray:
        """Return the change (p,) of the parameters along the profile by that of a quantity.

        It is 0 where the quantity is not determined.
        """
        direction = self.direction(gradient)
        variance = float(gradient @ direction)
        if not 0 < variance < math.inf:
            return np.zeros(len(gradient))
        return direction / variance

    def _free(self, gradient: FloatArray) -> NDArray[np.bool_]:
        """Return which parameters are not at a bound, or part of a gradient, (p,)."""
        return np.asarray(~self.fit.at_bound | (gradient != 0))

    def is_asymmetric(
        self, quantity: Quantity, shown: Callable[[float], float], stated_sigma: float | None = None
    ) -> bool:
        """Return whether the limits that two points imply differ by more than 20 %.

        Each point is one σ from the minimum; the other parameters follow by one step with the
        slopes of the minimum. The root of its Δχ² is 1 for a linear model, and implies the limit.

        Parameters
        ----------
        quantity
            The quantity.
        shown
            Monotone function of the quantity that is reported with σ.
        stated_sigma
            Its σ as reported, where it is another than that by the curvature within bounds.
        """
        value, gradient = quantity.value(self.fit.parameters)
        sigma = self.sigma(quantity)
        if not sigma > 0:
            return True
        step = self.direction(gradient) / sigma
        along = self.fit.jacobian @ step
        basis = np.linalg.qr(self.fit.jacobian[:, self._free(gradient)])[0]
        distances = []
        for side in (-1.0, 1.0):
            x = self.fit.parameters + side * step
            if (x < self.lower).any() or (x > self.upper).any():
                if not quantity.least < value + side * sigma < quantity.largest:
                    return True
                x = np.clip(x, self.lower, self.upper)
            with np.errstate(all="ignore"):
                residuals, _ = self.residuals(x)
                moved, _ = quantity.value(x)
            if not np.isfinite(residuals).all():
                return True
            others = basis.T @ residuals
            chi2 = residuals @ residuals - others @ others + (along @ residuals) ** 2
            root = math.sqrt(max(float(chi2 - self.fit.chi2), 1e-12))
            implied = value + (moved - value) / root
            distances.append(abs(shown(implied) - shown(value)))
        slope = (shown(value + AT_END * sigma) - shown(value - AT_END * sigma)) / (2 * AT_END)
        distances.append(abs(slope) if stated_sigma is None else stated_sigma)
        return not max(distances) < ASYMMETRIC * min(distances)


class LowerMinimumError(Exception):
    """A profile falls below the minimum that it starts from."""


@dataclass(frozen=True)
class _Way:
    """Profile of a quantity on one side of the minimum, `side` being −1 or 1."""

    likelihood: Likelihood
    quantity: Quantity
    side: float
    noise: NoiseScale

    def limits(self) -> tuple[float, float]:
        """Return the limits at 68 and 95 %."""
        quantity, fit, side = self.quantity, self.likelihood.fit, self.side
        bound = quantity.largest if side > 0 else quantity.least
        end = quantity.searched[1 if side > 0 else 0]
        end = min(end, quantity.largest) if side > 0 else max(end, quantity.least)
        value, _ = quantity.value(fit.parameters)
        sigma = self._sigma
        points = [_Point(value, value, 0.0, fit.parameters)]
        limits = []
        for sigmas, factor in zip(SIGMAS, self.noise.factors, strict=True):
            root = self._root(points, end, sigmas, factor)
            if root is None or side * (end - value) <= AT_END * sigma:
                limits.append(bound)
                continue
            limit = self._search(points, end, root)
            limits.append(bound if limit is None else limit)
        return limits[0], limits[1]

    @cached_property
    def _sigma(self) -> float:
        """σ of the quantity; on a plateau, where it has none, a part of the range searched."""
        sigma = self.likelihood.sigma(self.quantity)
        low, high = self.quantity.searched
        largest = PART_OF_RANGE * (high - low)
        if math.isinf(largest):
            value, _ = self.quantity.value(self.likelihood.fit.parameters)
            largest = math.inf if sigma > 0 else max(abs(value), 1.0)
        return min(sigma, largest) if sigma > 0 else largest

    def _root(self, points: list[_Point], end: float, sigmas: float, factor: float) -> float | None:
        """Return the root of Δχ² at a limit, less near a bound; None if the bound is within."""
        quantity, fit = self.quantity, self.likelihood.fit
        value, gradient = quantity.value(fit.parameters)
        sigma, least, largest = self._sigma, quantity.least, quantity.largest
        unit = self.side * sigma
        other_end = least if self.side > 0 else largest
        if abs(value - other_end) <= AT_END * sigma:
            # The bound holds the estimate: how hard χ² pulls it there tells how far it would go.
            step = unit * self.likelihood.way(gradient)
            pull = max(float(fit.residuals @ (fit.jacobian @ step)), 0.0)
            return factor * away_from_bound(pull / factor, sigmas)
        is_bound = end in (least, largest)
        if not is_bound or abs(end - value) > 2 * sigmas * factor * sigma * MAX_STEP:
            return factor * sigmas
        at_end = next((point for point in points if point.target == end), None)
        if at_end is None:
            at_end = self._point(end, max(points, key=lambda point: self.side * point.target))
            points.append(at_end)
        toward = toward_bound(at_end.root / factor, sigmas)
        return None if toward is None else factor * toward

    def _search(self, points: list[_Point], end: float, root: float) -> float | None:
        """Return the value at which the profile reaches a root of Δχ²; None if it does not."""
        # Not above: it takes long to load.
        from scipy.optimize import brentq

        if not self._reaches(points, end, root):
            return None
        points.sort(key=lambda point: self.side * point.target)
        beyond = next(k for k, point in enumerate(points) if point.root >= root)
        below, above = points[beyond - 1], points[beyond]
        between = {point.target: point for point in (below, above)}

        def excess(target: float) -> float:
            if target not in between:
                near = min(between.values(), key=lambda point: abs(point.target - target))
                between[target] = self._point(target, near)
            off = between[target].root - root
            return 0.0 if abs(off) <= PRECISION * root else off

        # Where a profile jumps from one minimum to another, its two sides are near enough.
        width = abs(above.target - below.target)
        brentq(excess, below.target, above.target, xtol=PRECISION * width, disp=False)
        # Between the two nearest points, √Δχ² is a straight line.
        by_root = sorted(between.values(), key=lambda point: point.root)
        beyond = next(k for k, point in enumerate(by_root) if point.root >= root)
        below, above = by_root[beyond - 1], by_root[beyond]
        part = (root - below.root) / (above.root - below.root)
        points += [point for point in by_root if point not in points]
        return below.value + part * (above.value - below.value)

    def _reaches(self, points: list[_Point], end: float, root: float) -> bool:
        """Return whether the profile reaches a root of Δχ², after points on the way there."""
        lengthened = 1.0
        for _ in range(MAX_POINTS):
            last = max(points, key=lambda point: self.side * point.target)
            if max(point.root for point in points) >= root:
                return True
            way, wanted = self.side * (last.target - points[0].target), root * self._sigma
            if last.root > 0:
                wanted = way * min(lengthened * (root / last.root - 1) + BEYOND, MAX_STEP)
            step = min(wanted, self.side * (end - last.target))
            if step < AT_END * min(wanted, self._sigma):
                return False
            new = self._point(last.target + self.side * step, last)
            points.append(new)
            # A value that a parameter's bound stops moves no further.
            if not self.side * (new.value - last.value) > STOPPED * step:
                return new.root >= root
            lengthened *= MAX_STEP
        return False

    def _point(self, target: float, near: _Point) -> _Point:
        """Return a point of the profile near a target."""
        likelihood, quantity, sigma = self.likelihood, self.quantity, self._sigma
        weight = STIFFNESS / sigma

        def pulled(x: FloatArray) -> tuple[FloatArray, FloatArray]:
            residuals, jacobian = likelihood.residuals(x)
            value, gradient = quantity.value(x)
            return (
                np.append(residuals, weight * (value - target)),
                np.vstack([jacobian, weight * gradient]),
            )

        lower, upper = likelihood.lower.copy(), likelihood.upper.copy()
        not_above, not_below = list(quantity.not_above), list(quantity.not_below)
        upper[not_above] = np.maximum(np.minimum(upper[not_above], target), lower[not_above])
        lower[not_below] = np.minimum(np.maximum(lower[not_below], target), upper[not_below])
        _, gradient = quantity.value(near.x)
        start = near.x + (target - near.value) * likelihood.way(gradient)
        with np.errstate(all="ignore"):
            residuals, jacobian = pulled(np.clip(start, lower, upper))
            if not (np.isfinite(residuals).all() and np.isfinite(jacobian).all()):
                start = near.x
        fit = least_squares(
            pulled,
            start,
            lower=lower,
            upper=upper,
            max_iterations=MAX_ITERATIONS,
            tolerance=TOLERANCE,
            least_gain=MIN_GAIN,
        )
        chi2 = fit.chi2 - float(fit.residuals[-1]) ** 2
        delta = chi2 - likelihood.fit.chi2
        if delta < -LOWER_MINIMUM:
            raise LowerMinimumError
        value, _ = quantity.value(fit.parameters)
        return _Point(target, value, math.sqrt(max(delta, 0.0)), fit.parameters)
