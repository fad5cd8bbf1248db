"""Whether a decay came out alike each time it was repeated."""

from dataclasses import dataclass

import numpy as np

from labrig.fit import DecayFit
from labrig.reduce import Series
from labrig.report.residual_figure import residuals


@dataclass(frozen=True)
class Repeat:
    """One repeat's brightness relative to the first one's, with its standard uncertainty."""

    unit: str
    ratio: float
    sigma: float


def repeats(series: Series, fit: DecayFit) -> tuple[Repeat, ...]:
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
