"""Whether pictures through the LVF differ in more than their brightness.

They are compared as they are, position by position: camera curves and filter, which are known to
some per cent, are the same in both and drop out.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from labrig.analyse.emission_spectrum.picture import Picture, Pictures, combined

FloatArray = NDArray[np.float64]

#: Chance, over all comparisons of a kind, at which spectra that do not differ are said to.
LEVEL = 1e-3
#: Share of the highest value above which a place tells the centroid: elsewhere is noise.
BRIGHT = 0.02
#: Rounds in which the noise of the reference follows the brightness.
ROUNDS = 5


@dataclass(frozen=True)
class Comparison:
    """One picture against another.

    Attributes
    ----------
    what
        Which, for people.
    brightness
        Of the one relative to the other.
    chi2, dof
        Of the difference, the brightness and an offset of the dark level fitted.
    p_value
        Chance of such a difference by noise alone.
    beyond_noise
        Relative root mean square difference that noise does not explain, bright places counting
        most; 0 if it explains all.
    shift_nm, shift_sigma_nm
        How far the centroid of light along the filter is moved.
    """

    what: str
    brightness: float
    chi2: float
    dof: int
    p_value: float
    beyond_noise: float
    shift_nm: float
    shift_sigma_nm: float


def differ(comparisons: list[Comparison]) -> bool:
    """Whether any of several comparisons is more than chance."""
    return any(one.p_value < LEVEL / len(comparisons) for one in comparisons)


def over_time(frames: Pictures, centre_nm: FloatArray) -> list[Comparison]:
    """Every frame against all others together.

    Parameters
    ----------
    centre_nm
        (m,) of the filter where every value was read.
    """
    found = []
    for row in range(len(frames)):
        others = combined(frames.take([other for other in range(len(frames)) if other != row]))
        found.append(compared(f"{frames.t_s[row]:.3g} s", frames.take([row]), others, centre_nm))
    return found


def compared(what: str, frames: Pictures, reference: Picture, centre_nm: FloatArray) -> Comparison:
    """Some frames against a picture of others."""
    picture = combined(frames)
    known = np.isfinite(picture.value) & np.isfinite(reference.value)
    y, m = picture.value[known], reference.value[known]
    gain, chi2 = float(y @ m / (m @ m)), 0.0
    for _ in range(ROUNDS):
        variance = picture.sigma[known] ** 2 + gain**2 * reference.sigma[known] ** 2
        inverse = _inverse(variance)
        gain = float(m @ inverse @ y / (m @ inverse @ m))
        residual = y - gain * m
        chi2 = float(residual @ inverse @ residual)
    dof = len(y) - 2
    excess = max(chi2 - dof, 0.0) / float(gain**2 * (m @ inverse @ m))
    shift, sigma = _shift(y, m, gain, variance, centre_nm[known])
    return Comparison(
        what, gain, chi2, dof, float(chdtrc(dof, chi2)), float(np.sqrt(excess)), shift, sigma
    )


def _inverse(variance: FloatArray) -> FloatArray:
    """Of the covariance where all values may be off by one and the same amount: a sensor that has
    warmed since its dark frames is brighter all over.
    """
    weight = 1 / variance
    inverse: FloatArray = np.diag(weight) - np.outer(weight, weight) / weight.sum()
    return inverse


def _shift(
    y: FloatArray, m: FloatArray, gain: float, variance: FloatArray, centre_nm: FloatArray
) -> tuple[float, float]:
    """Difference of the centroids in nm where m has its light, and its σ."""
    bright = m > BRIGHT * m.max()
    y, m, variance, centre_nm = y[bright], m[bright], variance[bright], centre_nm[bright]
    light = float(m.sum())
    middle = float(centre_nm @ m) / light
    lever = (centre_nm - middle) / (gain * light)
    return float(lever @ (y - gain * m)), float(np.sqrt(lever**2 @ variance))
