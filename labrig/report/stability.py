"""Whether a decay came out alike each time it was repeated, and what was steady stayed so."""

from dataclasses import dataclass

import numpy as np

from labrig.report.decay_figures import residuals
from labrig.results import FittedDecay, Series

#: What stands out of its own σ by less was dark.
SEEN_SIGMA = 5.0


@dataclass(frozen=True)
class Repeat:
    """One repeat's brightness relative to the first one's, with its standard uncertainty."""

    unit: str
    ratio: float
    sigma: float


def repeats(series: Series, fit: FittedDecay) -> tuple[Repeat, ...]:
    """All units of `series` but the first; those without usable frames are left out.

    Each unit's factor to the common fit is the mean of what the channels of its frames have in
    common, weighted by the noise of a frame and its flicker.
    """
    left = residuals(series, fit)
    weight = 1 / (np.square(left.common_sigma) + fit.flicker**2)
    known = series.usable & np.isfinite(left.common) & np.isfinite(weight)
    factors = []
    for unit in dict.fromkeys(series.unit):
        rows = known & (np.array(series.unit) == unit)
        if rows.any():
            information = float(weight[rows].sum())
            mean = 1 + float(weight[rows] @ left.common[rows]) / information
            factors.append((unit, mean, 1 / np.sqrt(information)))
    if not factors:
        return ()
    (_, first, first_sigma), *others = factors
    return tuple(
        Repeat(
            unit, mean / first, mean / first * float(np.hypot(sigma / mean, first_sigma / first))
        )
        for unit, mean, sigma in others
    )


@dataclass(frozen=True)
class Steady:
    """A patch that shone steadily, such as a reference diode: what it says of lamp and camera.

    Parameters
    ----------
    channel
        The brightest one.
    level, level_sigma
        Its mean over all frames, DN/s.
    drift, drift_sigma
        Change of a straight line through it, relative to its mean, from the first frame of a decay
        to the last.
    """

    channel: str
    level: float
    level_sigma: float
    drift: float
    drift_sigma: float


def steady(series: Series) -> Steady | None:
    """For a patch without a fit; None if it is dark or has fewer than three usable frames.

    The scatter of the frames about the line tells σ, flicker included.
    """
    values = series.values[series.usable]
    if len(values) < 3:
        return None
    brightest = int(values.mean(axis=0).argmax())
    value, t_s = values[:, brightest], series.t_s[series.usable]
    level, span_s = float(value.mean()), float(np.ptp(t_s))
    away_s = t_s - t_s.mean()
    if not span_s:
        return None
    slope = float(away_s @ value / (away_s @ away_s))
    rest = value - level - slope * away_s
    scatter = float(np.sqrt(rest @ rest / (len(value) - 2)))
    level_sigma = scatter / np.sqrt(len(value))
    if not level > SEEN_SIGMA * level_sigma:
        return None
    slope_sigma = scatter / np.sqrt(away_s @ away_s)
    return Steady(
        channel=series.channels[brightest],
        level=level,
        level_sigma=float(level_sigma),
        drift=slope * span_s / level,
        drift_sigma=float(slope_sigma * span_s / level),
    )
