"""Noise of pixels in pairs of frames whose numbers resolve it badly.

Two frames of the same light count how many pixels have the number i in the first and j in the
second. Of a pixel of level μ that count is expected in proportion to q_i(μ) q_j(μ + δ), with q the
probability of a number under normal noise s, and δ by how far the level wandered between the
frames. The variance alone is 0 to ¼ for the same small noise, by where the levels lie in a step:

- levels of pixels that spread over more than a step have all positions within it, and s follows
  from the variance (`labrig.reduce.unrounded_variance`);
- of others, centre and width of their normal distribution, δ and s are fitted to the counts by
  maximum likelihood. That levels which spread over a part of a step are normal is an assumption;
  another distribution has more or fewer pixels at the edges between numbers, which belongs to σ;
- where hardly a pixel changes its number, or the counts are unlike those expected, only a limit is
  stated that holds wherever the levels lie: more noise would change more numbers.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import chdtri, expit, ndtr

from labrig.foundation.arrays import FloatArray
from labrig.reduce import rounding_slope, unrounded_variance

#: Numbers on either side of the median that are counted.
HALF = 8
#: Noise in steps from which rounding adds 1/12 to its variance, wherever the level lies.
RESOLVED = 1.0
#: Width of the levels' distribution in steps from which all positions in a step are as frequent.
SPREAD = 0.6
#: Fraction of pixels of changed number below which only a limit is stated: the tail beyond 3 σ.
STILL = 4e-3
#: Relative σ above which, and χ² a degree of freedom from which, only a limit is stated.
VAGUE, UNLIKE = 0.3, 4.0
#: Probability with which noise is below the limit.
CONFIDENCE = 0.95

#: Noise in steps from which its variance does not depend on where the levels lie, to 0.2 %.
ANYWHERE = 0.6
#: Error of a likelihood's noise in its σ that all counts share: a centre in the middle of a step
#: and a width of 0 are ends of what is possible, and what chance moves them takes from the noise.
_TOGETHER = 0.4
#: Bounds of ln s, centre, ln width, δ in steps, and the logit of the fraction of outliers.
_BOUNDS = ((np.log(0.02), 0.5), (-1.5, 1.5), (np.log(0.005), 0.0), (-0.5, 0.5), (-16.0, -2.0))
#: σ of these parameters without any data, which keeps their information invertible.
_PRIOR = np.array([3.0, 0.5, 2.0, 0.2, 4.0])
#: Width of the levels' distribution in steps from which its shape matters, and σ of its first
#: harmonic over a step: 0.1 to 0.2 lie between normal, Laplace's and even distributions.
_WIDE, _SHAPE = 0.1, 0.15
#: Nodes of the distribution of levels in its width, and their weights.
_NODES = np.linspace(-4.5, 4.5, 121)[:, np.newaxis]
_WEIGHTS = np.exp(-np.square(_NODES) / 2) / np.exp(-np.square(_NODES) / 2).sum()
_NUMBER = np.arange(-HALF, HALF + 1)


@dataclass(frozen=True, eq=False)
class NumberCounts:
    """Numbers of the pixels of one position of the colour filter in two frames.

    Attributes
    ----------
    pairs
        Pixels by their number in the first and in the second frame, in steps from the median,
        shape (17, 17).
    differences
        Pixels by the difference of both numbers, −8 to 8 steps, shape (17,).
    lowest
        Place in `pairs` of the lowest number that the camera writes, at which all noise below it
        ends; None where no noise reaches it.
    """

    pairs: FloatArray
    differences: FloatArray
    lowest: int | None = None

    @classmethod
    def of(
        cls, first: NDArray[np.integer], second: NDArray[np.integer], step_dn: int, ends: bool
    ) -> "NumberCounts":
        """Count pixels of two frames, of equal shape, whose numbers are `step_dn` apart.

        `ends` states that noise below the lowest of the numbers is cut off.
        """
        numbers = np.stack([first.ravel(), second.ravel()]).astype(np.int64)
        numbers = (numbers - numbers.min()) // step_dn
        middle = int(np.median(numbers))
        i, j = numbers - middle + HALF
        side = 2 * HALF + 1
        inside = (i >= 0) & (j >= 0) & (i < side) & (j < side)
        difference = i - j + HALF
        difference = difference[(difference >= 0) & (difference < side)]
        return cls(
            np.bincount(i[inside] * side + j[inside], minlength=side**2)
            .reshape(side, side)
            .astype(np.float64),
            np.bincount(difference, minlength=side).astype(np.float64),
            HALF - middle if ends and middle <= HALF else None,
        )

    @property
    def moved(self) -> float:
        """Fraction of pixels whose number is not the same in both frames."""
        return float(1 - self.differences[HALF] / self.differences.sum())

    @property
    def spread(self) -> float:
        """Standard deviation in steps of the levels of pixels, by what both frames share."""
        pixels = self.pairs.sum()
        if pixels < self.differences.sum() / 2:
            return np.inf
        number = np.arange(-HALF, HALF + 1)
        first, second = self.pairs.sum(axis=1), self.pairs.sum(axis=0)
        product = number @ self.pairs @ number / pixels
        covariance = product - (first @ number) * (second @ number) / pixels**2
        return float(np.sqrt(max(covariance, 0.0)))


@dataclass(frozen=True)
class CountedNoise:
    """Noise of a pixel in steps; where `is_limit` it is below `value`."""

    value: float
    sigma: float
    is_limit: bool = False


def counted_noise(counts: Sequence[NumberCounts]) -> CountedNoise:
    """Return the noise of pixels that all counts have in common.

    Parameters
    ----------
    counts
        Counts of each position of the colour filter in each pair of frames.
    """
    estimates = [estimate for each in counts if (estimate := _estimate(each)) is not None]
    # Those that exceed a limit by chance are no sample of all.
    if 2 * len(estimates) <= len(counts):
        return CountedNoise(_limit(counts), 0.0, is_limit=True)
    log_s, sigma, together = np.array(
        [(each.log_s, each.log_sigma, each.log_together) for each in estimates]
    ).T
    weight = 1 / (np.square(sigma) + np.square(together))
    weight /= weight.sum()
    value = float(np.exp(weight @ log_s))
    relative = np.hypot(np.linalg.norm(weight * sigma), weight @ together)
    return CountedNoise(value, value * float(relative))


@dataclass(frozen=True)
class _Estimate:
    """ln of the noise, its σ by the number of pixels, and that which all counts share."""

    log_s: float
    log_sigma: float
    log_together: float = 0.0


def _estimate(counts: NumberCounts) -> _Estimate | None:
    """Return the noise of pixels; None where the counts set a limit only."""
    by_variance = _by_variance(counts)
    if counts.spread >= SPREAD or by_variance.log_s >= np.log(ANYWHERE):
        return by_variance
    return None if counts.moved < STILL else _by_likelihood(counts)


def _limit(counts: Sequence[NumberCounts]) -> float:
    """Return the most noise that changes no more numbers, nor any by more than one step."""
    ends = any(each.lowest is not None for each in counts)
    differences = np.sum([each.differences for each in counts], axis=0)
    noise = np.geomspace(0.02, 2.0, 200)
    level = np.linspace(0.0, 2.0 if ends else 1.0, 61)
    edges = np.arange(-HALF - 0.5, HALF + 1)
    if ends:
        edges[: HALF + 1] = -np.inf
    number = np.diff(ndtr((edges - level[:, np.newaxis]) / noise[:, np.newaxis, np.newaxis]))
    same = np.square(number).sum(axis=-1)
    next_to = 2 * (number[..., 1:] * number[..., :-1]).sum(axis=-1)
    limits = []
    for least, distance in ((1 - same, 1), (1 - same - next_to, 2)):
        changed = float(differences[np.abs(_NUMBER) >= distance].sum())
        most = chdtri(2 * (changed + 1), 1 - CONFIDENCE) / 2 / differences.sum()
        limits.append(float(np.interp(most, least.min(axis=1), noise)))
    return min(limits)


def _by_variance(counts: NumberCounts) -> _Estimate:
    """Return the noise of pixels that lie anywhere within a step."""
    pixels = counts.differences.sum()
    mean = _NUMBER @ counts.differences / pixels
    square = np.square(_NUMBER - mean) / 2
    variance = float(square @ counts.differences / pixels)
    scatter = float(np.square(square - variance) @ counts.differences / pixels)
    unrounded = max(float(unrounded_variance(np.array(variance))), 1e-6)
    slope = float(rounding_slope(np.array(unrounded)))
    relative = np.sqrt(scatter / pixels) / slope / unrounded
    return _Estimate(float(np.log(unrounded) / 2), float(relative / 2))


def _by_likelihood(counts: NumberCounts) -> _Estimate | None:
    """Return the noise of greatest likelihood; None where it is vague, or the counts are unlike."""
    used = np.flatnonzero(counts.pairs.sum(axis=0) + counts.pairs.sum(axis=1))
    near = np.arange(max(used[0] - 1, 0), min(used[-1] + 2, len(_NUMBER)))
    table = counts.pairs[np.ix_(near, near)]
    pixels = float(table.sum())
    edges = np.append(_NUMBER[near] - 0.5, _NUMBER[near[-1]] + 0.5)
    if counts.lowest is not None:
        edges[: np.searchsorted(near, counts.lowest) + 1] = -np.inf

    def probability(parameters: FloatArray) -> FloatArray:
        log_s, centre, log_width, wander, outliers = parameters
        level = centre + np.exp(log_width) * _NODES
        first, second = (
            np.diff(ndtr((edges - at) / np.exp(log_s)), axis=1) for at in (level, level + wander)
        )
        expected = (_WEIGHTS * first).T @ second
        fraction = expit(outliers)
        return np.asarray((1 - fraction) * expected / expected.sum() + fraction / expected.size)

    def misfit(parameters: FloatArray) -> float:
        return -float(np.sum(table * np.log(probability(parameters)))) / pixels

    centre = float(_NUMBER @ counts.pairs.sum(axis=1)) / pixels
    by_variance = np.clip(_by_variance(counts).log_s, np.log(0.05), np.log(1.2))
    width = np.log(np.clip(counts.spread, 0.02, SPREAD))
    fits = [
        minimize(
            misfit,
            (log_s, centre, log_width, 0.0, -9.0),
            method="L-BFGS-B",
            bounds=_BOUNDS,
            options={"ftol": 1e-12},
        )
        for log_s, log_width in ((by_variance, width), (np.log(0.2), np.log(0.05)))
    ]
    best = np.asarray(min(fits, key=lambda fit: fit.fun).x)
    expected = probability(best)
    slopes = np.array(
        [
            (probability(best + step) - probability(best - step)).ravel() / 2e-4
            for step in 1e-4 * np.eye(len(best))
        ]
    )
    information = pixels * (slopes / expected.ravel()) @ slopes.T
    covariance = np.linalg.inv(information + np.diag(1 / np.square(_PRIOR)))
    frequent = pixels * expected > 5
    residual = (table - pixels * expected)[frequent]
    dof = max(int(frequent.sum()) - len(best), 1)
    reduced = float(np.sum(np.square(residual) / (pixels * expected[frequent]))) / dof
    sigma = np.sqrt(covariance[0, 0] * max(reduced, 1.0))
    shape = _by_shape(float(np.exp(best[0]))) if np.exp(best[2]) > _WIDE else 0.0
    if reduced > UNLIKE or np.hypot(sigma, shape) > VAGUE:
        return None
    # All positions of the colour filter have levels of one shape.
    return _Estimate(float(best[0]), float(sigma), float(np.hypot(shape, _TOGETHER * sigma)))


def _by_shape(noise: float) -> float:
    """Return σ of ln s by the share of the levels that lies at the edges between numbers.

    The variance of rounded numbers depends on the level's position in a step by an amplitude of
    (1/π² + 4 s²) e^(−2π²s²) at most; of all levels together by as much of it as their distribution
    has of its first harmonic.
    """
    amplitude = (1 / np.pi**2 + 4 * noise**2) * np.exp(-2 * np.pi**2 * noise**2)
    return float(_SHAPE * amplitude / (2 * noise**2 * rounding_slope(np.array(noise**2))))
