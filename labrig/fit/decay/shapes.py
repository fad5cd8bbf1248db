"""What a frame sees of a decay: the mean of the decay over the exposure [t, t + T], never its start."""

import numpy as np

from labrig.fit.least_squares import FloatArray

#: Below this k T the difference of two nearly equal numbers gives way to its Taylor series.
SERIES_BELOW = 0.03


def exponential_means(
    rates_per_s: FloatArray, t_s: FloatArray, exposure_s: FloatArray
) -> FloatArray:
    """Mean of e^(−k t) over each exposure, e^(−k t)(1 − e^(−k T))/(k T); its limit where T = 0.

    Parameters
    ----------
    rates_per_s
        (m,) k > 0.
    t_s, exposure_s
        (n,) start t and length T ≥ 0 of the exposures.

    Returns
    -------
    (n, m), in (0, 1] for t ≥ 0.
    """
    decayed: FloatArray = np.exp(-np.multiply.outer(t_s, rates_per_s))
    if not exposure_s.any():
        return decayed
    x = np.multiply.outer(exposure_s, rates_per_s)
    return decayed * _mean_over(x)


def exponential_means_and_slopes(
    rates_per_s: FloatArray, t_s: FloatArray, exposure_s: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """`exponential_means` and their derivatives with respect to log k, both (n, m)."""
    phase = np.multiply.outer(t_s, rates_per_s)
    decayed: FloatArray = np.exp(-phase)
    if not exposure_s.any():
        return decayed, -phase * decayed
    x = np.multiply.outer(exposure_s, rates_per_s)
    mean = _mean_over(x)
    return decayed * mean, decayed * (_mean_slope(x, mean) - phase * mean)


def _mean_over(x: FloatArray) -> FloatArray:
    """φ(x) = (1 − e^(−x))/x, with φ(0) = 1."""
    safe = np.where(x > 0, x, 1.0)
    return np.where(x > 0, -np.expm1(-safe) / safe, 1.0)


def _mean_slope(x: FloatArray, mean: FloatArray) -> FloatArray:
    """x φ′(x) = e^(−x) − φ(x)."""
    # Σ_j j (−x)^j / (j + 1)!, j = 1 … 6.
    series = -x * (1 / 2 - x * (1 / 3 - x * (1 / 8 - x * (1 / 30 - x * (1 / 144 - x / 840)))))
    return np.where(x < SERIES_BELOW, series, np.exp(-x) - mean)


def power_law_mean(
    tau_s: float, exponent: float, t_s: FloatArray, exposure_s: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Mean of (1 + t/τ)^(−p) over each exposure, and its derivatives.

    With v = τ + t, Δ = log(1 + T/v) and ψ(x) = (e^x − 1)/x the mean is (v/τ)^(−p) (v/T) Δ ψ((1 − p) Δ),
    which has no special case at p = 1.

    Parameters
    ----------
    tau_s
        τ > 0.
    exponent
        p > 0.
    t_s, exposure_s
        (n,) start t > −τ and length T ≥ 0 of the exposures.

    Returns
    -------
    (n,) the means, and (n, 2) their derivatives with respect to log τ and p.
    """
    v = tau_s + t_s
    stretch = np.log(v / tau_s)
    start = np.exp(-exponent * stretch)
    exposed = exposure_s > 0
    duration = np.where(exposed, exposure_s, 1.0)
    delta = np.log1p(duration / v)
    x = (1 - exponent) * delta
    psi, psi_slope = _growth(x)
    mean = np.where(exposed, start * (v / duration) * delta * psi, start)
    # d log(mean) / dv at fixed v/τ; Δ falls with v.
    delta_slope = -duration / (v * (v + duration))
    within = np.where(
        exposed,
        1 / v + delta_slope / delta + (1 - exponent) * delta_slope * psi_slope,
        0.0,
    )
    by_log_tau = mean * (exponent * t_s / v + tau_s * within)
    by_exponent = -mean * (stretch + np.where(exposed, delta * psi_slope, 0.0))
    return mean, np.stack([by_log_tau, by_exponent], axis=1)


def _growth(x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """ψ(x) = (e^x − 1)/x and its logarithmic derivative 1/(1 − e^(−x)) − 1/x."""
    small = np.abs(x) < SERIES_BELOW
    safe = np.where(small, 1.0, x)
    psi = np.where(small, 1 + x / 2 * (1 + x / 3 * (1 + x / 4 * (1 + x / 5))), np.expm1(safe) / safe)
    # 1/2 + x/12 − x³/720 + …
    slope = np.where(small, 0.5 + x / 12 - x**3 / 720, -1 / np.expm1(-safe) - 1 / safe)
    return psi, slope
