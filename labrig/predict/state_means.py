"""Light of states over the exposures of a decay, of first and of general order."""

from typing import NamedTuple

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.material import DECAY_LAWS, exponential_means_and_slopes

BECQUEREL = DECAY_LAWS["becquerel"]


class StateMeans(NamedTuple):
    """Means of m states over n exposures, 1 at lamp off.

    Attributes
    ----------
    value
        Means, shape (n, m).
    slopes
        Derivatives by the logarithm of the rate at lamp off and by the shape, shape (n, m, 2).
    """

    value: FloatArray
    slopes: FloatArray


def state_means(
    rate_per_s: FloatArray, shape: FloatArray, t_s: FloatArray, exposure_s: FloatArray
) -> StateMeans:
    """Return the means of states with these rates at lamp off and shapes (b − 1)/b, (m,) each."""
    value, by_log_rate = exponential_means_and_slopes(rate_per_s, t_s, exposure_s)
    slopes = np.stack([by_log_rate, np.zeros_like(by_log_rate)], axis=2)
    for state in np.flatnonzero(shape):
        rate, exponent = float(rate_per_s[state]), float(shape[state])
        value[:, state], slopes[:, state] = BECQUEREL.means(rate, exponent, t_s, exposure_s)
    return StateMeans(value, slopes)
