"""Variance of numbers that a converter rounds, and of the error that they share.

Noise of the standard deviation s, in steps of the converter, and rounding add up to the variance
s² + 1/12 only where s is more than about 0.4 (Sheppard's correction). Less noise dithers the
rounding no more: a pixel gives the same number again and again, and most of its rounding error is
no noise but an error that does not average out. Averaged over all levels within a step, the
variance of a pixel is

    V(s²) = s² + 1/12 − B(s²),   B(v) = Σₘ e^(−4π²m²v)/(2π²m²),   m = 1, 2, …,

with B the variance of the error that remains in the pixel's mean over many readings (B. Widrow,
I. Kollár, *Quantization Noise*, 2008). The mean over many pixels whose values spread by the
variance v has the same error: structure dithers as well as noise.
"""

import numpy as np

from labrig.foundation.arrays import FloatArray

#: Variance of rounding to integers in DN² (uniform distribution), the least of a digital value.
ROUNDING_VARIANCE = 1 / 12
#: Standard deviation in steps from which B is less than 10⁻⁹ of the rounding's variance.
_DITHERED = 0.75
#: Variance below which only the nearest edge of a step matters: V = √(v/π).
_NEAREST_EDGE = 0.01
#: Terms of the series above that variance.
_TERMS = np.arange(1, 7)[:, np.newaxis]


def shared_rounding_variance(variance: FloatArray) -> FloatArray:
    """Return the variance of the rounding error that readings or pixels have in common.

    Parameters
    ----------
    variance
        Variance v of the values before they are rounded, in steps², of any shape.

    Returns
    -------
    ndarray
        Variance B(v) in steps²: 1/12 without any spread, nothing from 0.75 steps on.

    References
    ----------
    B. Widrow and I. Kollár, *Quantization Noise*, Cambridge University Press, 2008.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.reduce import shared_rounding_variance
    >>> np.sqrt(shared_rounding_variance(np.array([0.0, 0.09, 0.25]))).round(3).tolist()
    [0.289, 0.038, 0.002]
    """
    v = np.maximum(np.asarray(variance, dtype=np.float64), 0.0)
    series = (np.exp(-4 * np.pi**2 * _TERMS**2 * v.ravel()) / (2 * np.pi**2 * _TERMS**2)).sum(0)
    near = v + ROUNDING_VARIANCE - np.sqrt(v / np.pi)
    return np.where(v < _NEAREST_EDGE, near, series.reshape(v.shape))


def rounded_variance(variance: FloatArray) -> FloatArray:
    """Return the variance of rounded values, averaged over the levels within a step.

    Parameters
    ----------
    variance
        Variance v of the values before they are rounded, in steps², of any shape.

    Returns
    -------
    ndarray
        Variance V(v) in steps².

    References
    ----------
    B. Widrow and I. Kollár, *Quantization Noise*, Cambridge University Press, 2008.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.reduce import rounded_variance
    >>> rounded_variance(np.array([0.01, 0.25, 1.0])).round(4).tolist()
    [0.0564, 0.3333, 1.0833]
    """
    v = np.maximum(np.asarray(variance, dtype=np.float64), 0.0)
    return np.asarray(v + ROUNDING_VARIANCE - shared_rounding_variance(v))


_S = np.linspace(0.0, _DITHERED, 1501)
_V = rounded_variance(_S**2)


def unrounded_variance(variance: FloatArray) -> FloatArray:
    """Return the variance of values before they were rounded: the inverse of `rounded_variance`.

    Parameters
    ----------
    variance
        Variance V of rounded values whose levels are spread evenly over a step, or that of more
        than half a step's noise; in steps², of any shape.

    Returns
    -------
    ndarray
        Variance v in steps².

    References
    ----------
    B. Widrow and I. Kollár, *Quantization Noise*, Cambridge University Press, 2008.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.reduce import rounded_variance, unrounded_variance
    >>> unrounded_variance(rounded_variance(np.array([0.0, 0.01, 0.25, 4.0]))).round(6).tolist()
    [0.0, 0.01, 0.25, 4.0]
    """
    rounded = np.maximum(np.asarray(variance, dtype=np.float64), 0.0)
    return np.where(
        rounded > _V[-1], rounded - ROUNDING_VARIANCE, np.square(np.interp(rounded, _V, _S))
    )


def rounding_slope(variance: FloatArray) -> FloatArray:
    """Return dV/dv, by which σ of V is divided for that of v.

    Parameters
    ----------
    variance
        Variance v of the values before they are rounded, in steps², of any shape; where it is
        zero the slope is that at 10⁻³ steps.

    Returns
    -------
    ndarray
        The slope: 1 from 0.75 steps on, more below.

    References
    ----------
    B. Widrow and I. Kollár, *Quantization Noise*, Cambridge University Press, 2008.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.reduce import rounding_slope
    >>> rounding_slope(np.array([0.01, 1.0])).round(2).tolist()
    [2.82, 1.0]
    """
    v = np.maximum(np.asarray(variance, dtype=np.float64), 1e-6)
    series = 2 * np.exp(-4 * np.pi**2 * _TERMS**2 * v.ravel()).sum(0)
    return np.where(v < _NEAREST_EDGE, 0.5 / np.sqrt(np.pi * v), 1 + series.reshape(v.shape))
