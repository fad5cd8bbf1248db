"""A spectrum from broadband values: non-negative, with the smoothness that the data support.

The values constrain few parameters well, so a prior is needed: p(x) ∝ exp(−w‖D x‖²/2), D the
second differences. Its weight w is not fixed: every draw takes another one, by the evidence
p(values | w). A spectrum with narrow lines therefore comes out rough and with a wide band, a smooth
one smooth and with a narrow one. Values and prior are drawn anew, too, and every draw is the
non-negative spectrum nearest to them: its values may be exactly zero (Bardsley and Hansen, *MCMC
algorithms for computational UQ of nonnegativity constrained linear inverse problems*, SIAM J. Sci.
Comput. 42, 2020; Everink, Dong and Andersen, *Bayesian inference with projected densities*, 2023).

The credible band holds for spectra that are not much narrower than the response of one value.
Lines, such as a mercury lamp's through a filter of 25 nm, come out too broad, by more than their
band; `fit_line` finds the wavelength of a single one.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import LinAlgError, cholesky, lapack, solve_triangular
from scipy.special import logsumexp

from labrig.errors import FitError
from labrig.fit.least_squares import EPSILON, FloatArray
from labrig.fit.spectrum.values import measured
from labrig.fit.spectrum.hypotheses import (
    FWHM_NM, NEGLIGIBLE, Chain, Feature, evidence_of, features_of, finer_design, finer_knots,
)
from labrig.fit.spectrum.system import SpectralSystem
from labrig.nonnegative import nonnegative_least_squares
from labrig.optics import band_means



#: Number of exchanges after which block pivoting counts as cycling.
MAX_EXCHANGES = 25
#: Rounding errors of slopes, and of coordinates relative to the largest.
ROUNDING = 100 * EPSILON
SMALLEST = 1e-9


def nonnegative_minimum(
    curvature: FloatArray, linear: FloatArray, free: NDArray[np.bool_]
) -> FloatArray:
    """Minimise xᵀGx/2 − bᵀx over x ≥ 0, started from the solution of a similar problem.

    Block principal pivoting: all coordinates on the wrong side change sides at once (Júdice and
    Pires, *A block principal pivoting algorithm for large-scale strictly monotone linear
    complementarity problems*, Comput. Oper. Res. 21, 1994). Where that cycles, Lawson and Hanson's
    active sets are used.

    Parameters
    ----------
    curvature, linear
        Positive definite G (n, n) and b (n,).
    free
        Initial guess of the coordinates that are not zero, shape (n,).

    Returns
    -------
    ndarray
        Minimum x, exactly 0 where the bound is active, shape (n,).
    """
    free = free.copy()
    size = np.abs(curvature)
    for _ in range(MAX_EXCHANGES):
        x = np.zeros_like(linear)
        if free.any():
            x[free] = _solved(curvature[free][:, free], linear[free])
        slope = curvature @ x - linear
        slack = ROUNDING * (size @ np.abs(x) + np.abs(linear))
        below = x < -SMALLEST * float(np.abs(x).max(initial=0.0))
        wrong = np.where(free, below, slope < -slack)
        if not wrong.any():
            return np.maximum(x, 0.0)
        free ^= wrong
    upper = cholesky(curvature)
    return nonnegative_least_squares(upper, solve_triangular(upper, linear, trans="T"))


def _solved(curvature: FloatArray, linear: FloatArray) -> FloatArray:
    # SciPy's own Cholesky functions take ten times as long to call as such a system to solve.
    _, solution, info = lapack.dposv(curvature, linear)
    if info:
        raise LinAlgError("expected a positive definite matrix")
    return np.asarray(solution)


SAMPLES = 400
#: Iterations in which the covariance of the design's errors follows the spectrum.
ROUNDS = 3
#: Grid of weights of the prior, for a spectrum of about 1.
WEIGHTS = np.geomspace(1e-4, 1e8, 73)
#: Added to the curvature of the fit, for a spectrum of about 1.
MIN_CURVATURE = 1e-6
SMOOTH_WEIGHTS = WEIGHTS[26::3]


@dataclass(frozen=True, eq=False)
class SpectrumFit:
    """A spectrum with its uncertainty.

    Attributes
    ----------
    knots_nm, value
        Knots in nm and mean of the samples, shape (n,), piecewise linear in between.
    samples
        Draws from the posterior, shape (s, n); all their spread is uncertainty.
    weight
        Median weight of the smoothness prior, for a spectrum scaled to about 1.
    misfit
        Root of χ² per degree of freedom: about 1 if the given σ and the design hold; a larger value
        widens the samples' spread.
    used
        Whether a value was used, shape (m,), bool.
    """

    knots_nm: FloatArray
    value: FloatArray
    samples: FloatArray
    weight: float
    misfit: float
    used: NDArray[np.bool_]
    features: tuple[tuple[Feature, ...], ...] = ()

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

    Raises
    ------
    FitError
        There are too few values, or none above its noise.
    """
    used, part, y, s = measured(value, sigma, system)
    white_response = part.design.sum(axis=1)
    scale = float(y @ white_response) / float(white_response @ white_response)
    roughness = _second_differences(part.knots_nm)
    rng = np.random.default_rng(seed)
    x, misfit, features = np.full(len(part.knots_nm), scale), 1.0, ()
    for _ in range(ROUNDS):
        values = _whitened(part, y, misfit * s, x / scale, scale)
        chain = _chain_of(values, roughness, features, np.random.default_rng(seed))
        features = tuple(chain.features) if chain else ()
        x, ratio = _likeliest(values, roughness, chain)
        x, misfit = x * scale, max(1.0, misfit * ratio)
    if chain is None:
        drawn = _smooth_hypotheses(values, roughness, samples, rng)
    else:
        drawn = [_Drawn(float(SMOOTH_WEIGHTS[h.weight]), h.features)
                 for h in sorted(chain.draw(samples), key=lambda h: h.weight)]
    draws = _draw(values, roughness, drawn, rng)
    knots_nm = values.fine_nm if draws.shape[1] > len(part.knots_nm) else part.knots_nm
    return SpectrumFit(
        knots_nm, draws.mean(axis=0) * scale, draws * scale,
        float(np.median([one.weight for one in drawn])), misfit, used,
        tuple(one.features for one in drawn),
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Whitened:
    """Values (m,) and their designs, in units of their total error, for a spectrum of about 1."""

    target: FloatArray
    design: FloatArray
    fine_design: FloatArray
    knots_nm: FloatArray
    fine_nm: FloatArray


def _whitened(
    system: SpectralSystem, y: FloatArray, s: FloatArray, spectrum: FloatArray, scale: float
) -> _Whitened:
    covariance = np.diag((s / scale) ** 2) + system.covariance(spectrum)
    lower = np.linalg.cholesky(covariance)
    fine = finer_design(system.design, system.knots_nm)
    solution = np.linalg.solve(lower, np.column_stack([y / scale, system.design, fine]))
    n = len(system.knots_nm)
    return _Whitened(
        solution[:, 0], solution[:, 1 : n + 1], solution[:, n + 1 :],
        system.knots_nm, finer_knots(system.knots_nm),
    )  # fmt: skip


def _chain_of(
    values: _Whitened,
    roughness: FloatArray,
    features: tuple[Feature, ...],
    rng: np.random.Generator,
) -> Chain | None:
    """Return a chain of hypotheses with lines, settled; None if lines are out of the question."""
    prior = roughness.T @ roughness
    evidence = evidence_of(
        values.design, values.target, values.fine_design, values.fine_nm,
        prior, _ridge(prior), SMOOTH_WEIGHTS,
    )  # fmt: skip
    log_none = _log_evidence(values.design, values.target, prior)
    rough = logsumexp(log_none[: WEIGHTS.searchsorted(SMOOTH_WEIGHTS[0])])
    one = evidence.log_odds_of_one() + np.log(len(WEIGHTS))
    if not features and max(rough, one) < logsumexp(log_none) + np.log(NEGLIGIBLE):
        return None
    chain = Chain(evidence, rng, features=list(features) or _sparse_features(values, evidence, roughness))
    chain.settle()
    return chain


def _sparse_features(values, evidence, roughness) -> list[Feature]:
    low, high = evidence.range_nm
    grid_nm = np.arange(low, high, 2.5)
    lines = tuple(Feature(float(nm), FWHM_NM[0] / 2.355) for nm in grid_nm)
    design, curvature = _with_features(values, roughness, 100.0, lines)
    x = nonnegative_minimum(curvature, design.T @ values.target, np.ones(len(curvature), dtype=np.bool_))
    n = len(values.knots_nm)
    return features_of(x[n:], grid_nm)


def _second_differences(knots_nm: FloatArray) -> FloatArray:
    """Return the second differences of values on an even grid as a matrix (n − 2, n)."""
    n = len(knots_nm)
    return np.diff(np.eye(n), n=2, axis=0)


def _log_evidence(design: FloatArray, target: FloatArray, prior: FloatArray) -> FloatArray:
    """Return the log evidence of each of `WEIGHTS`, ignoring x ≥ 0."""
    information, linear = design.T @ design, design.T @ target
    log_evidence = np.empty(len(WEIGHTS))
    for number, weight in enumerate(WEIGHTS):
        lower = np.linalg.cholesky(information + weight * prior + _ridge(prior))
        along = solve_triangular(lower, linear, lower=True)
        log_determinant = 2 * float(np.log(np.diag(lower)).sum())
        rank = len(prior) - 2
        log_evidence[number] = (rank * np.log(weight) - log_determinant + along @ along) / 2
    return log_evidence


def _weights(design: FloatArray, target: FloatArray, prior: FloatArray) -> FloatArray:
    """Return the probability of each of `WEIGHTS` under a flat prior."""
    log_evidence = _log_evidence(design, target, prior)
    probability = np.exp(log_evidence - log_evidence.max())
    normalised: FloatArray = probability / probability.sum()
    return normalised


def _likeliest(
    values: _Whitened, roughness: FloatArray, chain: Chain | None
) -> tuple[FloatArray, float]:
    """Return the spectrum at the most probable weight, and the root of χ² per degree of freedom.

    Lines are taken as the chain has them.
    """
    features = tuple(chain.features) if chain else ()
    if chain is None:
        weight = float(WEIGHTS[np.argmax(_weights(values.design, values.target, roughness.T @ roughness))])
    else:
        weight = float(SMOOTH_WEIGHTS[chain.weight])
    design, curvature = _with_features(values, roughness, weight, features)
    free = np.ones(len(curvature), dtype=np.bool_)
    x = nonnegative_minimum(curvature, design.T @ values.target, free)
    free = x > 0
    leverage = np.linalg.solve(
        curvature[np.ix_(free, free)], (design.T @ design)[np.ix_(free, free)]
    )
    residual = values.target - design @ x
    dof = max(len(values.target) - float(np.trace(leverage)) - 2 * len(features), 1.0)
    n = len(values.knots_nm)
    lines = np.zeros(n)
    for power, one in zip(x[n:], features, strict=True):
        lines += power * one.at_knots(values.knots_nm)
    return x[:n] + lines, float(np.sqrt(residual @ residual / dof))


def _with_features(
    values: _Whitened, roughness: FloatArray, weight: float, features: tuple[Feature, ...]
) -> tuple[FloatArray, FloatArray]:
    """Return the design of the smooth spectrum and the features' powers, and the curvature."""
    shapes = [values.fine_design @ one.at_knots(values.fine_nm) for one in features]
    design = np.column_stack([values.design, *shapes])
    n = len(values.knots_nm)
    curvature = design.T @ design
    curvature[:n, :n] += weight * roughness.T @ roughness + _ridge(roughness.T)
    power = float(values.knots_nm[-1] - values.knots_nm[0])
    curvature[range(n, len(curvature)), range(n, len(curvature))] += power**-2
    return design, curvature


@dataclass(frozen=True, eq=False)
class _Drawn:
    """A weight of the smoothness prior and features."""

    weight: float
    features: tuple[Feature, ...]


def _smooth_hypotheses(
    values: _Whitened, roughness: FloatArray, samples: int, rng: np.random.Generator
) -> list[_Drawn]:
    probability = _weights(values.design, values.target, roughness.T @ roughness)
    return [_Drawn(float(one), ()) for one in np.sort(rng.choice(WEIGHTS, samples, p=probability))]


def _draw(
    values: _Whitened, roughness: FloatArray, drawn: list[_Drawn], rng: np.random.Generator
) -> FloatArray:
    """Return (s, q) spectra, one for each hypothesis; on the knots of lines if there are any."""
    n = len(values.knots_nm)
    any_lines = any(one.features for one in drawn)
    draws = np.empty((len(drawn), len(values.fine_nm) if any_lines else n))
    free = np.ones(n, dtype=np.bool_)
    for number, one in enumerate(drawn):
        design, curvature = _with_features(values, roughness, one.weight, one.features)
        linear = design.T @ (values.target + rng.standard_normal(len(values.target)))
        linear[:n] += np.sqrt(one.weight) * roughness.T @ rng.standard_normal(len(roughness))
        start = np.concatenate([free[:n], np.ones(len(one.features), dtype=np.bool_)])
        x = nonnegative_minimum(curvature, linear, start)
        free = x > 0
        if not any_lines:
            draws[number] = x
            continue
        draws[number] = np.interp(values.fine_nm, values.knots_nm, x[:n])
        for power, feature in zip(x[n:], one.features, strict=True):
            draws[number] += power * feature.at_knots(values.fine_nm)
    return draws


def _ridge(prior: FloatArray) -> FloatArray:
    """Return a ridge that fixes what neither the values nor the prior constrain."""
    return MIN_CURVATURE * np.eye(len(prior))
