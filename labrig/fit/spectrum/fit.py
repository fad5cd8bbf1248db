"""A spectrum from broadband values: non-negative, with the smoothness that the data support.

The values constrain few parameters well, so a prior is needed: p(x) ∝ exp(−w‖D x‖²/2), D the
second differences. Its weight w is not fixed: every draw takes another one, by the evidence
p(values | w). A spectrum with narrow lines therefore comes out rough and with a wide band, a smooth
one smooth and with a narrow one. Values and prior are drawn anew, too, and every draw is the
non-negative spectrum nearest to them: its values may be exactly zero (Bardsley and Hansen, *MCMC
algorithms for computational UQ of nonnegativity constrained linear inverse problems*, SIAM J. Sci.
Comput. 42, 2020; Everink, Dong and Andersen, *Bayesian inference with projected densities*, 2023).

Where a line explains the values better, every draw has lines besides, in other places and of
another width (`lines`): the band of a line is as wide as what the values leave open, and what they
say of the sum of neighbouring lines stays in the covariance.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from labrig.fit.spectrum.lines import DECISIVE, Basis, Problem, WithLines, lines_of, smooth
from labrig.fit.spectrum.system import (
    WEIGHTS,
    Prior,
    SpectralSystem,
    Whitened,
    measured,
    nonnegative_minimum,
    normalised,
)
from labrig.foundation.arrays import FloatArray
from labrig.optics import band_means

SAMPLES = 400
#: Iterations in which the covariance of the design's errors follows the spectrum.
ROUNDS = 3


@dataclass(frozen=True, eq=False)
class SpectrumFit:
    """A spectrum with its uncertainty.

    Attributes
    ----------
    knots_nm, value
        Knots in nm and mean of the samples, shape (n,), piecewise linear in between; those of the
        system, or finer ones where there are lines.
    samples
        Draws from the posterior, shape (s, n); all their spread is uncertainty.
    weight
        Median weight of the smoothness prior, for a spectrum scaled to about 1.
    misfit
        Root of χ² per degree of freedom: about 1 if the given σ and the design hold; a larger value
        widens the samples' spread.
    used
        Whether a value was used, shape (m,), bool.
    lines_nm
        First and last wavelength in nm of each stretch in which there are lines narrower than the
        responses, how many is open.
    """

    knots_nm: FloatArray
    value: FloatArray
    samples: FloatArray
    weight: float
    misfit: float
    used: NDArray[np.bool_]
    lines_nm: tuple[tuple[float, float], ...] = ()

    def in_bands(self, edges_nm: ArrayLike, level: float = 0.6827) -> "BandedSpectrum":
        """Average over neighbouring bands, with their credible interval.

        Parameters
        ----------
        edges_nm
            Rising edges in nm, shape (b + 1,).
        level
            Probability that the true value is in the interval, for each band.
        """
        draws = band_means(self.knots_nm, self.samples.T, edges_nm)
        low, high = np.quantile(draws, [(1 - level) / 2, (1 + level) / 2], axis=1)
        value = band_means(self.knots_nm, self.value, edges_nm)
        edges = np.asarray(edges_nm, dtype=np.float64)
        return BandedSpectrum(edges, value, draws.std(axis=1, ddof=1), low, high)


@dataclass(frozen=True, eq=False)
class BandedSpectrum:
    """Means over (b,) bands between (b + 1,) `edges_nm`, σ, and limits of a credible interval."""

    edges_nm: FloatArray
    value: FloatArray
    sigma: FloatArray
    low: FloatArray
    high: FloatArray


def fit_spectrum(
    value: ArrayLike,
    sigma: ArrayLike,
    system: SpectralSystem,
    *,
    samples: int = SAMPLES,
    seed: int = 0,
    decisive: float = DECISIVE,
    stiffest: float = np.inf,
    is_local: bool = False,
) -> SpectrumFit:
    """Fit the spectrum that explains some values.

    Parameters
    ----------
    value, sigma
        Values of the system and one standard deviation of their noise, shape (m,). A value that is
        NaN (clipped, missing) is left out.
    system
        Design matrix and its errors.
    samples
        Number of draws.
    seed
        Seed of the draws: the same values give the same spectrum.
    decisive
        Evidence of a narrow line over that of none from which the spectrum has lines; inf where
        there can be none, as in the sensitivity of a channel.
    stiffest
        Largest weight of the smoothness prior, for a spectrum of about 1. Where most of a curve is
        straight, its evidence would be for a prior that is too stiff for a bend elsewhere.
    is_local
        Whether the spectrum may be smoother in one place than in another, as one with an edge is.

    Raises
    ------
    FitError
        There are too few values, or none above its noise.
    """
    used, part, y, s = measured(value, sigma, system)
    white_response = part.design.sum(axis=1)
    scale = float(y @ white_response) / float(white_response @ white_response)
    prior = Prior.on(len(part.knots_nm))
    flat = np.full(len(part.knots_nm), scale)

    def weighed(problem: Problem) -> FloatArray:
        """Return the log evidence of each of `WEIGHTS`, −inf of those that are too large."""
        return np.where(stiffest >= WEIGHTS, prior.log_evidence(problem.values), -np.inf)

    def settled(x: FloatArray, lines: WithLines | None) -> tuple[Problem, FloatArray, float]:
        """Return the problem with the errors of a spectrum that it yields, that, and the misfit."""
        misfit = 1.0
        for _ in range(ROUNDS):
            problem = Problem(Whitened.of(part, y, misfit * s, x / scale, scale), part, prior)
            log_evidence = weighed(problem)
            smoothest = smooth(float(WEIGHTS[np.argmax(log_evidence)]))
            basis = smoothest if lines is None else lines.dense
            x, ratio = _likeliest(problem, basis)
            x, misfit = x * scale, max(1.0, misfit * ratio)
        return problem, x, misfit

    problem, x, misfit = settled(flat, None)
    if is_local:
        weight = float(WEIGHTS[np.argmax(weighed(problem))])
        prior = prior.local(problem.values, weight, stiffest)
        problem, x, misfit = settled(x, None)
    log_evidence = weighed(problem)
    lines = None if np.isinf(decisive) else lines_of(problem, log_evidence, decisive)
    if lines is not None:
        problem, x, misfit = settled(x, lines)
    rng = np.random.default_rng(seed)
    if lines is None:
        weights = np.sort(rng.choice(WEIGHTS, samples, p=normalised(log_evidence)))
        bases = [smooth(weight) for weight in weights.tolist()]
        knots_nm = part.knots_nm
    else:
        tried, probability = lines.candidates(problem, rng)
        bases = [tried[k] for k in rng.choice(len(tried), samples, p=probability)]
        knots_nm = problem.fine_nm
    draws = _draw(problem, bases, rng)
    if lines is not None:
        pairs = zip(bases, draws, strict=True)
        spectra = np.array([problem.on_knots(basis, drawn) for basis, drawn in pairs]) * scale
    else:
        spectra = np.array(draws) * scale
    return SpectrumFit(
        knots_nm, spectra.mean(axis=0), spectra, float(np.median([one.weight for one in bases])),
        misfit, used, () if lines is None else lines.stretches_nm,
    )  # fmt: skip


def _likeliest(problem: Problem, basis: Basis) -> tuple[FloatArray, float]:
    """Return the spectrum on the knots, and the root of χ² per degree of freedom."""
    values = problem.values
    design, curvature = problem.matrices(basis)
    x, _ = problem.likeliest(basis)
    free = x > 0
    leverage = np.linalg.solve(
        curvature[np.ix_(free, free)], (design.T @ design)[np.ix_(free, free)]
    )
    residual = values.target - design @ x
    dof = max(len(values.target) - float(np.trace(leverage)), 1.0)
    spectrum = x
    if len(basis.places):
        spectrum = np.interp(values.knots_nm, problem.fine_nm, problem.on_knots(basis, x))
    return spectrum, float(np.sqrt(residual @ residual / dof))


def _draw(problem: Problem, bases: Sequence[Basis], rng: np.random.Generator) -> list[FloatArray]:
    """Return smooth spectrum and powers, one draw for each basis."""
    values, roughness = problem.values, problem.prior.roughness
    n = len(values.knots_nm)
    draws = []
    free = np.ones(n, dtype=np.bool_)
    for basis in bases:
        design, curvature = problem.matrices(basis)
        linear = design.T @ (values.target + rng.standard_normal(len(values.target)))
        expected = roughness.T @ rng.standard_normal(len(roughness))
        linear[:n] += np.sqrt(basis.weight) * expected
        powers_free = np.ones(len(basis.places), dtype=np.bool_)
        draws.append(
            nonnegative_minimum(curvature, linear, np.concatenate([free[:n], powers_free]))
        )
        free = draws[-1] > 0
    return draws
