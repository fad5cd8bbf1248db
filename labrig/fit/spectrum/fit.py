"""A spectrum from broadband values: non-negative, with the smoothness that the data support.

The values constrain few parameters well, so a prior is needed: p(x) ∝ exp(−w‖D x‖²/2), D the
second differences. Its weight w is not fixed: every draw takes another one, by the evidence
p(values | w). A spectrum with narrow lines therefore comes out rough and with a wide band, a smooth
one smooth and with a narrow one. Values and prior are drawn anew, too, and every draw is the
non-negative spectrum nearest to them: its values may be exactly zero (Bardsley and Hansen, *MCMC
algorithms for computational UQ of nonnegativity constrained linear inverse problems*, SIAM J. Sci.
Comput. 42, 2020; Everink, Dong and Andersen, *Bayesian inference with projected densities*, 2023).

Where that is rougher than any broad band, or a line explains the values better, there are lines on
the smooth spectrum (`hypotheses`): how many, where, and how broad is drawn anew for every draw,
too, so that the band of a line is as wide as what the values leave open. Without lines nothing of
this happens. Where several lines share a pass band, fewer are found than there are, and errors may
exceed the band.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import LinAlgError, cholesky, lapack, solve_triangular
from scipy.special import logsumexp

from labrig.fit.least_squares import EPSILON, FloatArray
from labrig.fit.spectrum.evidence import evidence_of
from labrig.fit.spectrum.feature import (
    FWHM_NM,
    Feature,
    features_of,
    finer_design,
    finer_knots,
)
from labrig.fit.spectrum.hypotheses import FIRST, Chain, Hypothesis
from labrig.fit.spectrum.line import FWHM_OVER_SIGMA
from labrig.fit.spectrum.system import SpectralSystem
from labrig.fit.spectrum.values import measured
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
#: Weights besides lines. At the least of them, knots 5 nm apart, the smooth spectrum may bend as
#: much as a band of 40 nm with all the light: what is narrower is a matter of lines.
WEIGHTS_WITH_LINES = WEIGHTS[26::3]
#: Probability of lines below which there are none.
NEGLIGIBLE = 0.01
#: Lines with which a first solution is found: their distance in knots, and the weight besides.
FIRST_LINES, FIRST_WEIGHT = 0.5, 100.0
#: Parameters of a feature besides its power.
PARAMETERS = 2
#: Full width at half maximum in nm below which a feature is a line; how far its wavelength may
#: differ from draw to draw; and the least fraction of the draws that have it.
NARROW_FWHM_NM, SAME_LINE_NM, CERTAIN = 20.0, 2.0, 0.9


@dataclass(frozen=True)
class NarrowLine:
    """A line, or lines too close to be told apart.

    Attributes
    ----------
    wavelength_nm, fwhm_nm
        Mean wavelength and full width at half maximum in nm, medians of the draws.
    """

    wavelength_nm: float
    fwhm_nm: float


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
    lines
        Lines narrower than 20 nm that nearly all draws have, by wavelength.
    """

    knots_nm: FloatArray
    value: FloatArray
    samples: FloatArray
    weight: float
    misfit: float
    used: NDArray[np.bool_]
    lines: tuple[NarrowLine, ...] = ()

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
    prior = _Prior.on(len(part.knots_nm))
    x, misfit = np.full(len(part.knots_nm), scale), 1.0
    features: tuple[Feature, ...] = ()
    chain = None
    for number in range(ROUNDS):
        values = _whitened(part, y, misfit * s, x / scale, scale)
        log_evidence = prior.log_evidence(values)
        if number == 0 or chain is not None:
            chain = _chain_of(values, prior, log_evidence, features, seed)
        likeliest = (
            _Drawn(float(WEIGHTS[np.argmax(log_evidence)]), ())
            if chain is None
            else _Drawn.by(chain.hypothesis)
        )
        features = likeliest.features
        x, ratio = _likeliest(values, prior, likeliest)
        x, misfit = x * scale, max(1.0, misfit * ratio)
    rng = np.random.default_rng(seed)
    if chain is None:
        weights = np.sort(rng.choice(WEIGHTS, samples, p=_normalised(log_evidence)))
        drawn = [_Drawn(weight, ()) for weight in weights.tolist()]
    else:
        drawn = [_Drawn.by(one) for one in chain.draw(samples)]
    draws = _draw(values, prior, drawn, rng) * scale
    knots_nm = part.knots_nm if draws.shape[1] == len(part.knots_nm) else values.fine_nm
    weight = float(np.median([one.weight for one in drawn]))
    every = [feature for one in drawn for feature in one.features]
    return SpectrumFit(
        knots_nm, draws.mean(axis=0), draws, weight, misfit, used, _lines(every, samples)
    )


@dataclass(frozen=True, eq=False)
class _Whitened:
    """Values (m,) and their designs in units of their total error, for a spectrum of about 1."""

    target: FloatArray
    design: FloatArray
    knots_nm: FloatArray
    fine_design: FloatArray
    fine_nm: FloatArray


def _whitened(
    system: SpectralSystem, y: FloatArray, s: FloatArray, spectrum: FloatArray, scale: float
) -> _Whitened:
    covariance = np.diag((s / scale) ** 2) + system.covariance(spectrum)
    lower = np.linalg.cholesky(covariance)
    fine_design = finer_design(system.design, system.knots_nm)
    columns = np.column_stack([y / scale, system.design, fine_design])
    solution = np.linalg.solve(lower, columns)
    last = len(system.knots_nm) + 1
    return _Whitened(
        solution[:, 0], solution[:, 1:last], system.knots_nm,
        solution[:, last:], finer_knots(system.knots_nm),
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Prior:
    """Smoothness prior: its roughness matrix (n − 2, n)."""

    roughness: FloatArray

    @classmethod
    def on(cls, knots: int) -> "_Prior":
        return cls(np.diff(np.eye(knots), n=2, axis=0))

    def precision(self, weight: float) -> FloatArray:
        """Return the precision (n, n), with a ridge for what nothing else constrains."""
        matrix = weight * self.roughness.T @ self.roughness
        matrix.flat[:: len(matrix) + 1] += MIN_CURVATURE
        return matrix

    def log_determinant(self, weight: ArrayLike) -> FloatArray:
        """Return the logarithm of the precision's determinant, up to a constant."""
        result: FloatArray = len(self.roughness) * np.log(np.asarray(weight, dtype=np.float64))
        return result

    def log_evidence(self, values: _Whitened) -> FloatArray:
        """Return the log evidence of each of `WEIGHTS` without lines, ignoring x ≥ 0."""
        information, linear = values.design.T @ values.design, values.design.T @ values.target
        log_evidence = np.empty(len(WEIGHTS))
        for number, weight in enumerate(WEIGHTS):
            lower = np.linalg.cholesky(information + self.precision(weight))
            along = solve_triangular(lower, linear, lower=True)
            log_determinant = 2 * float(np.log(np.diag(lower)).sum())
            log_evidence[number] = (along @ along - log_determinant) / 2
        return log_evidence + self.log_determinant(WEIGHTS) / 2


def _normalised(log_probability: FloatArray) -> FloatArray:
    probability = np.exp(log_probability - log_probability.max())
    normalised: FloatArray = probability / probability.sum()
    return normalised


@dataclass(frozen=True)
class _Drawn:
    """A weight of the smoothness prior, and features."""

    weight: float
    features: tuple[Feature, ...]

    @classmethod
    def by(cls, hypothesis: Hypothesis) -> "_Drawn":
        return cls(float(WEIGHTS_WITH_LINES[hypothesis.weight]), hypothesis.features)


def _chain_of(
    values: _Whitened,
    prior: _Prior,
    log_evidence: FloatArray,
    features: tuple[Feature, ...],
    seed: int,
) -> Chain | None:
    """Return a settled chain of hypotheses with lines; None if there are hardly any.

    Features as broad as the pass band serve to describe lights of many lines only.
    """
    evidence = evidence_of(
        values.target, values.design, values.fine_design, values.fine_nm,
        [prior.precision(weight) for weight in WEIGHTS_WITH_LINES],
        prior.log_determinant(WEIGHTS_WITH_LINES),
    )  # fmt: skip
    starts = [list(features)]
    if not features:
        # Rougher than anything without lines, or explained better by one.
        rough = logsumexp(log_evidence[: WEIGHTS.searchsorted(WEIGHTS_WITH_LINES[0])])
        tried, of_one = evidence.of_one_feature()
        of_lines = of_one[:, [feature.fwhm_nm < NARROW_FWHM_NM for feature in tried]]
        one = logsumexp(of_lines) + np.log(FIRST * len(WEIGHTS) / of_lines.size)
        if max(rough, one) < logsumexp(log_evidence) + np.log(NEGLIGIBLE):
            return None
        best = tried[int(np.argmax(of_one.max(axis=0)))]
        starts = [[best], _first_features(values, prior, evidence.range_nm)]
    chains = [Chain(evidence, start, np.random.default_rng(seed)) for start in starts]
    for chain in chains:
        chain.climb()
    best_chain = max(chains, key=lambda chain: chain.log_posterior)
    best_chain.settle()
    narrow = any(one.fwhm_nm < NARROW_FWHM_NM for one in best_chain.hypothesis.features)
    return best_chain if narrow else None


def _first_features(
    values: _Whitened, prior: _Prior, range_nm: tuple[float, float]
) -> list[Feature]:
    """Return features with which to start: a smooth spectrum and lines everywhere, none negative.

    Few of the lines are not zero, and those that are side by side belong together.
    """
    grid_nm = np.arange(*range_nm, FIRST_LINES * float(np.diff(values.knots_nm)[0]))
    width_nm = FWHM_NM[0] / FWHM_OVER_SIGMA
    lines = _Drawn(FIRST_WEIGHT, tuple(Feature(nm, width_nm) for nm in grid_nm.tolist()))
    design, curvature = _problem(values, prior, lines)
    free = np.ones(len(curvature), dtype=np.bool_)
    x = nonnegative_minimum(curvature, design.T @ values.target, free)
    return features_of(x[len(values.knots_nm) :], grid_nm)


def _lines(features: Sequence[Feature], samples: int) -> tuple[NarrowLine, ...]:
    """Return the narrow lines that nearly all draws have, of the features of all draws."""
    narrow = sorted(
        (one for one in features if one.fwhm_nm < NARROW_FWHM_NM), key=lambda f: f.wavelength_nm
    )
    nm = np.array([one.wavelength_nm for one in narrow])
    found = []
    for group in np.split(np.arange(len(nm)), np.flatnonzero(np.diff(nm) > SAME_LINE_NM) + 1):
        if len(group) > CERTAIN * samples:
            fwhm_nm = float(np.median([narrow[k].fwhm_nm for k in group]))
            found.append(NarrowLine(float(np.median(nm[group])), fwhm_nm))
    return tuple(found)


def _problem(values: _Whitened, prior: _Prior, drawn: _Drawn) -> tuple[FloatArray, FloatArray]:
    """Return the design of the smooth spectrum and the features' powers, and the curvature."""
    n = len(values.knots_nm)
    shapes = [one.seen_by(values.fine_design, values.fine_nm) for one in drawn.features]
    design = np.column_stack([values.design, *shapes])
    curvature = design.T @ design
    curvature[:n, :n] += prior.precision(drawn.weight)
    powers = np.arange(n, len(curvature))
    curvature[powers, powers] += float(values.knots_nm[-1] - values.knots_nm[0]) ** -2
    return design, curvature


def _likeliest(values: _Whitened, prior: _Prior, likeliest: _Drawn) -> tuple[FloatArray, float]:
    """Return the spectrum on the knots, and the root of χ² per degree of freedom."""
    design, curvature = _problem(values, prior, likeliest)
    free = np.ones(len(curvature), dtype=np.bool_)
    x = nonnegative_minimum(curvature, design.T @ values.target, free)
    free = x > 0
    leverage = np.linalg.solve(
        curvature[np.ix_(free, free)], (design.T @ design)[np.ix_(free, free)]
    )
    residual = values.target - design @ x
    taken = float(np.trace(leverage)) + PARAMETERS * len(likeliest.features)
    dof = max(len(values.target) - taken, 1.0)
    n = len(values.knots_nm)
    spectrum = x[:n].copy()
    for power, one in zip(x[n:], likeliest.features, strict=True):
        spectrum += power * one.at_knots(values.knots_nm)
    return spectrum, float(np.sqrt(residual @ residual / dof))


def _draw(
    values: _Whitened, prior: _Prior, drawn: Sequence[_Drawn], rng: np.random.Generator
) -> FloatArray:
    """Return a spectrum for each hypothesis, on the knots of lines if any has some."""
    n = len(values.knots_nm)
    with_lines = any(one.features for one in drawn)
    draws = np.empty((len(drawn), len(values.fine_nm) if with_lines else n))
    free = np.ones(n, dtype=np.bool_)
    for number, one in enumerate(drawn):
        design, curvature = _problem(values, prior, one)
        linear = design.T @ (values.target + rng.standard_normal(len(values.target)))
        expected = prior.roughness.T @ rng.standard_normal(len(prior.roughness))
        linear[:n] += np.sqrt(one.weight) * expected
        lines_free = np.ones(len(one.features), dtype=np.bool_)
        x = nonnegative_minimum(curvature, linear, np.concatenate([free[:n], lines_free]))
        free = x > 0
        if not with_lines:
            draws[number] = x
            continue
        draws[number] = np.interp(values.fine_nm, values.knots_nm, x[:n])
        for power, feature in zip(x[n:], one.features, strict=True):
            draws[number] += power * feature.at_knots(values.fine_nm)
    return draws
