"""Deviation of a sensor from linearity, from the colours of one grey card, and its bend.

A grey card has one colour. If the sensor were linear the channels of all its photographs would have
the same ratios, whatever shutter, aperture and lamp did in that frame: all of that is common to the
channels. The channels are at different levels, so that a deviation D(level) changes their ratios,
free of flicker and drift:

    ln s_fc = λ_f + κ_c + δ_c / s_fc + D(s_fc),   D piecewise linear, D(0) = 0,

with δ the error of the subtracted dark level. A deviation that is the same power at all levels is
not observable in this way.

A sensor gives y = L e^D(y) DN for the light L, with D = c₁ u + c₂ u² and u = y over the range from
black to white. Photon noise passes through the same bend, so that with g electrons a DN of a faint
light the variance by photons is

    Var(y) = (dy/dL)² L/g = y e^D / (1 − y D′)² / g:

a sensor that loses 3 % at white loses 9 % of the variance there. A straight line through such
variances has the wrong slope. The ratios of the channels in frames of one grey card determine the
bend to a fraction of a per mille of white, by other numbers than the variances.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from labrig.calibration import Linearity
from labrig.foundation.arrays import FloatArray
from labrig.optics import hat_functions

#: Knots of D, as fractions of the range up to saturation.
KNOTS = (0.15, 0.35, 0.55, 0.75, 0.95)
#: Fraction of the range below which read noise dominates.
MIN_FRACTION = 0.005


@dataclass(frozen=True, eq=False)
class CardRatios:
    """Logarithms of n levels of a grey card, of which only ratios of channels count.

    Attributes
    ----------
    level_dn
        The levels above dark in DN, shape (n,).
    weight
        Reciprocal relative standard uncertainties, shape (n,).
    nuisances
        Orthonormal basis of what light, colour and dark level explain in weighted logarithms,
        shape (n, m).
    """

    level_dn: FloatArray
    weight: FloatArray
    nuisances: FloatArray

    @classmethod
    def of(
        cls,
        level_dn: FloatArray,
        sigma_dn: FloatArray,
        group: NDArray[np.intp],
        range_dn: float,
    ) -> "CardRatios | None":
        """Return the ratios of frames; None if none has two channels above the read noise.

        Parameters are those of `fit_linearity`.
        """
        is_used = np.isfinite(level_dn) & (level_dn > MIN_FRACTION * range_dn)
        is_used &= (is_used.sum(axis=1) > 1)[:, np.newaxis]
        if not is_used.any():
            return None
        frame, channel = np.nonzero(is_used)
        level, weight = level_dn[is_used], level_dn[is_used] / sigma_dn[is_used]
        frames, channels = level_dn.shape
        groups = int(group.max()) + 1
        light = np.equal.outer(frame, np.arange(frames)).astype(np.float64)
        colour = np.zeros((len(level), groups * channels))
        colour[np.arange(len(level)), group[frame] * channels + channel] = 1.0
        dark = np.equal.outer(channel, np.arange(channels)) / level[:, np.newaxis]
        nuisances = np.hstack([light, colour, dark * level.min()]) * weight[:, np.newaxis]
        left, singular_values, _ = np.linalg.svd(nuisances, full_matrices=False)
        return cls(level, weight, left[:, singular_values > 1e-10 * singular_values.max()])

    @property
    def dof(self) -> int:
        """Number of levels less that of the nuisances."""
        return len(self.level_dn) - int(self.nuisances.shape[1])

    def without_nuisances(self, design: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return weighted logarithms (n,) and columns of a design (n, k), nuisances taken out."""
        target = np.log(self.level_dn) * self.weight
        columns = design * self.weight[:, np.newaxis]
        basis = self.nuisances
        return target - basis @ (basis.T @ target), columns - basis @ (basis.T @ columns)


def fit_linearity(
    level_dn: FloatArray,
    sigma_dn: FloatArray,
    group: NDArray[np.intp],
    range_dn: float,
    saturation_dn: float | None,
) -> Linearity | None:
    """Fit the deviation D at a few levels; None where the frames do not determine it.

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
    saturation_dn
        Saturation level in DN, which is passed on to the result.
    """
    ratios = CardRatios.of(level_dn, sigma_dn, group, range_dn)
    if ratios is None:
        return None
    highest = float(ratios.level_dn.max())
    between = [fraction * range_dn for fraction in KNOTS if fraction * range_dn < highest]
    knots = np.array([0.0, *between, highest])
    target, design = ratios.without_nuisances(hat_functions(knots, ratios.level_dn)[:, 1:])
    singular = np.linalg.svd(design, compute_uv=False)
    if singular[-1] < 1e-6 * singular[0]:
        return None
    coefficients, *_ = np.linalg.lstsq(design, target)
    dof = ratios.dof - len(coefficients)
    misfit = np.square(target - design @ coefficients).sum() / max(dof, 1)
    covariance = np.linalg.inv(design.T @ design) * max(misfit, 1.0)
    return Linearity(
        level_dn=tuple(knots[1:].tolist()),
        deviation=tuple(coefficients.tolist()),
        sigma=tuple(np.sqrt(np.diag(covariance)).tolist()),
        saturation_dn=saturation_dn,
    )


def deviation(linearity: Linearity | None, level_dn: FloatArray) -> FloatArray:
    """Return the deviation D at levels in DN; zero without a fit."""
    if linearity is None:
        return np.zeros_like(level_dn)
    return np.interp(level_dn, [0.0, *linearity.level_dn], [0.0, *linearity.deviation])


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
