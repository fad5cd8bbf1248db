"""Random numbers that change slowly: flicker of a lamp, the black level of a camera."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

#: Waves of which a course consists; their sum is a Gaussian process to 1 %.
WAVES = 300
#: Times are counted from here, in seconds since 1970, which keeps the phases of the waves exact.
ZERO_S = 1_767_225_600.0


class Wander:
    """Standard normal numbers over time with the covariance exp(−|Δt|/τ), as an AR(1) process has.

    The process is a sum of waves of random frequency, distributed as its power spectrum is, a
    Lorentzian (M. Shinozuka, G. Deodatis, Applied Mechanics Reviews 44, 1991, 191). So it is a
    function of the time alone: a run that is resumed finds it where it would have been.

    Parameters
    ----------
    rng
        Random generator of the waves.
    over_s
        Time τ after which little of a value is left, in seconds.
    """

    def __init__(self, rng: np.random.Generator, over_s: float) -> None:
        self._per_s = rng.standard_cauchy(WAVES) / over_s
        self._phase = rng.uniform(0.0, 2 * np.pi, WAVES)

    def __call__(self, wall_s: float) -> float:
        """Return the number at a time, in seconds since 1970."""
        waves = np.cos(self._per_s * (wall_s - ZERO_S) + self._phase)
        return float(np.sqrt(2 / WAVES) * waves.sum())
