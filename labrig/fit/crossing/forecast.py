"""Time at which a decay falls to a level beyond its record: a range of 95 %, and an earliest time.

Draws come from the posteriors of several laws, from which the decay departs as a random walk of its
slope; laws and the walk's step are weighed by how well a fit of the first part of the record
predicts its later part. No record foretells all that begins after it, such as the end of a trap
that was hidden: a part of the draws takes the laws alike, with the largest step.
"""

import math

import numpy as np

from labrig.fit.crossing.bound import earliest_crossing, growing_rate
from labrig.fit.crossing.candidates import candidates
from labrig.fit.crossing.posterior import WALKS, Posterior, posteriors
from labrig.fit.crossing.readings import LogDecay, reading_sigma
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from labrig.results import NORMAL_95, ForecastTime

#: Part of the draws of what the record does not foretell.
UNFORESEEN = 0.15
#: Number of draws, and least weight of a law that is drawn from.
N_DRAWS, LEAST_WEIGHT = 2000, 2e-3
#: Probability on each side of the range.
OUTSIDE = 0.025
#: Ratio of its ends from which a time is not determined.
NOT_DETERMINED = 10.0
#: ln(t/T) before and after the end T up to which laws are followed, and numbers of times.
BEFORE, N_BEFORE = 0.7, 8
AFTER, N_AFTER = math.log(300.0), 101
#: Factors of the slope at the end that a law's later slope is taken as, least and largest.
SLOPES = (0.2, 5.0)
SEED = 20_260


def forecast_crossing(
    t_s: FloatArray,
    light: FloatArray,
    sigma: FloatArray | None,
    level: float,
    level_sigma: float,
) -> ForecastTime:
    """Forecast the time at which a decay falls to a level.

    Parameters
    ----------
    t_s, light
        Readings at rising times > 0 in seconds, eight or more, or five with σ, shape (n,).
    sigma
        σ of the readings, shape (n,); None takes their scatter.
    level, level_sigma
        The level, and σ of its logarithm: that of what all readings have in common.

    Returns
    -------
    ForecastTime
        The range, the earliest time and the weights of the laws.

    Raises
    ------
    FitError
        Hardly any reading is above its noise, or the decay is cut off more sharply than by an
        exponential.
    """
    sigma = reading_sigma(t_s, light, sigma)
    decay = LogDecay.of(t_s, light, sigma)
    rates = growing_rate(t_s, light, sigma)
    if rates is not None:
        raise FitError(
            f"the rate −d ln L/dt grows with time, from {rates[0]} to {rates[1]}, which that of no "
            "sum of decaying exponentials does: a zero that is subtracted too much, a sample that "
            "cools, or a detector that saturates"
        )
    at_least = earliest_crossing(t_s, light, sigma, level, level_sigma)
    every = posteriors(decay, candidates(decay))
    weights = _weights(every)
    random = np.random.default_rng(SEED)
    levels = math.log(level) + level_sigma * random.standard_normal(N_DRAWS)
    ends = np.cumsum(random.multinomial(N_DRAWS, weights))
    # Laws far from the record overflow, and are drawn by nobody.
    with np.errstate(all="ignore"):
        parts = zip(every, np.split(levels, ends[:-1]), strict=True)
        drawn = np.concatenate([_crossings(one, decay, part, random) for one, part in parts])
    low, middle, high = np.exp(np.quantile(drawn, [OUTSIDE, 0.5, 1 - OUTSIDE], method="lower"))
    if at_least is not None:
        earliest = at_least.value - NORMAL_95 * at_least.sigma
        low, middle, high = (max(float(end), earliest) for end in (low, middle, high))
    is_determined = high < NOT_DETERMINED * low
    names = dict.fromkeys(posterior.law.name for posterior in every)
    return ForecastTime(
        at_least=at_least,
        between_s=(float(low), float(high)) if is_determined else None,
        median_s=float(middle) if is_determined else None,
        laws={
            name: float(sum(w for w, p in zip(weights, every, strict=True) if p.law.name == name))
            for name in names
        },
    )


def _weights(every: list[Posterior]) -> FloatArray:
    """Return the probabilities with which laws are drawn from."""
    logs = np.array([posterior.log_weight for posterior in every])
    weights = np.exp(logs - logs.max())
    unforeseen = np.array([float(posterior.delta == max(WALKS)) for posterior in every])
    weights = (1 - UNFORESEEN) * weights / weights.sum() + UNFORESEEN * unforeseen / sum(unforeseen)
    weights[weights < LEAST_WEIGHT] = 0.0
    return np.asarray(weights / weights.sum())


def _crossings(
    posterior: Posterior, decay: LogDecay, log_levels: FloatArray, random: np.random.Generator
) -> FloatArray:
    """Draw ln t at which ln L falls to levels (n,); infinite where it does not."""
    n = len(log_levels)
    if n == 0:
        return np.empty(0)
    theta = posterior.draws(decay, n, random)
    end = float(decay.log_time[-1])
    d = np.concatenate([np.linspace(-BEFORE, 0, N_BEFORE + 1)[:-1], np.linspace(0, AFTER, N_AFTER)])
    curve = posterior.law.log_light(theta, end + d)
    slope = -np.gradient(curve, d, axis=1)
    at_end = np.maximum(slope[:, N_BEFORE : N_BEFORE + 1], 1e-6)
    slope = decay.slope[-1] * np.clip(slope / at_end, *SLOPES)
    walked = posterior.delta * np.sqrt(np.maximum(d, 0) ** 3 / 3) * random.standard_normal((n, 1))
    curve = curve + slope * walked
    below = curve < log_levels[:, None]
    place = np.maximum(np.argmax(below, axis=1), 1)
    rows = np.arange(n)
    high, low = curve[rows, place - 1], curve[rows, place]
    part = (high - log_levels) / np.maximum(high - low, 1e-12)
    crossed = d[place - 1] + np.clip(part, 0, 1) * (d[place] - d[place - 1])
    return np.where(below.any(axis=1), end + crossed, np.inf)
