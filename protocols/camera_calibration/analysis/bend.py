"""Bend of a sensor near white, and how it changes the noise of photons.

A sensor gives y = L e^D(y) DN for the light L, with D = c₁ u + c₂ u² and u = y over the range from
black to white. Photon noise passes through the same bend, so that with g electrons a DN of a faint
light the variance by photons is

    Var(y) = (dy/dL)² L/g = y e^D / (1 − y D′)² / g:

a sensor that loses 3 % at white loses 9 % of the variance there. A straight line through such
variances has the wrong slope. The ratios of the channels in frames of one grey card (see the module
`linearity`) determine the bend to a fraction of a per mille of
white, by other numbers than the variances.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import FloatArray
from labrig.protocols.camera_calibration.analysis.linearity import CardRatios

#: Fraction of the range above which levels do not determine the bend: pixels fill up.
MAX_FRACTION = 0.85
#: σ of both coefficients at white without ratios of channels: no sensor in use bends by more.
UNKNOWN = 0.2


@dataclass(frozen=True, eq=False)
class Bend:
    """Deviation D = c₁ u + c₂ u² from linearity at levels y = u · `range_dn` above dark.

    Attributes
    ----------
    coefficients
        c₁ and c₂.
    covariance
        Their covariance, shape (2, 2).
    range_dn
        Range from black to white in DN.
    """

    coefficients: FloatArray
    covariance: FloatArray
    range_dn: float

    @property
    def at_white(self) -> tuple[float, float]:
        """Deviation from linearity at white, and its standard uncertainty."""
        return float(self.coefficients.sum()), float(np.sqrt(self.covariance.sum()))


def fit_bend(
    level_dn: FloatArray, sigma_dn: FloatArray, group: NDArray[np.intp], range_dn: float
) -> Bend:
    """Fit the bend to the ratios of the channels; unknown where these do not determine it.

    Parameters
    ----------
    level_dn, sigma_dn
        Levels above dark and their standard uncertainties in DN, shape (frames, channels); NaN
        where a value is not to be used.
    group
        Group of each frame, shape (frames,), within which the lens has the same effect on the
        card's colour.
    range_dn
        Range from black to white in DN.
    """
    level = np.where(level_dn < MAX_FRACTION * range_dn, level_dn, np.nan)
    prior = np.diag([UNKNOWN**-2, UNKNOWN**-2])
    ratios = CardRatios.of(level, sigma_dn, group, range_dn)
    if ratios is None:
        return Bend(np.zeros(2), np.diag([UNKNOWN**2, UNKNOWN**2]), range_dn)
    fraction = ratios.level_dn / range_dn
    target, design = ratios.without_nuisances(np.stack([fraction, fraction**2], axis=1))
    information = design.T @ design
    coefficients = np.linalg.solve(information + prior, design.T @ target)
    misfit = np.square(target - design @ coefficients).sum() / max(ratios.dof - 2, 1)
    covariance = np.linalg.inv(information / max(misfit, 1.0) + prior)
    return Bend(np.asarray(coefficients, dtype=np.float64), covariance, range_dn)


def photon_terms(coefficients: FloatArray, level_dn: FloatArray, range_dn: float) -> FloatArray:
    """Return g · Var(y) of photons in DN at levels y of any shape, for a bend's coefficients."""
    first, second = coefficients
    fraction = np.maximum(level_dn, 0.0) / range_dn
    deviation = first * fraction + second * fraction**2
    slope = 1 - first * fraction - 2 * second * fraction**2
    return np.asarray(np.maximum(level_dn, 0.0) * np.exp(deviation) / slope**2)
