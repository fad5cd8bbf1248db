"""A smooth spectrum with lines side by side, none negative, that is nearest to some values.

Through a filter whose band is wider, little more is seen of light within a band than its power, its
mean and its width: many lines, few, and a broad one look alike. A *basis* is one way to write such
light: lines of one width in given places, of any power, on a smooth spectrum.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.linalg import toeplitz

from labrig.fit.spectrum.line import line_at_knots
from labrig.fit.spectrum.minimum import nonnegative_minimum
from labrig.fit.spectrum.smooth import Prior, Whitened
from labrig.fit.spectrum.system import SpectralSystem
from labrig.foundation.arrays import FloatArray

#: Full widths at half maximum of lines in nm.
FWHM_NM = np.geomspace(0.7, 22.0, 9)
#: Distance of the knots of lines, per distance of the knots.
FINER = 0.1

Places = NDArray[np.int_]


@dataclass(frozen=True, eq=False)
class Basis:
    """Lines on a smooth spectrum.

    Attributes
    ----------
    weight
        Weight of the smoothness prior.
    width
        Index of the lines' full width at half maximum in `FWHM_NM`.
    places
        Indices of their fine knots; empty for a spectrum without lines.
    """

    weight: float
    width: int
    places: Places


def smooth(weight: float) -> Basis:
    """Return a basis without lines."""
    return Basis(weight, 0, np.empty(0, dtype=np.int_))


@dataclass(frozen=True, eq=False)
class Problem:
    """Whitened values, the designs that a smooth spectrum and lines have, and the prior."""

    values: Whitened
    system: SpectralSystem
    prior: Prior

    @cached_property
    def fine_nm(self) -> FloatArray:
        """Knots of lines in nm, shape (q,)."""
        knots = self.values.knots_nm
        return np.linspace(knots[0], knots[-1], round((len(knots) - 1) / FINER) + 1)

    @cached_property
    def shapes(self) -> FloatArray:
        """Values at the fine knots of a line of integral 1 at each of them, (widths, q, q)."""
        from_line_nm = self.fine_nm - self.fine_nm[0]
        return np.array([toeplitz(line_at_knots(from_line_nm, 0.0, fwhm)) for fwhm in FWHM_NM])

    @cached_property
    def information(self) -> FloatArray:
        """Curvature of χ² by the smooth spectrum, shape (n, n), the same for every prior."""
        design = self.values.design
        return np.asarray(design.T @ design)

    @cached_property
    def line_designs(self) -> FloatArray:
        """Whitened values of a line of integral 1 at each fine knot, shape (widths, m, q).

        An element of the design on the knots is ∫ A hat dλ = h (A + h² A″/12 + …), A the response
        per nm, which varies slowly; at either end there is half a hat.
        """
        knots, fine = self.values.knots_nm, self.fine_nm
        h, step = float(knots[1] - knots[0]), float(fine[1] - fine[0])
        per_nm = self.system.design / h
        per_nm[:, [0, -1]] *= 2
        spline = CubicSpline(knots, per_nm, axis=1)
        fine_design = step * (spline(fine) - (h**2 - step**2) / 12 * spline(fine, 2))
        result: FloatArray = np.linalg.solve(self.values.lower, fine_design) @ self.shapes
        return result

    def matrices(self, basis: Basis) -> tuple[FloatArray, FloatArray]:
        """Return the design (m, n + k) of the smooth spectrum and of k powers, and the curvature.

        Powers have a prior σ of all the light.
        """
        n, design = len(self.values.knots_nm), self.values.design
        if len(basis.places):
            design = np.hstack([design, self.line_designs[basis.width][:, basis.places]])
            curvature = design.T @ design
        else:
            curvature = self.information.copy()
        curvature[:n, :n] += self.prior.precision(basis.weight)
        powers = np.arange(n, len(curvature))
        curvature[powers, powers] += float(np.ptp(self.values.knots_nm)) ** -2
        return design, curvature

    def likeliest(self, basis: Basis) -> tuple[FloatArray, float]:
        """Return smooth spectrum and powers (n + k,), and χ² plus that of the prior."""
        design, curvature = self.matrices(basis)
        linear = design.T @ self.values.target
        x = nonnegative_minimum(curvature, linear, np.ones(len(linear), dtype=np.bool_))
        cost = self.values.target @ self.values.target - 2 * linear @ x + x @ curvature @ x
        return x, float(cost)

    def on_knots(self, basis: Basis, x: FloatArray) -> FloatArray:
        """Return the spectrum (q,) on the fine knots."""
        n = len(self.values.knots_nm)
        between = np.interp(self.fine_nm, self.values.knots_nm, x[:n])
        spectrum: FloatArray = between + x[n:] @ self.shapes[basis.width][basis.places]
        return spectrum
