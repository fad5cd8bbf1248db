"""Laws of decay that are no sum of exponentials, averaged over exposures.

Each is a signal of 1 at lamp off with a rate in 1/s and a shape, after the time t:

- `becquerel`: (1 + t/τ)^(−p), the decay of general order b = p/(p − 1) of *one* charge; the rate is
  p/τ, that at lamp off, and the shape 1/p, so that 0 is an exponential.
- `otor`: one trap, one recombination centre. Of electrons that leave the trap, a part is trapped
  again; with the ratio R of the two chances and n₀ electrons in the trap of 1 that it holds,
  dn/dt = −p n²/((1 − R) n + R). The rate is that at lamp off, and the shape
  R/(R + (1 − R) n₀): 0 is an exponential, 1 the second order. A decay does not tell R from n₀.
- `stretched`: exp(−(t/τ)^β), the rate 1/τ and the shape β.

References
----------
H. Nalbach et al., section 4.4, after A. K. Jonscher and A. de Polignac (1984) and others; R. Chen
and V. Pagonis, *Thermally and Optically Stimulated Luminescence* (2011), for one trap; its solution
by G. Kitis and N. D. Vlachos, *Radiation Measurements* 48 (2013) 47.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.number_format import rounded

#: Argument below which a series takes the place of a difference that loses digits.
SERIES_BELOW = 0.03
#: Part of a lifetime that an exposure must last for its light to be a difference of levels.
SHORT_EXPOSURE = 1e-4
#: Distance of a trap's shape from 0 and 1 within which it is the limit.
NEAR_LIMIT = 1e-12
#: Level below which its logarithm is not needed.
TINY = 1e-300
#: Gauss–Legendre nodes and weights on [0, 1], for functions without an elementary integral.
_NODES, _FRACTIONS = np.polynomial.legendre.leggauss(8)
NODES, FRACTIONS = (_NODES + 1) / 2, _FRACTIONS / 2

#: Argument below which log(1 + x)/x and its derivative are summed as series, and the coefficients
#: of both, the highest power first.
LOG_SERIES_BELOW = 0.01
_LOG_SERIES = (-1.0) ** np.arange(6, -1, -1) / np.arange(7, 0, -1)
_LOG_SERIES = np.stack([_LOG_SERIES, np.append(0.0, np.polyder(_LOG_SERIES))], axis=1)

#: (rate in 1/s, shape, begins in s (n,), exposures in s (n,)) → means (n,), and their derivatives
#: by the logarithm of the rate and by the shape (n, 2). Rates and shapes of some laws, shape
#: (k, 1), give means (k, n).
Means = Callable[
    [float | FloatArray, float | FloatArray, FloatArray, FloatArray], tuple[FloatArray, FloatArray]
]


@dataclass(frozen=True)
class DecayLaw:
    """A law of decay with a rate and a shape.

    Attributes
    ----------
    name, label
        Name in files and on command lines, and in sentences.
    value
        Function of k t ≥ 0 and the shape, which broadcast, that returns the signal, 1 at 0.
    means
        Function of a rate in 1/s, a shape, begins and lengths of exposures in seconds (n,), that
        returns the means (n,) of the signal, 1 at lamp off, over the exposures, and their
        derivatives by the logarithm of the rate and by the shape (n, 2).
    shapes
        Least and largest shape.
    limits
        Shapes at which the law is a simpler one: an exponential, and the second order of one trap.
    formula
        Function of a rate in 1/s and a shape that returns the formula of the signal with numbers.
    short_label
        Name in the legend of a figure.
    shape_name
        Name of the shape among the law's own parameters.
    possible_shapes
        Least and largest shape that the law may have, whatever a fit's bounds.
    forecast_shapes
        Least and largest shape of decays that are continued beyond their record.
    has_states
        Whether the law is that of a state of general order, which a material file can hold.
    """

    name: str
    label: str
    value: Callable[[FloatArray, FloatArray], FloatArray]
    means: Means
    shapes: tuple[float, float]
    limits: tuple[float, ...]
    formula: Callable[[float, float], str]
    short_label: str
    shape_name: str = "exponent"
    possible_shapes: tuple[float, float] = (0.0, 1.0)
    forecast_shapes: tuple[float, float] = (0.0, 1.0)
    has_states: bool = False


def becquerel_value(phase: FloatArray, shape: FloatArray) -> FloatArray:
    """Return (1 + u x)^(−1/u) at x = k t, e^(−x) where u = 0."""
    x = shape * phase
    return np.exp(-phase * np.where(x < TINY, 1.0, np.log1p(x) / np.maximum(x, TINY)))


def becquerel_means(
    rate_per_s: float | FloatArray,
    shape: float | FloatArray,
    t_s: FloatArray,
    exposure_s: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Average (1 + u k t)^(−1/u) over each exposure, u = 1/p and k = p/τ; at u = 0 it is e^(−k t).

    With z = k T/(1 + u k t), ℓ(x) = log(1 + x)/x and ψ(x) = (e^x − 1)/x the mean is the value at
    the start times ℓ(u z) ψ(u z ℓ(u z) − z ℓ(u z)), without a special case.
    """
    phase = rate_per_s * t_s
    growth = 1 + shape * phase
    ratio, ratio_slope = log_ratio(shape * phase)
    z = rate_per_s * exposure_s / growth
    y = shape * z
    ell, ell_slope = log_ratio(y)
    psi, psi_slope = _growth((shape - 1) * z * ell)
    mean = np.exp(-phase * ratio) * ell * psi
    # Derivatives of log(mean), by log k and by u, through z, y = u z and (u − 1) z ℓ(y).
    slopes = np.empty((*mean.shape, 2))
    z_slopes = z / growth, -z * phase / growth
    y_slopes = shape * z_slopes[0], z / growth
    begins = -phase / growth, -(phase**2) * ratio_slope
    by_shape = 0.0, z * ell
    for column in range(2):
        exponent = (
            by_shape[column]
            + (shape - 1) * ell * z_slopes[column]
            + (shape - 1) * z * ell_slope * y_slopes[column]
        )
        slopes[..., column] = mean * (
            begins[column] + ell_slope / ell * y_slopes[column] + psi_slope * exponent
        )
    return mean, slopes


def otor_value(phase: FloatArray, shape: FloatArray) -> FloatArray:
    """Return the light of one trap at x = k t over that at lamp off."""
    level = _trap_level(phase, shape)
    return level * (level / np.maximum(shape + (1 - shape) * level, TINY))


def otor_means(
    rate_per_s: float | FloatArray,
    shape: float | FloatArray,
    t_s: FloatArray,
    exposure_s: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Average the light of one trap with retrapping over each exposure.

    The level m, 1 at lamp off, obeys g (1/m − 1) − (1 − g) log m = k t with the shape g: 1/m is
    Wright's ω function. The light is −dm/dt over its value k at lamp off; its mean over an exposure
    is the fall of the level over k T.
    """
    n, length = len(t_s), rate_per_s * exposure_s
    is_short = length < SHORT_EXPOSURE
    short = np.flatnonzero(is_short.reshape(-1, n).any(axis=0))
    middle_s = t_s[short] + exposure_s[short] / 2
    trap = _trap(rate_per_s, shape, np.concatenate([t_s, t_s + exposure_s, middle_s]))
    safe = np.where(is_short, 1.0, length)

    def fall(level: FloatArray) -> FloatArray:
        return np.asarray((level[..., :n] - level[..., n : 2 * n]) / safe)

    mean, by_shape = fall(trap.level), fall(trap.level_by_shape)
    by_log_rate = fall(trap.level_by_log_rate) - mean
    if len(short):
        light = trap.light, trap.light_by_log_rate, trap.light_by_shape
        for of_fall, of_middle in zip((mean, by_log_rate, by_shape), light, strict=True):
            of_fall[..., short] = np.where(
                is_short[..., short], of_middle[..., 2 * n :], of_fall[..., short]
            )
    return mean, np.stack([by_log_rate, by_shape], axis=-1)


def stretched_value(phase: FloatArray, shape: FloatArray) -> FloatArray:
    """Return exp(−x^β) at x = k t."""
    value: FloatArray = np.exp(-(phase**shape))
    return value


def stretched_means(
    rate_per_s: float | FloatArray,
    shape: float | FloatArray,
    t_s: FloatArray,
    exposure_s: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Average exp(−(k t)^β) over each exposure by Gauss's rule with eight points."""
    nodes, fractions = (NODES, FRACTIONS) if exposure_s.any() else (np.zeros(1), np.ones(1))
    beta = np.asarray(shape)[..., None]
    time = np.asarray(rate_per_s)[..., None] * (t_s[:, None] + exposure_s[:, None] * nodes)
    # x^β log x → 0 as x → 0.
    log_time = np.log(np.maximum(time, TINY))
    power = np.exp(beta * log_time)
    falling = np.exp(-power) * fractions
    rising = falling * power
    slopes = -shape * rising.sum(axis=-1), -(rising * log_time).sum(axis=-1)
    return falling.sum(axis=-1), np.stack(slopes, axis=-1)


@dataclass(frozen=True)
class _Trap:
    """Level and light of a trap, relative to those at lamp off, and derivatives; shape (n,)."""

    level: FloatArray
    light: FloatArray
    level_by_log_rate: FloatArray
    level_by_shape: FloatArray
    light_by_log_rate: FloatArray
    light_by_shape: FloatArray


def _trap_level(phase: FloatArray, shape: FloatArray) -> FloatArray:
    """Return the level of a trap, 1 at lamp off, at k t, which broadcasts with the shape."""
    # Not above: it takes longer to load than a plan to be printed.
    from scipy.special import wrightomega

    escaped = np.maximum(1 - shape, NEAR_LIMIT)
    ratio = np.maximum(shape, NEAR_LIMIT) / escaped
    level = ratio / wrightomega(np.log(ratio) + ratio + phase / escaped)
    level = np.where(shape > 1 - NEAR_LIMIT, 1 / (1 + phase), level)
    return np.where(shape < NEAR_LIMIT, np.exp(-phase), level)


def _trap(rate_per_s: float | FloatArray, shape: float | FloatArray, t_s: FloatArray) -> _Trap:
    phase = rate_per_s * t_s
    retrapped, escaped = shape, 1 - shape
    level = _trap_level(phase, np.asarray(shape))
    share = np.maximum(retrapped + escaped * level, TINY)
    ratio = level / share
    light = level * ratio
    # Of g (1/m − 1) − (1 − g) log m = k t: dm/d log k = −k t l, dm/dg = (1/m − 1 + log m) l.
    by_log_rate = -phase * light
    log_level = np.log(np.maximum(level, TINY))
    by_shape = ratio * (1 - level + level * log_level)
    light_by_level = ratio * (2 * retrapped + escaped * level) / share
    return _Trap(
        level,
        light,
        by_log_rate,
        by_shape,
        light_by_level * by_log_rate,
        light_by_level * by_shape - ratio**2 * (1 - level),
    )


def log_ratio(x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return ℓ(x) = log(1 + x)/x and its derivative, x > −1."""
    x = np.asarray(x)
    small = np.abs(x) < LOG_SERIES_BELOW
    safe = np.where(small, 1.0, x)
    ratio = np.asarray(np.log1p(safe) / safe)
    slope = np.asarray((1 / (1 + safe) - ratio) / safe)
    if small.any():
        ratio[small], slope[small] = np.polyval(_LOG_SERIES[..., None], x[small])
    return ratio, slope


def _growth(x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return ψ(x) = (e^x − 1)/x and its logarithmic derivative 1/(1 − e^(−x)) − 1/x."""
    x = np.asarray(x)
    small = np.abs(x) < SERIES_BELOW
    safe = np.where(small, 1.0, x)
    psi = np.asarray(np.expm1(safe) / safe)
    slope = np.asarray(-1 / np.expm1(-safe) - 1 / safe)
    if small.any():
        y = x[small]
        psi[small] = 1 + y / 2 * (1 + y / 3 * (1 + y / 4 * (1 + y / 5 * (1 + y / 6))))
        # 1/2 + x/12 − x³/720 + …
        slope[small] = 0.5 + y / 12 - y**3 / 720
    return psi, slope


def _becquerel_formula(rate_per_s: float, shape: float) -> str:
    if shape == 0:
        return f"exp(−t/{_seconds(1 / rate_per_s)})"
    tau, power = _seconds(1 / (rate_per_s * shape)), rounded(1 / shape, 3)
    return f"(1 + t/τ)⁻ᵖ, τ = {tau}, p = {power}"


def _stretched_formula(rate_per_s: float, shape: float) -> str:
    return f"exp(−(t/τ)ᵝ), τ = {_seconds(1 / rate_per_s)}, β = {rounded(shape, 3)}"


def _seconds(time_s: float) -> str:
    return f"{rounded(time_s, 3)} s"


#: The laws by their names. Each contains an exponential. A further one is one more entry.
DECAY_LAWS: Mapping[str, DecayLaw] = MappingProxyType(
    {
        law.name: law
        for law in (
            DecayLaw(
                name="becquerel",
                label="Becquerel's law",
                value=becquerel_value,
                means=becquerel_means,
                shapes=(0.0, 10.0),
                limits=(0.0,),
                formula=_becquerel_formula,
                short_label="Becquerel",
                possible_shapes=(0.0, math.inf),
                forecast_shapes=(0.0, 2.0),
                has_states=True,
            ),
            DecayLaw(
                name="otor",
                label="one trap with retrapping",
                value=otor_value,
                means=otor_means,
                shapes=(0.0, 1.0),
                limits=(0.0, 1.0),
                formula=lambda rate_per_s, shape: (
                    f"1/k = {_seconds(1 / rate_per_s)} at lamp off, retrapping {rounded(shape, 2)}"
                ),
                short_label="one trap",
                shape_name="retrapping",
            ),
            DecayLaw(
                name="stretched",
                label="stretched exponential",
                value=stretched_value,
                means=stretched_means,
                shapes=(0.1, 1.0),
                limits=(1.0,),
                formula=_stretched_formula,
                short_label="stretched",
                forecast_shapes=(0.1, 1.0),
            ),
        )
    }
)
