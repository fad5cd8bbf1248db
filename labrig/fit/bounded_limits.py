"""Limits of a parameter near a bound, such as a kinetic order near 1, with their full probability.

Δχ² = 1 and 3.84 give 68 and 95 % where the estimate may lie on either side of the truth. Near a
bound it may not, and they would give more: 84 and 97.5 % if the truth is at the bound. Values are
therefore ranked by their likelihood over that of the best possible value, and kept if that rank has
the probability: the unified approach of G. J. Feldman and R. D. Cousins (Phys. Rev. D 57, 1998,
3873), for a normal estimate x of a parameter μ ≥ 0, in σ. In it Δχ² ≤ c(μ), with

    Φ(√c) − Φ(−√c) = P                   where √c ≤ μ,
    Φ(√c) − Φ(−(μ² + c)/(2 μ)) = P       nearer to the bound.
"""

from collections.abc import Callable
from functools import lru_cache

from scipy.special import ndtr, ndtri

#: Distance from the bound below which the threshold is that at the bound, and relative precision.
AT_BOUND, PRECISION = 1e-6, 1e-8


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

    return float(brentq(function, low, high, rtol=PRECISION))
