"""The rate equation of one state, solved exactly for constant light.

dr/dt = (1 − r) κ − k_r r  (Nalbach et al., eq. 1, κ = Σ_j k_e,j E_j). With x = (κ + k_r) τ and
φ₁(x) = (1 − e⁻ˣ)/x, φ₂(x) = (1 − φ₁(x))/x, after a time τ

    r(τ) = r(0) e⁻ˣ + κ τ φ₁(x),      ∫₀^τ r dt = r(0) τ φ₁(x) + κ τ² φ₂(x),

which is accurate to all digits even where x, κ or k_r vanish. All functions broadcast.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from labrig.foundation.arrays import FloatArray

#: Argument below which φ₂ is summed as a series: the difference 1 − φ₁ loses digits.
_SERIES_BELOW = 0.5
#: Value of k T below which x φ₁′(x), a difference of nearly equal numbers, is summed as a series.
_SLOPE_SERIES_BELOW = 0.03
#: Σ (−x)ⁿ/(n + 2)!, highest power first; the first omitted term is 2e-17 at 0.5.
_PHI2_SERIES = [(-1) ** n / math.factorial(n + 2) for n in range(13, -1, -1)]


def phi1(x: ArrayLike) -> FloatArray:
    """Return φ₁(x) = (1 − e⁻ˣ)/x, the mean of e⁻ˣᵗ over t from 0 to 1.

    Parameters
    ----------
    x
        Arguments of any shape; below −700 the mean overflows.

    Returns
    -------
    ndarray
        Values above 0 in the shape of `x`; 1 at 0.

    Examples
    --------
    >>> from labrig.material import phi1
    >>> phi1([0.0, 1e-12, 1.0, 50.0]).round(6).tolist()
    [1.0, 1.0, 0.632121, 0.02]
    """
    x = np.asarray(x, dtype=np.float64)
    nonzero = np.where(x == 0, 1.0, x)
    return np.where(x == 0, 1.0, -np.expm1(-nonzero) / nonzero)


def phi2(x: ArrayLike) -> FloatArray:
    """Return φ₂(x) = (1 − φ₁(x))/x.

    Parameters
    ----------
    x
        Arguments ≥ 0, of any shape.

    Returns
    -------
    ndarray
        Values in (0, 1/2] in the shape of `x`; 1/2 at 0.

    Examples
    --------
    >>> from labrig.material import phi2
    >>> phi2([0.0, 1e-12, 1.0, 50.0]).round(6).tolist()
    [0.5, 0.5, 0.367879, 0.0196]
    """
    x = np.asarray(x, dtype=np.float64)
    return _phi1_and_phi2(x, np.exp(-x))[1]


def exponential_means(
    rates_per_s: FloatArray, t_s: FloatArray, exposure_s: FloatArray
) -> FloatArray:
    """Average e^(−k t) over each exposure.

    The mean is e^(−k t) (1 − e^(−k T))/(k T), and its limit where T = 0.

    Parameters
    ----------
    rates_per_s
        Rates k > 0 in 1/s, shape (m,).
    t_s
        Begin t of each exposure in seconds after lamp off, shape (n,).
    exposure_s
        Length T ≥ 0 of each exposure in seconds, shape (n,).

    Returns
    -------
    ndarray
        Means in (0, 1] for t ≥ 0, shape (n, m).

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.material import exponential_means
    >>> t_s, exposure_s = np.array([0.0, 5.0]), np.array([0.5, 0.5])
    >>> exponential_means(np.array([0.2, 0.01]), t_s, exposure_s).round(4).tolist()
    [[0.9516, 0.9975], [0.3501, 0.9489]]
    """
    decayed: FloatArray = np.exp(-np.multiply.outer(t_s, rates_per_s))
    if not exposure_s.any():
        return decayed
    x = np.multiply.outer(exposure_s, rates_per_s)
    return decayed * phi1(x)


def exponential_means_and_slopes(
    rates_per_s: FloatArray, t_s: FloatArray, exposure_s: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Average e^(−k t) over each exposure, with derivatives by the logarithms of the rates.

    Parameters
    ----------
    rates_per_s
        Rates k > 0 in 1/s, shape (m,).
    t_s
        Begin t of each exposure in seconds after lamp off, shape (n,).
    exposure_s
        Length T ≥ 0 of each exposure in seconds, shape (n,).

    Returns
    -------
    means, slopes
        Means as of `exponential_means`, and their derivatives by log k, both of shape (n, m).

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.material import exponential_means_and_slopes
    >>> t_s, exposure_s = np.array([0.0, 5.0]), np.array([0.5, 0.5])
    >>> means, slopes = exponential_means_and_slopes(np.array([0.2]), t_s, exposure_s)
    >>> means.round(4).tolist(), slopes.round(4).tolist()
    ([[0.9516], [0.3501]], [[-0.0468], [-0.3673]])
    """
    phase = np.multiply.outer(t_s, rates_per_s)
    decayed: FloatArray = np.exp(-phase)
    if not exposure_s.any():
        return decayed, -phase * decayed
    x = np.multiply.outer(exposure_s, rates_per_s)
    mean = phi1(x)
    return decayed * mean, decayed * (_mean_slope(x, mean) - phase * mean)


def _mean_slope(x: FloatArray, mean: FloatArray) -> FloatArray:
    """Return x φ₁′(x) = e^(−x) − φ₁(x), given φ₁(x)."""
    # Σ_j j (−x)^j / (j + 1)!, j = 1 … 6; cut off, since powers of what is not small overflow.
    y = np.minimum(x, _SLOPE_SERIES_BELOW)
    series = -y * (1 / 2 - y * (1 / 3 - y * (1 / 8 - y * (1 / 30 - y * (1 / 144 - y / 840)))))
    return np.where(x < _SLOPE_SERIES_BELOW, series, np.exp(-x) - mean)


def _phi1_and_phi2(x: FloatArray, exp_minus_x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return φ₁ and φ₂ of x, given e⁻ˣ."""
    small = x < _SERIES_BELOW
    series = np.polyval(_PHI2_SERIES, np.minimum(x, _SERIES_BELOW))
    large = np.maximum(x, _SERIES_BELOW)
    first = (1 - exp_minus_x) / large
    return np.where(small, 1 - x * series, first), np.where(small, series, (1 - first) / large)


class Relaxation(NamedTuple):
    """Step r(τ) = kept · r(0) + gained of the rate equation.

    Attributes
    ----------
    kept
        Fraction e⁻ˣ = ∂r(τ)/∂r(0) of the initial concentration.
    gained
        Concentration reached from 0.
    """

    kept: FloatArray
    gained: FloatArray


class RelaxationSlopes(NamedTuple):
    """Derivatives of a `Relaxation` in seconds.

    Attributes
    ----------
    kept
        Derivative of `kept`, equal by κ and by k_r.
    gained_by_kappa, gained_by_k_r
        Derivatives of `gained` by κ and by k_r.
    """

    kept: FloatArray
    gained_by_kappa: FloatArray
    gained_by_k_r: FloatArray


def relaxation(kappa_per_s: ArrayLike, k_r_per_s: ArrayLike, duration_s: ArrayLike) -> Relaxation:
    """Return the exact step of the rate equation under constant light.

    Parameters
    ----------
    kappa_per_s, k_r_per_s
        Excitation κ ≥ 0 and re-radiation rate k_r ≥ 0 in 1/s, constant during the step.
    duration_s
        Duration τ ≥ 0 in seconds.
    """
    kappa, tau = np.asarray(kappa_per_s, dtype=np.float64), np.asarray(duration_s)
    x = (kappa + np.asarray(k_r_per_s)) * tau
    return Relaxation(np.exp(-x), kappa * tau * phi1(x))


def relaxation_with_slopes(
    kappa_per_s: ArrayLike, k_r_per_s: ArrayLike, duration_s: ArrayLike
) -> tuple[Relaxation, RelaxationSlopes]:
    """Return the exact step of the rate equation under constant light, with its derivatives.

    The derivatives follow from one exponential by φ₁' = φ₂ − φ₁. All arguments broadcast.

    Parameters
    ----------
    kappa_per_s, k_r_per_s
        Excitation κ ≥ 0 and re-radiation rate k_r ≥ 0 in 1/s, constant during the step.
    duration_s
        Duration τ ≥ 0 in seconds.

    Returns
    -------
    step : Relaxation
        Coefficients of r(τ) = kept · r(0) + gained.
    slopes : RelaxationSlopes
        Derivatives of the coefficients by κ and k_r, in seconds.

    Examples
    --------
    >>> from labrig.material import relaxation_with_slopes
    >>> step, slopes = relaxation_with_slopes(0.03, 0.01, 60.0)
    >>> f"r(60 s) = {step.kept * 0.2 + step.gained:.4f} from r(0) = 0.2"
    'r(60 s) = 0.7001 from r(0) = 0.2'
    >>> f"dr/dκ = {slopes.kept * 0.2 + slopes.gained_by_kappa:.3f} s"
    'dr/dκ = 8.677 s'
    """
    kappa, tau = np.asarray(kappa_per_s, dtype=np.float64), np.asarray(duration_s)
    x = (kappa + np.asarray(k_r_per_s)) * tau
    kept = np.exp(-x)
    first, second = _phi1_and_phi2(x, kept)
    by_kappa, gained = tau * first, kappa * tau
    slope = gained * tau * (second - first)
    return Relaxation(kept, gained * first), RelaxationSlopes(-tau * kept, by_kappa + slope, slope)


def concentration(
    start: ArrayLike, kappa_per_s: ArrayLike, k_r_per_s: ArrayLike, duration_s: ArrayLike
) -> FloatArray:
    """Return the concentration of a state after constant light or darkness.

    The rate equation dr/dt = (1 − r) κ − k_r r (Nalbach et al., eq. 1) is solved exactly. All
    arguments broadcast.

    Parameters
    ----------
    start
        Concentration at the start, 0 to 1.
    kappa_per_s, k_r_per_s
        Excitation κ ≥ 0 and re-radiation rate k_r ≥ 0 in 1/s.
    duration_s
        Duration in seconds.

    Returns
    -------
    ndarray
        Concentration at the end, 0 to 1, in the broadcast shape.

    Examples
    --------
    Charge for a minute, then decay for a minute:

    >>> from labrig.material import concentration
    >>> charged = concentration(0.0, kappa_per_s=0.03, k_r_per_s=0.01, duration_s=60.0)
    >>> decayed = concentration(charged, kappa_per_s=0.0, k_r_per_s=0.01, duration_s=60.0)
    >>> f"{charged:.4f} {decayed:.4f}"
    '0.6820 0.3743'
    """
    step = relaxation(kappa_per_s, k_r_per_s, duration_s)
    after: FloatArray = step.kept * np.asarray(start) + step.gained
    return after


def concentration_integral(
    start: ArrayLike, kappa_per_s: ArrayLike, k_r_per_s: ArrayLike, duration_s: ArrayLike
) -> FloatArray:
    """Return ∫ r dt over `duration_s`, in seconds: the signal of an exposure of that length."""
    kappa, tau = np.asarray(kappa_per_s, dtype=np.float64), np.asarray(duration_s)
    x = (kappa + np.asarray(k_r_per_s)) * tau
    total: FloatArray = np.asarray(start) * tau * phi1(x) + kappa * tau**2 * phi2(x)
    return total


def equilibrium(kappa_per_s: ArrayLike, k_r_per_s: ArrayLike) -> FloatArray:
    """Return the concentration r∞ = κ/(κ + k_r) under constant light; 0 without light."""
    kappa = np.asarray(kappa_per_s, dtype=np.float64)
    total = kappa + np.asarray(k_r_per_s)
    return np.where(total > 0, kappa / np.where(total > 0, total, 1.0), 0.0)


def self_excitation(k_e_per_s: ArrayLike, reradiation: ArrayLike, albedo: ArrayLike) -> float:
    """Return how much glow comes of a glow in a closed room of one material, at most.

    In weak light a state emits Λ κ in the end, as radiance of a Lambertian surface. All of it comes
    back to the walls of such a room, again and again as they reflect it: 1/(1 − albedo) times in
    all. From 1 on the room would glow ever more.

    Parameters
    ----------
    k_e_per_s
        Excitation rates in 1/s for an irradiance of 1 in each band, shape (states, bands[,
        samples]).
    reradiation
        Λ of each state as radiance times s in the same unit, shape (states, bands[, samples]).
    albedo
        Albedo in the bands, from 0 to below 1, shape (bands,) or (bands, samples).

    Returns
    -------
    float
        The largest eigenvalue, in modulus, of the excitation of each state by the glow of each; of
        samples, that of the worst.

    Examples
    --------
    >>> from labrig.material import self_excitation
    >>> round(self_excitation([[0.0, 0.02]], [[3.0, 4.0]], [0.5, 0.5]), 3)
    0.503
    """
    k_e, emitted, reflected = (
        np.asarray(each, dtype=np.float64) for each in (k_e_per_s, reradiation, albedo)
    )
    if k_e.ndim == 2:
        k_e = k_e[..., np.newaxis]
    if emitted.ndim == 2:
        emitted = emitted[..., np.newaxis]
    if reflected.ndim == 1:
        reflected = reflected[:, np.newaxis]
    # Excitation of state i by the glow of state j, for each sample.
    among = np.pi * np.einsum("ibs,jbs->sij", k_e / (1 - reflected), emitted)
    return float(np.abs(np.linalg.eigvals(among)).max())
