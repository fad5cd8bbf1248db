"""Decay results with given numbers, for tests of what becomes of them."""

import math
from collections.abc import Mapping

import numpy as np

from labrig.results import DecayState, FittedDecay


def decay_result(
    *states: tuple[float, float],
    sigma: float = 0.01,
    weights: Mapping[str, float] | None = None,
    offset: float = 0.0,
    offset_sigma: float = 0.001,
) -> FittedDecay:
    """A result with rates and amplitudes (k_r, a) that are known to a relative `sigma`."""
    weights = weights or {"G": 1.0}
    n = len(weights)
    return FittedDecay(
        states=tuple(DecayState(k, sigma * k, a, sigma * a) for k, a in states),
        channels=tuple(weights),
        channel_weights=tuple(weights.values()),
        channel_weights_sigma=(0.0,) * n,
        offsets=(offset,) * n,
        offsets_sigma=(offset_sigma,) * n,
        repeats=("decay-1",),
        levels=(1.0,),
        flicker=0.005,
        flicker_sigma=math.inf,
        chi2=100.0,
        dof=100,
        bic=120.0,
        covariance=np.eye(2 * len(states) + 1),
        warnings=(),
        candidates=(),
        rivals=(),
        better_rival=None,
    )
