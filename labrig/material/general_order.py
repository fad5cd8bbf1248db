"""One state of general kinetic order, in the dark and under constant light.

dr/dt = (1 − r) κ − k rᵇ with the order b ≥ 1 (C. E. May and J. A. Partridge, J. Chem. Phys. 40
(1964) 1401); b = 1 is eq. 1 of Nalbach et al., whose steps are in `rates`.

In the dark r(t) = r(0) (1 + u)^(−1/(b − 1)) with u = (b − 1) k r(0)^(b − 1) t. The light Λ k rᵇ is
−Λ dr/dt, so its mean over an exposure is Λ times the fall of r over its length: Becquerel's law,
`becquerel_of`.

Under light r approaches r∞, the root of κ (1 − r) = k rᵇ. With y = log((r∞ − r(0))/(r∞ − r)) the
equation is dy/dt = m, m = κ + k (r∞ᵇ − rᵇ)/(r∞ − r), which lies between its values at r(0) and
s = κ + b k r∞^(b − 1) at r∞. Therefore t = y/s + ∫ (1/m − 1/s) dy, whose integrand vanishes as
e^(−y): Gauss's rule and Newton's iteration give r(t) for any b. For b = 1 m is s, and there is
nothing to integrate.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from labrig.foundation.arrays import FloatArray
from labrig.material.decay_laws import SHORT_EXPOSURE, log_ratio

#: Gauss–Legendre nodes and weights on [0, 1] for the integral over y.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(32)
NODES, WEIGHTS = (_NODES + 1) / 2, _WEIGHTS / 2
#: Iterations of Newton's method, which converges from one side; it ends at this relative step.
ITERATIONS = 60
CONVERGED = 1e-13
#: Relative step after which the next would be rounding: Newton's method squares the error.
NEARLY_CONVERGED = 1e-8
#: Largest δ of which 1 − δ has a logarithm.
ALMOST_1 = 1 - 1e-16
#: δ below which derivatives of φ(δ) are series.
NEARLY_STEADY = 1e-5
#: Captures over the level that is left without light, up to which light changes nothing.
NEXT_TO_DARK = 1e-9
#: Least argument of a logarithm.
TINY = 1e-300


class BecquerelDecay(NamedTuple):
    """Becquerel's law of a state after one charge, for `DECAY_LAWS["becquerel"]`.

    Attributes
    ----------
    rate_per_s
        Relative fall of the light at lamp off, b k r(0)^(b − 1), in 1/s.
    shape
        1/p = (b − 1)/b.
    """

    rate_per_s: float
    shape: float


def becquerel_of(start: float, k_r_per_s: float, order: float) -> BecquerelDecay:
    """Return the law by which the light of a state decays in the dark.

    Parameters
    ----------
    start
        Concentration r(0) at lamp off, above 0 where the order is not 1.
    k_r_per_s
        Re-radiation rate k_r in 1/s.
    order
        Kinetic order b ≥ 1.

    Returns
    -------
    BecquerelDecay
        Rate and shape of Becquerel's law.

    Examples
    --------
    >>> from labrig.material import becquerel_of
    >>> becquerel_of(0.5, 0.02, 2.0)
    BecquerelDecay(rate_per_s=0.02, shape=0.5)
    """
    return BecquerelDecay(order * k_r_per_s * start ** (order - 1), (order - 1) / order)


def dark_concentration(
    start: ArrayLike, k_r_per_s: ArrayLike, order: ArrayLike, duration_s: ArrayLike
) -> FloatArray:
    """Return the concentration of a state of general order after darkness.

    r(t) = r(0) (1 + u)^(−1/(b − 1)), u = (b − 1) k r(0)^(b − 1) t, continuous in b: at b = 1 it is
    r(0) e^(−k t). All arguments broadcast.

    Parameters
    ----------
    start
        Concentration at lamp off, 0 to 1.
    k_r_per_s
        Re-radiation rate k ≥ 0 in 1/s.
    order
        Kinetic order b ≥ 1.
    duration_s
        Duration ≥ 0 in seconds.

    Returns
    -------
    ndarray
        Concentration at the end, in the broadcast shape.

    Examples
    --------
    >>> from labrig.material import dark_concentration
    >>> dark_concentration(0.5, 0.02, [1.0, 1.5, 2.0], 100.0).round(4).tolist()
    [0.0677, 0.1716, 0.25]
    """
    return dark_step(start, k_r_per_s, order, duration_s).value


class DarkStep(NamedTuple):
    """Concentration after darkness, or light emitted meanwhile, and derivatives.

    Attributes
    ----------
    value
        The quantity.
    by_start, by_k_r, by_order
        Derivatives by the concentration at the start, by k, in seconds, and by b.
    """

    value: FloatArray
    by_start: FloatArray
    by_k_r: FloatArray
    by_order: FloatArray


def dark_step(
    start: ArrayLike, k_r_per_s: ArrayLike, order: ArrayLike, duration_s: ArrayLike
) -> DarkStep:
    """Return the concentration of a state of general order after darkness, with derivatives.

    The arguments are those of `dark_concentration`; a small negative duration goes back in time.

    Parameters
    ----------
    start
        Concentration at lamp off, 0 to 1.
    k_r_per_s
        Re-radiation rate k ≥ 0 in 1/s.
    order
        Kinetic order b ≥ 1.
    duration_s
        Duration in seconds.

    Returns
    -------
    DarkStep
        Concentration at the end and its derivatives, each in the broadcast shape.

    Examples
    --------
    >>> from labrig.material import dark_step
    >>> after = dark_step(0.5, 0.02, 2.0, 100.0)
    >>> round(float(after.value), 4), round(float(after.by_start), 4)
    (0.25, 0.25)
    """
    level, k, b, t = (
        np.asarray(each, dtype=np.float64) for each in (start, k_r_per_s, order, duration_s)
    )
    beyond = b - 1
    power = level**beyond
    phase = k * power * t
    ratio, slope = log_ratio(beyond * phase)
    left = np.exp(-phase * ratio)
    after = level * left
    # −dr/dt is k rᵇ at the end as at the start, so that rᵇ over its first value is ∂r/∂r(0).
    by_start = left * np.exp(-beyond * phase * ratio)
    log_level = np.log(np.maximum(level, TINY))
    by_beyond = slope * phase * (1 + beyond * log_level) + ratio * log_level
    return DarkStep(after, by_start, -t * power * level * by_start, -after * phase * by_beyond)


def mean_emission(
    start: ArrayLike, k_r_per_s: ArrayLike, order: ArrayLike, exposure_s: ArrayLike
) -> DarkStep:
    """Return the mean of rᵇ over an exposure in the dark, with derivatives.

    It is the fall of r over k T, and the light of the state over Λ k.

    Parameters
    ----------
    start
        Concentration at the start of the exposure, 0 to 1.
    k_r_per_s
        Re-radiation rate k > 0 in 1/s.
    order
        Kinetic order b ≥ 1.
    exposure_s
        Length T ≥ 0 of the exposure in seconds.

    Returns
    -------
    DarkStep
        Mean of rᵇ and its derivatives, each in the broadcast shape.

    Examples
    --------
    >>> from labrig.material import mean_emission
    >>> mean_emission(0.5, 0.02, 1.5, [0.0, 1.0, 50.0]).value.round(4).tolist()
    [0.3536, 0.3498, 0.2271]
    """
    r, k, b, exposure = np.broadcast_arrays(
        *(np.asarray(each, dtype=np.float64) for each in (start, k_r_per_s, order, exposure_s))
    )
    # The difference of levels has no digits over a short exposure: there its middle is the mean.
    is_short = k * r ** (b - 1) * exposure < SHORT_EXPOSURE
    at = dark_step(r, k, b, np.where(is_short, exposure / 2, exposure))
    bright = at.value ** (b - 1)
    middle = (
        at.value * bright,
        b * bright * at.by_start,
        b * bright * at.by_k_r,
        bright * (b * at.by_order + at.value * np.log(np.maximum(at.value, TINY))),
    )
    length = np.where(is_short, 1.0, k * exposure)
    fall = (r - at.value) / length
    whole = (
        fall,
        (1 - at.by_start) / length,
        -at.by_k_r / length - fall / k,
        -at.by_order / length,
    )
    return DarkStep(*(np.where(is_short, *pair) for pair in zip(middle, whole, strict=True)))


def steady_concentration(
    kappa_per_s: ArrayLike, k_r_per_s: ArrayLike, order: ArrayLike
) -> FloatArray:
    """Return the concentration r∞ that a state of general order approaches under constant light.

    Parameters
    ----------
    kappa_per_s, k_r_per_s
        Excitation κ > 0 and re-radiation rate k ≥ 0 in 1/s; they broadcast with the order.
    order
        Kinetic order b ≥ 1.

    Returns
    -------
    ndarray
        The root of κ (1 − r) = k rᵇ, above 0 and up to 1, in the broadcast shape.

    Examples
    --------
    >>> from labrig.material import steady_concentration
    >>> steady_concentration(0.01, 0.02, [1.0, 2.0]).round(4).tolist()
    [0.3333, 0.5]
    """
    kappa, k, b = np.broadcast_arrays(
        *(np.asarray(each, dtype=np.float64) for each in (kappa_per_s, k_r_per_s, order))
    )
    # Right of the root, from where Newton's iteration of a concave function falls towards it.
    level = np.minimum(1.0, (kappa / np.maximum(k, TINY)) ** (1 / b))
    for _ in range(ITERATIONS):
        growth = kappa * (1 - level) - k * level**b
        step = growth / (kappa + b * k * level ** (b - 1))
        level = level + step
        if np.all(np.abs(step) <= CONVERGED * level):
            break
    return np.asarray(level)


def lit_concentration(
    start: ArrayLike,
    kappa_per_s: ArrayLike,
    k_r_per_s: ArrayLike,
    order: ArrayLike,
    duration_s: ArrayLike,
) -> FloatArray:
    """Return the concentration of a state of general order after constant light.

    All arguments broadcast.

    Parameters
    ----------
    start
        Concentration at the start, 0 to 1.
    kappa_per_s, k_r_per_s
        Excitation κ > 0 and re-radiation rate k ≥ 0 in 1/s.
    order
        Kinetic order b ≥ 1.
    duration_s
        Duration ≥ 0 in seconds.

    Returns
    -------
    ndarray
        Concentration at the end in the broadcast shape.

    Examples
    --------
    >>> from labrig.material import lit_concentration
    >>> lit_concentration(0.0, 0.01, 0.02, [1.0, 1.5, 2.0], 60.0).round(4).tolist()
    [0.2782, 0.3456, 0.3855]
    """
    approach, t = _approach(start, kappa_per_s, k_r_per_s, order, duration_s)
    level = approach.level(approach.position(t))
    # The approach to a steady level is lost in rounding where next to nothing is captured.
    filled = np.asarray(start, dtype=np.float64)
    dark = dark_concentration(np.where(filled > 0, filled, 1.0), k_r_per_s, order, duration_s)
    is_faint = np.asarray(kappa_per_s) * np.asarray(duration_s) < NEXT_TO_DARK * dark
    return np.where(is_faint & (filled > 0), dark, level)


class LitStep(NamedTuple):
    """Concentration after constant light, and its derivatives.

    Attributes
    ----------
    value
        Concentration at the end.
    by_start
        Derivative by the concentration at the start.
    by_kappa, by_k_r, by_order
        Derivatives by κ and k, in seconds, and by b.
    """

    value: FloatArray
    by_start: FloatArray
    by_kappa: FloatArray
    by_k_r: FloatArray
    by_order: FloatArray


def lit_step(
    start: ArrayLike,
    kappa_per_s: ArrayLike,
    k_r_per_s: ArrayLike,
    order: ArrayLike,
    duration_s: ArrayLike,
) -> LitStep:
    """Return `lit_concentration` and its derivatives.

    Parameters
    ----------
    start, kappa_per_s, k_r_per_s, order, duration_s
        As for `lit_concentration`.

    Returns
    -------
    LitStep
        Concentration at the end and its derivatives, each in the broadcast shape.

    Examples
    --------
    >>> from labrig.material import lit_step
    >>> step = lit_step(0.2, 0.01, 0.02, 2.0, 60.0)
    >>> f"{step.value:.3f}, {step.by_start:.3f} of what there was"
    '0.440, 0.238 of what there was'
    """
    approach, t = _approach(start, kappa_per_s, k_r_per_s, order, duration_s)
    kappa, b, steady = approach.kappa, approach.order, approach.steady
    k = np.asarray(k_r_per_s, dtype=np.float64)
    y = approach.position(t)
    value = approach.level(y)
    # r = r∞ − (r∞ − r(0)) e^(−y) depends on a parameter by r∞ and, at a given time, by y.
    to_steady = kappa + b * k * steady ** (b - 1)
    power = steady**b
    steady_by = (
        (1 - steady) / to_steady,
        -power / to_steady,
        -k * power * np.log(steady) / to_steady,
    )
    by_steady, by_order = approach.time_slopes(y)
    time_by = (
        -t / kappa + by_steady * steady_by[0],
        by_steady * steady_by[1],
        by_steady * steady_by[2] + by_order,
    )
    speed = approach.speed(y)
    # The equation is autonomous: ∂r/∂r(0) is dr/dt at the end over that at the start.
    by_start = np.exp(-y) * speed / approach.speed(np.zeros_like(y))
    slopes = (
        -np.expm1(-y) * steady_slope - (steady - value) * speed * time_slope
        for steady_slope, time_slope in zip(steady_by, time_by, strict=True)
    )
    return LitStep(value, by_start, *slopes)


def _approach(*arguments: ArrayLike) -> tuple["_Approach", FloatArray]:
    """Return the approach of r∞ from a start by κ, k and b, and the times; all broadcast."""
    first, kappa, k, b, t = np.broadcast_arrays(
        *(np.asarray(each, dtype=np.float64) for each in arguments)
    )
    return _Approach(first, kappa, b, steady_concentration(kappa, k, b)), t


def _phi(delta: FloatArray, order: FloatArray) -> FloatArray:
    """Return φ(δ) = (1 − (1 − δ)ᵇ)/δ for δ ≤ 1; b at 0."""
    safe = np.where(np.abs(delta) < TINY, TINY, delta)
    # At δ = 1, an empty state, (1 − δ)ᵇ vanishes.
    value: FloatArray = -np.expm1(order * np.log1p(-np.minimum(safe, ALMOST_1))) / safe
    return value


class _PhiSlopes(NamedTuple):
    """Derivatives of φ by δ and b."""

    by_delta: FloatArray
    by_order: FloatArray


def _phi_slopes(delta: FloatArray, order: FloatArray, phi: FloatArray) -> _PhiSlopes:
    small = np.abs(delta) < NEARLY_STEADY
    safe = np.where(small, NEARLY_STEADY, delta)
    log_left = np.log1p(-np.minimum(safe, ALMOST_1))
    power = np.exp((order - 1) * log_left)
    curvature = order * (order - 1) / 2
    return _PhiSlopes(
        np.where(
            small, curvature * (2 * (order - 2) / 3 * delta - 1), (order * power - phi) / safe
        ),
        np.where(small, 1 - (order - 0.5) * delta, (safe - 1) * power * log_left / safe),
    )


@dataclass(frozen=True)
class _Approach:
    """Approach of r∞ by y, with m = κ + c φ(δ), c = κ (1/r∞ − 1) and δ = (1 − r(0)/r∞) e^(−y).

    All attributes have the same shape.
    """

    start: FloatArray
    kappa: FloatArray
    order: FloatArray
    steady: FloatArray

    @cached_property
    def filling(self) -> FloatArray:
        """The factor c = k r∞^(b − 1)."""
        return self.kappa * (1 / self.steady - 1)

    @cached_property
    def final_speed(self) -> FloatArray:
        """The limit s of m."""
        return self.kappa + self.filling * self.order

    @cached_property
    def _part_missing(self) -> FloatArray:
        """δ at the start."""
        return 1 - self.start / self.steady

    def speed(self, y: FloatArray) -> FloatArray:
        """Return m = dy/dt."""
        delta = self._part_missing * np.exp(-y)
        return self.kappa + self.filling * _phi(delta, self.order)

    def level(self, y: FloatArray) -> FloatArray:
        """Return the concentration r."""
        level: FloatArray = self.steady - (self.steady - self.start) * np.exp(-y)
        return level

    def position(self, t: FloatArray) -> FloatArray:
        """Return y at a time."""
        y = self.speed(np.zeros_like(t)) * t
        log_t = np.log(np.maximum(t, TINY))
        for _ in range(ITERATIONS):
            # In log t: y is a straight line of it in the dark, of which weak light is a limit.
            time = self._time(y)
            step = time * (log_t - np.log(np.maximum(time, TINY))) * self.speed(y)
            y = np.maximum(y + step, y / 10)
            if np.all(np.abs(step) <= NEARLY_CONVERGED * y):
                break
        return y

    def _time(self, y: FloatArray) -> FloatArray:
        """Return t = y/s + ∫ (1/m − 1/s) dy."""
        decay, weights = self._nodes(y)
        m = self.kappa + self.filling * _phi(self._part_missing * decay, self.order)
        slower: FloatArray = ((1 / m - 1 / self.final_speed) * weights).sum(axis=0)
        return y / self.final_speed + slower

    def time_slopes(self, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return ∂t/∂r∞ and ∂t/∂b at a given y and κ, to which −t/κ belongs at given r∞ and b."""
        decay, weights = self._nodes(y)
        delta = self._part_missing * decay
        phi = _phi(delta, self.order)
        slopes = _phi_slopes(delta, self.order, phi)
        m2, s2 = (self.kappa + self.filling * phi) ** 2, self.final_speed**2
        per_steady = self.kappa / self.steady**2
        m_by_steady = slopes.by_delta * decay * self.filling * self.start / self.steady**2
        m_by_steady -= per_steady * phi
        s_by_steady = -per_steady * self.order
        by_steady = y * s_by_steady / s2
        by_steady = by_steady + ((m_by_steady / m2 - s_by_steady / s2) * weights).sum(axis=0)
        by_order = y / s2 + ((slopes.by_order / m2 - 1 / s2) * weights).sum(axis=0)
        return -by_steady, -self.filling * by_order

    def _nodes(self, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return e^(−y) and weights of the nodes up to y, in the first axis.

        The nodes lie evenly in 1 − e^(−y/n): the integrand is of the order of 1 up to
        y = log(r(0)/r∞) and vanishes as e^(−y) from there.
        """
        n = 1 + np.log(np.maximum(self.start / self.steady, 1.0))
        whole = -np.expm1(-y / n)
        covered = np.multiply.outer(NODES, whole)
        return np.exp(n * np.log1p(-covered)), np.multiply.outer(WEIGHTS, whole * n) / (1 - covered)
