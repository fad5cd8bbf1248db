"""Courses over time: random ones, of flicker and of a black level, and a periodic one."""

import numpy as np

#: Waves of which a course consists; their sum is a Gaussian process to 1 %.
WAVES = 300
#: Times are counted from here, in seconds since 1970, which keeps the phases of the waves exact.
ZERO_S = 1_767_225_600.0


class OrnsteinUhlenbeckNoise:
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


class Ripple:
    """A sine over time of random phase, of which an exposure takes the mean.

    Parameters
    ----------
    rng
        Random generator of the phase.
    amplitude
        Amplitude of the sine.
    period_s
        Its period in seconds, > 0.
    """

    def __init__(self, rng: np.random.Generator, amplitude: float, period_s: float) -> None:
        self._amplitude = amplitude
        self._per_s = 1 / period_s
        self._phase = rng.uniform(0.0, 2 * np.pi)

    def mean(self, wall_s: float, lasts_s: float) -> float:
        """Return the mean over an exposure of `lasts_s` that begins then, seconds since 1970."""
        middle_s = wall_s - ZERO_S + lasts_s / 2
        sine = np.sin(2 * np.pi * self._per_s * middle_s + self._phase)
        # NumPy's sinc x is sin πx / πx.
        return float(self._amplitude * np.sinc(self._per_s * lasts_s) * sine)
