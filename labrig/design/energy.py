"""Materials that emit no more light than they absorb.

A state that is empty captures light at the rate κ, and gives all of it back in the end: π Λ κ, in
all bands together, is at most what is absorbed. That must hold in every band of the light by
itself, since light of that band alone could fall on the material.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.optimize import least_squares

from labrig.design.linear_part import Coefficients
from labrig.design.search import Found, Problem
from labrig.foundation.arrays import FloatArray


def emitted_over_absorbed(
    k_e: FloatArray, reradiation: FloatArray, albedo: FloatArray, energy: FloatArray
) -> FloatArray:
    """Return what weak light of each band makes emit over what is absorbed of it, shape (bands,).

    A state that is empty captures at the rate κ, and in the end gives back π Λ κ, over all bands.

    Parameters
    ----------
    k_e, reradiation
        Excitation rates and Λ, shape (states, bands).
    albedo
        Albedo, shape (bands,).
    energy
        Energy of the unit of light in every band, shape (bands,).
    """
    emitted = np.pi * (reradiation @ energy) @ k_e
    absorbed = (1 - albedo) * energy
    ratio = np.full_like(emitted, np.inf)
    np.divide(emitted, absorbed, out=ratio, where=absorbed > 0)
    return np.where(emitted > 0, ratio, 0.0)


#: Searches for the nearest material that keeps the energy, and evaluations of each.
SEARCHES, EVALUATIONS = 4, 40
#: Relative gain and step of a search that ends it.
MIN_GAIN = 1e-4
#: Powers of the excess by which excitation rates are lowered where a search starts.
LOWERED = (0.0, 0.5, 1.0)
#: Relative change of a coordinate by which slopes are found.
DIFFERENCE = 1e-5
#: Part of an albedo that is left at least where it leaves too little light to be absorbed.
MIN_PART = 0.01


def keeping_energy(
    problem: Problem, ends: Sequence[Found], given_albedo: FloatArray | None, energy: FloatArray
) -> Found:
    """Return the best material that emits no more than it absorbs, from ends of a free search."""
    kept = _Kept(problem, ends[0].order, given_albedo, energy)
    if kept.excess(ends[0].rates, ends[0].coefficients) <= 1:
        return ends[0]
    starts = sorted(_starts(kept, ends), key=kept.cost)[:SEARCHES]
    low, high = kept.bounds
    found = [
        least_squares(
            kept.residuals,
            np.clip(start, low + DIFFERENCE, high - DIFFERENCE),
            bounds=(low, high),
            diff_step=np.full(len(low), DIFFERENCE),
            max_nfev=EVALUATIONS,
            ftol=MIN_GAIN,
            xtol=MIN_GAIN,
        )
        for start in starts
    ]
    return kept.found(min(found, key=lambda fit: float(fit.cost)).x)


class _Kept:
    """The problem with Λ lowered until the energy is kept, in rates and a factor of the albedo."""

    def __init__(
        self,
        problem: Problem,
        order: float,
        given_albedo: FloatArray | None,
        energy: FloatArray,
    ) -> None:
        self.problem = problem
        self._order, self._given, self._energy = order, given_albedo, energy

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Bounds of the coordinates."""
        low, high = self.problem.bounds
        if self._given is not None:
            return low, high
        return np.append(low, MIN_PART), np.append(high, 1.0)

    def start(self, rates: FloatArray) -> FloatArray:
        """Return the coordinates of rates."""
        x = self.problem.coordinates(rates)
        return x if self._given is not None else np.append(x, 1.0)

    def excess(self, rates: FloatArray, coefficients: Coefficients) -> float:
        """Return what is emitted over what is absorbed, in the worst band."""
        groups = self.problem.groups
        k_e = np.where(groups >= 0, rates[:, groups], 0.0)
        albedo = self._given if coefficients.albedo is None else coefficients.albedo
        assert albedo is not None
        ratio = emitted_over_absorbed(k_e, coefficients.reradiation, albedo, self._energy)
        return float(ratio.max(initial=0.0))

    def cost(self, y: FloatArray) -> float:
        """Return the sum of squares."""
        residuals = self.residuals(y)
        return float(residuals @ residuals)

    def residuals(self, y: FloatArray) -> FloatArray:
        """Return the residuals of the keys, and how far rates are from the preferred ones."""
        values, coefficients = self._at(y)
        away = y[: len(self.problem.preferred)] - self.problem.preferred
        of_keys = self.problem.linear.residuals(values, coefficients)
        return np.concatenate([of_keys, self.problem.preference * away])

    def found(self, y: FloatArray) -> Found:
        """Return the material at some coordinates."""
        values, coefficients = self._at(y)
        residuals = self.problem.linear.residuals(values, coefficients)[: self._n_rows]
        rates = self._rates(y)
        order = np.argsort(-rates[:, -1], kind="stable")
        sorted_ = coefficients._replace(reradiation=coefficients.reradiation[order])
        return Found(rates[order], self._order, sorted_, float(residuals @ residuals))

    @property
    def _n_rows(self) -> int:
        return self.problem.linear.n_rows

    def _rates(self, y: FloatArray) -> FloatArray:
        return self.problem.rates(y[: len(self.problem.preferred)])

    def _at(self, y: FloatArray) -> tuple[FloatArray, Coefficients]:
        """Return emissions at the keys (keys, states), and Λ and albedo that keep the energy."""
        x, factor = y[: len(self.problem.preferred)], y[len(self.problem.preferred) :]
        values = self.problem.emission_of(x, self._order).value.T
        best = self.problem.linear.coefficients(values)
        if best.albedo is not None:
            best = best._replace(albedo=best.albedo * factor[0])
        excess = self.excess(self.problem.rates(x), best)
        lowered = best.reradiation / excess if excess > 1 else best.reradiation
        return values, best._replace(reradiation=lowered)


def _starts(kept: _Kept, ends: Sequence[Found]) -> Iterator[FloatArray]:
    """Yield ends of the free search, and the same with less excitation and more Λ."""
    for end in ends:
        excess = kept.excess(end.rates, end.coefficients)
        for power in LOWERED:
            rates = end.rates.copy()
            rates[:, :-1] /= max(excess, 1.0) ** power
            yield kept.start(rates)
