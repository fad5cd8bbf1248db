"""What a frame sees of a decay: its mean over the exposure [t, t + T], never its start."""

import numpy as np

from labrig.fit.least_squares import FloatArray
from labrig.material import phi1

#: Below this k T the difference of two nearly equal numbers gives way to its Taylor series.
SERIES_BELOW = 0.03


def exponential_means_and_slopes(
    rates_per_s: FloatArray, t_s: FloatArray, exposure_s: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """`labrig.material.rates.exponential_means` and their derivatives by log k, both (n, m)."""
    phase = np.multiply.outer(t_s, rates_per_s)
    decayed: FloatArray = np.exp(-phase)
    if not exposure_s.any():
        return decayed, -phase * decayed
    x = np.multiply.outer(exposure_s, rates_per_s)
    mean = phi1(x)
    return decayed * mean, decayed * (_mean_slope(x, mean) - phase * mean)


def _mean_slope(x: FloatArray, mean: FloatArray) -> FloatArray:
    """Give x φ₁′(x) = e^(−x) − φ₁(x)."""
    # Σ_j j (−x)^j / (j + 1)!, j = 1 … 6; cut off, since powers of what is not small overflow.
    y = np.minimum(x, SERIES_BELOW)
    series = -y * (1 / 2 - y * (1 / 3 - y * (1 / 8 - y * (1 / 30 - y * (1 / 144 - y / 840)))))
    return np.where(x < SERIES_BELOW, series, np.exp(-x) - mean)
