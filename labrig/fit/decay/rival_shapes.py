"""Decays that are no finite sum of exponentials, as a frame sees them: means over [t, t + T]."""

import numpy as np

from labrig.fit.decay.shapes import SERIES_BELOW
from labrig.fit.least_squares import FloatArray

#: Gauss–Legendre on [0, 1] for what has no elementary integral.
_NODES, _SHARES = np.polynomial.legendre.leggauss(8)
NODES, SHARES = (_NODES + 1) / 2, _SHARES / 2


def power_law_mean(
    tau_s: float, exponent: float, t_s: FloatArray, exposure_s: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Mean of (1 + t/τ)^(−p) over each exposure, and its derivatives.

    With v = τ + t, Δ = log(1 + T/v) and ψ(x) = (e^x − 1)/x it is (v/τ)^(−p) (v/T) Δ ψ((1 − p) Δ),
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
    psi, psi_slope = _growth((1 - exponent) * delta)
    mean = np.where(exposed, start * (v / duration) * delta * psi, start)
    # d log(mean) / dv at fixed v/τ; Δ falls with v.
    delta_slope = -duration / (v * (v + duration))
    within = 1 / v + delta_slope / delta + (1 - exponent) * delta_slope * psi_slope
    by_log_tau = mean * (exponent * t_s / v + np.where(exposed, tau_s * within, 0.0))
    by_exponent = -mean * (stretch + np.where(exposed, delta * psi_slope, 0.0))
    return mean, np.stack([by_log_tau, by_exponent], axis=1)


def stretched_mean(
    tau_s: float, exponent: float, t_s: FloatArray, exposure_s: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Mean of exp(−(t/τ)^β) over each exposure, and its derivatives.

    Parameters
    ----------
    tau_s
        τ > 0.
    exponent
        β > 0.
    t_s, exposure_s
        (n,) start t ≥ 0 and length T ≥ 0 of the exposures.

    Returns
    -------
    (n,) the means, and (n, 2) their derivatives with respect to log τ and β.
    """
    time = t_s[:, None] + exposure_s[:, None] * NODES
    # t^β log t → 0 as t → 0.
    log_ratio = np.log(np.maximum(time / tau_s, 1e-300))
    power = np.exp(exponent * log_ratio)
    falling = np.exp(-power) * SHARES
    by_log_tau = exponent * (falling * power).sum(axis=1)
    by_exponent = -(falling * power * log_ratio).sum(axis=1)
    return falling.sum(axis=1), np.stack([by_log_tau, by_exponent], axis=1)


def _growth(x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """ψ(x) = (e^x − 1)/x and its logarithmic derivative 1/(1 − e^(−x)) − 1/x."""
    small = np.abs(x) < SERIES_BELOW
    safe = np.where(small, 1.0, x)
    series = 1 + x / 2 * (1 + x / 3 * (1 + x / 4 * (1 + x / 5 * (1 + x / 6))))
    psi = np.where(small, series, np.expm1(safe) / safe)
    # 1/2 + x/12 − x³/720 + …
    slope = np.where(small, 0.5 + x / 12 - x**3 / 720, -1 / np.expm1(-safe) - 1 / safe)
    return psi, slope
