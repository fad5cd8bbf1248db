"""Which spectra with lines explain some values, and whether there are lines at all.

That there are lines is decided by the evidence of a smooth spectrum with and without one. If so, a
spectrum may be any that is not negative and explains the values: many bases with random places and
one of many widths are fitted, and those that explain the values are drawn from. A line that is
divided between two neighbours, two that are one, and one with wings are among them.

Through a filter whose band is wider, little more is seen of light within a band than its power, its
mean and its width: many lines, few, and a broad one look alike. A *basis* is one way to write such
light: lines of one width in given places, of any power, on a smooth spectrum.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.linalg import solve_triangular, toeplitz
from scipy.special import log_ndtr, logsumexp

from labrig.fit.spectrum.line import line_at_knots
from labrig.fit.spectrum.system import (
    WEIGHTS,
    Prior,
    SpectralSystem,
    Whitened,
    nonnegative_minimum,
    normalised,
)
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


#: Weights besides lines. At the least of them, knots 5 nm apart, the smooth spectrum may bend as
#: much as a band of 40 nm with all the light: what is narrower is a matter of lines.
WEIGHTS_WITH_LINES = WEIGHTS[26::3]
#: Evidence with one line over that without above which there are lines. 150 is called decisive
#: (Kass and Raftery, *Bayes factors*, J. Am. Stat. Assoc. 90, 1995); bands that are steep or have a
#: kink reach that, too, if the system is a little off.
DECISIVE = 1000.0
#: Weights of spectra rougher than any broad band, and their probability above which there are
#: lines, too: of many lines one alone explains little.
ROUGH_WEIGHTS, ROUGH = WEIGHTS[:20], 0.5
#: A line is sought with widths up to this, every so many fine knots, and with these weights.
SOUGHT_FWHM_NM, SOUGHT_EVERY, SOUGHT_WEIGHTS = 5.0, 5, WEIGHTS[::3]
#: Width of the blocks of wavelengths in nm that have lines or not, and the loss of χ² up to which
#: all blocks without lines together may have none; width of the lines of that search in nm.
BLOCK_NM, LOSS, SEARCH_FWHM_NM = 10.0, 6.0, 2.5
#: How far from such a block lines may be, in nm: about a pass band.
MARGIN_NM = 25.0
#: Bases that are tried, and the mean distance of their lines in nm, even in its logarithm.
CANDIDATES, DISTANCE_NM = 300, (1.5, 14.0)
#: Power to which the likelihood of a basis is taken: that of finitely many bases comes no nearer.
TEMPER = 0.5


@dataclass(frozen=True, eq=False)
class WithLines:
    """Where a spectrum has lines.

    Attributes
    ----------
    dense
        Basis with lines side by side, there.
    allowed
        Whether a fine knot may have a line, shape (q,).
    stretches_nm
        First and last wavelength in nm of each stretch that needs lines.
    """

    dense: Basis
    allowed: NDArray[np.bool_]
    stretches_nm: tuple[tuple[float, float], ...]

    def candidates(
        self, problem: Problem, rng: np.random.Generator
    ) -> tuple[list[Basis], FloatArray]:
        """Return bases, and the probability of each by how well it explains the values."""
        bases = [self._candidate(problem, rng) for _ in range(CANDIDATES)]
        cost = np.array([problem.likeliest(basis)[1] for basis in bases])
        return bases, normalised(-TEMPER * cost / 2)

    def _candidate(self, problem: Problem, rng: np.random.Generator) -> Basis:
        fine = problem.fine_nm
        width, weight = int(rng.integers(len(FWHM_NM))), float(rng.choice(WEIGHTS_WITH_LINES))
        distance_nm = float(np.exp(rng.uniform(*np.log(DISTANCE_NM))))
        gaps = distance_nm * rng.uniform(0.5, 1.5, int(2 * np.ptp(fine) / distance_nm))
        nm = fine[0] + np.cumsum(gaps) - distance_nm * rng.random()
        inside = nm[(nm > fine[0]) & (nm < fine[-1])]
        places = np.unique(np.round((inside - fine[0]) / (fine[1] - fine[0])).astype(np.int_))
        return Basis(weight, width, places[self.allowed[places]])


def lines_of(problem: Problem, log_evidence: FloatArray, decisive: float) -> WithLines | None:
    """Return where the spectrum has lines; None if it is explained without.

    Parameters
    ----------
    problem
        Values and prior.
    log_evidence
        Log evidence of each of `WEIGHTS` without lines.
    decisive
        Evidence with one line over that without above which there are lines.
    """
    places, of_one = _evidence_of_one(problem)
    without = logsumexp(log_evidence)
    rough = logsumexp(log_evidence[: len(ROUGH_WEIGHTS)]) - without
    # Evidence is a mean over hypotheses.
    one = logsumexp(of_one) - np.log(of_one.size) - without + np.log(len(WEIGHTS))
    if rough < np.log(ROUGH) and one < np.log(decisive):
        return None
    best = int(places[np.argmax(of_one.max(axis=(0, 1)))])
    return _where(problem, best)


def _sought(problem: Problem) -> Places:
    """Return the fine knots at which lines are sought: a knot from the ends."""
    margin = round((problem.values.knots_nm[1] - problem.values.knots_nm[0]) / _step_nm(problem))
    return np.arange(margin, len(problem.fine_nm) - margin, SOUGHT_EVERY)


def _step_nm(problem: Problem) -> float:
    return float(problem.fine_nm[1] - problem.fine_nm[0])


def _evidence_of_one(problem: Problem) -> tuple[Places, FloatArray]:
    """Return p places and the log evidence (weights, widths, p) with one line of positive power.

    Smooth spectrum and power are integrated out; that the spectrum is not negative is ignored.
    """
    values, places = problem.values, _sought(problem)
    designs = problem.line_designs[FWHM_NM < SOUGHT_FWHM_NM][:, :, places]
    tried = np.moveaxis(designs, 1, 0).reshape(len(values.target), -1)
    direct, length2 = values.target @ tried, (tried**2).sum(axis=0)
    power = float(np.ptp(values.knots_nm))
    logs = []
    for weight in SOUGHT_WEIGHTS.tolist():
        lower = np.linalg.cholesky(
            values.design.T @ values.design + problem.prior.precision(weight)
        )
        of_smooth = solve_triangular(lower, values.design.T, lower=True)
        along, explained = of_smooth @ values.target, of_smooth @ tried
        rest = np.maximum(length2 - (explained**2).sum(axis=0), 0.0)
        information = rest + power**-2
        z = (direct - along @ explained) / np.sqrt(information)
        without = (float(problem.prior.log_determinant(weight)) + along @ along) / 2
        without -= np.log(np.diag(lower)).sum()
        occam = np.log(2) - np.log(information * power**2) / 2
        logs.append(without + z**2 / 2 + occam + log_ndtr(z))
    return places, np.array(logs).reshape(len(logs), -1, len(places))


def _where(problem: Problem, best: int) -> WithLines:
    """Take lines everywhere, and leave out those of as many blocks as hardly make a difference.

    The block of the `best` single line stays.
    """
    fine, places = problem.fine_nm, _sought(problem)
    weight = float(WEIGHTS_WITH_LINES[0])
    width = int(np.argmin(np.abs(FWHM_NM - SEARCH_FWHM_NM)))
    block_of = ((fine - fine[0]) // BLOCK_NM).astype(np.int_)
    powers, least = problem.likeliest(Basis(weight, width, places))
    kept = np.ones(block_of[-1] + 1, dtype=np.bool_)
    light = np.bincount(block_of[places], powers[len(problem.values.knots_nm) :], len(kept))
    for block in np.argsort(light).tolist():
        kept[block] = False
        fewer = places[kept[block_of[places]]]
        basis = Basis(weight, width, fewer) if len(fewer) else smooth(weight)
        kept[block] = problem.likeliest(basis)[1] > least + LOSS
    kept[block_of[best]] = True
    low_nm = fine[0] + BLOCK_NM * np.flatnonzero(kept)
    beside_nm = np.maximum(low_nm[:, np.newaxis] - fine, fine - low_nm[:, np.newaxis] - BLOCK_NM)
    allowed = beside_nm.min(axis=0) < MARGIN_NM
    allowed[: places[0]] = allowed[places[-1] + 1 :] = False
    groups = np.split(low_nm, np.flatnonzero(np.diff(low_nm) > BLOCK_NM) + 1)
    stretches = tuple((float(one[0]), float(one[-1] + BLOCK_NM)) for one in groups)
    return WithLines(Basis(weight, width, places[allowed[places]]), allowed, stretches)
