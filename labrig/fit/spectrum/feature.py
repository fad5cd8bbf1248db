"""Narrow features of a spectrum, and the values that a system has of them.

A feature is a line, two lines too close to be told apart, or a line with wings. Through a filter
whose band is wider, little more of it is seen than its power, its mean and its width: these are its
parameters, and what it looks like in detail hardly changes its values.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from labrig.fit.least_squares import FloatArray
from labrig.fit.spectrum.line import FWHM_OVER_SIGMA, line_at_knots, wings_at_knots

#: Prior of a feature's full width at half maximum in nm: even in its logarithm. Wider ones are left
#: to the smooth spectrum, which resolves them.
FWHM_NM = (0.7, 40.0)
#: Largest distance of the two lines of a feature: half a pass band, farther ones are two features.
PAIR_NM = 12.0
#: Least share of the weaker of two lines.
WEAKEST = 0.05
#: Distance of the knots of lines, per distance of the knots.
FINER = 0.1
#: Distance from a line in its σ beyond which a Gaussian is nil.
REACH = 6.0
#: Least power of a line of a first solution, per power of all.
FAINTEST = 1e-3
#: Least full width at half maximum in nm of a feature made of lines of a first solution.
FIRST_FWHM_NM = 3.0


@dataclass(frozen=True)
class Feature:
    """A Gaussian line, two of them, or a line with wings.

    Attributes
    ----------
    wavelength_nm, width_nm
        Mean and standard deviation of the light in nm; of a line with wings, those of a Gaussian
        of the same width at half maximum.
    apart
        Fraction of the variance that is due to the distance of two lines; 0 for one.
    share
        Fraction of the light in the line of longer wavelength, of two.
    wings
        Fraction of the light in a Lorentzian of the same width at half maximum.
    """

    wavelength_nm: float
    width_nm: float
    apart: float = 0.0
    share: float = 0.5
    wings: float = 0.0

    @property
    def fwhm_nm(self) -> float:
        """Full width at half maximum in nm of a Gaussian of the same width."""
        return float(FWHM_OVER_SIGMA) * self.width_nm

    @property
    def distance_nm(self) -> float:
        """Distance of its two lines in nm, 0 for one."""
        return self.width_nm * float(np.sqrt(self.apart / self.share / (1 - self.share)))

    @property
    def is_allowed(self) -> bool:
        """Whether the prior of its shape is not zero."""
        return (
            FWHM_NM[0] < self.fwhm_nm < FWHM_NM[1]
            and 0 <= self.apart < 1
            and WEAKEST < self.share < 1 - WEAKEST
            and self.distance_nm < PAIR_NM
            and 0 <= self.wings < 1
        )

    def at_knots(self, knots_nm: FloatArray) -> FloatArray:
        """Return the values (n,) of the feature of integral 1 at evenly spaced knots."""
        values = np.zeros_like(knots_nm)
        for part, local in self._parts(knots_nm):
            values[part] += local
        return values

    def seen_by(self, design: FloatArray, knots_nm: FloatArray) -> FloatArray:
        """Return the values (m,) that a design (m, n) has of the feature of integral 1."""
        values = np.zeros(len(design))
        for part, local in self._parts(knots_nm):
            values += design[:, part] @ local
        return values

    def _parts(self, knots_nm: FloatArray) -> Iterator[tuple[slice, FloatArray]]:
        """Yield where each line is not nil, and its values there."""
        width_nm = self.width_nm * float(np.sqrt(1 - self.apart))
        if self.apart > 0:
            lines = [
                (self.share, self.wavelength_nm + (1 - self.share) * self.distance_nm),
                (1 - self.share, self.wavelength_nm - self.share * self.distance_nm),
            ]
        else:
            lines = [(1 - self.wings, self.wavelength_nm)]
        fwhm_nm = float(FWHM_OVER_SIGMA) * width_nm
        reach_nm = REACH * width_nm + 2 * float(knots_nm[1] - knots_nm[0])
        for share, nm in lines:
            ends = np.searchsorted(knots_nm, (nm - reach_nm, nm + reach_nm)).tolist()
            part = slice(*ends)
            if ends[1] - ends[0] > 1:
                yield part, share * line_at_knots(knots_nm[part], nm, fwhm_nm)
        if self.wings > 0:
            whole = wings_at_knots(knots_nm, self.wavelength_nm, fwhm_nm)
            yield slice(None), self.wings * whole


def finer_knots(knots_nm: FloatArray) -> FloatArray:
    """Return the even knots on which lines are represented."""
    count = round((len(knots_nm) - 1) / FINER) + 1
    return np.linspace(knots_nm[0], knots_nm[-1], count)


def finer_design(design: FloatArray, knots_nm: FloatArray) -> FloatArray:
    """Return the design (m, q) on `finer_knots` from that on even knots h apart, (m, n).

    An element is ∫ A hat dλ = h (A + h² A″/12 + …), A the response per nm, which varies slowly; at
    either end there is half a hat.
    """
    fine = finer_knots(knots_nm)
    h, step = float(knots_nm[1] - knots_nm[0]), float(fine[1] - fine[0])
    per_nm = design / h
    per_nm[:, [0, -1]] *= 2
    spline = CubicSpline(knots_nm, per_nm, axis=1)
    result: FloatArray = step * (spline(fine) - (h**2 - step**2) / 12 * spline(fine, 2))
    return result


def united(one: Feature, other: Feature, share: float) -> Iterator[Feature]:
    """Yield one feature of the light of two: a line, and two lines if they are far enough apart.

    Parameters
    ----------
    one, other
        Features, that of shorter wavelength first.
    share
        Fraction of the light in the other.
    """
    distance_nm = other.wavelength_nm - one.wavelength_nm
    mean_nm = one.wavelength_nm + share * distance_nm
    between = share * (1 - share) * distance_nm**2
    variance = between + (1 - share) * one.width_nm**2 + share * other.width_nm**2
    width_nm = float(np.sqrt(variance))
    yield from (
        one
        for one in (
            Feature(mean_nm, width_nm),
            Feature(mean_nm, width_nm, between / variance, share),
        )
        if one.is_allowed
    )


def features_of(power: FloatArray, grid_nm: FloatArray) -> list[Feature]:
    """Return features for powers (n,) of lines at evenly spaced wavelengths; neighbours are one."""
    seen = np.flatnonzero(power > FAINTEST * power.sum())
    if not len(seen):
        return []
    features = []
    for group in np.split(seen, np.flatnonzero(np.diff(seen) > 1) + 1):
        share = power[group] / power[group].sum()
        mean_nm = float(share @ grid_nm[group])
        spread_nm = float(np.sqrt(share @ (grid_nm[group] - mean_nm) ** 2))
        width_nm = np.clip(spread_nm, *(np.array((FIRST_FWHM_NM, FWHM_NM[1])) / FWHM_OVER_SIGMA))
        features.append(Feature(mean_nm, float(width_nm)))
    return features
