"""Fit of a mixture to a re-radiation matrix.

Entries above the noise, then weighted expectation maximisation from several starts, then least
squares from the best of them (Hua et al., *A compact representation for fluorescent spectral data*,
EGSR 2021, section 5; its last step is the scale).
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from labrig.errors import UsageError
from labrig.fit.least_squares import FloatArray, LeastSquaresFit
from labrig.fit.mixture.entries import FALSE_DISCOVERY_RATE, StokesEntries, stokes_entries
from labrig.fit.mixture.expectation_maximisation import LikelihoodFit, maximise_likelihood
from labrig.fit.mixture.gaussians import Gaussians
from labrig.fit.mixture.refinement import PARAMETERS, refined
from labrig.fit.mixture.result import MixtureCandidate, MixtureFit
from labrig.fit.mixture.starts import scattered_starts, with_one_more
from labrig.material import ReradiationMatrix, ReradiationMixture

Scaling = Literal["integral", "least-squares"]

#: Starts of expectation maximisation by light and by its square, which noise far from the dye
#: hardly draws, and how many of the best of either are refined.
STARTS, REFINED_STARTS = 8, 1
MAX_ITERATIONS = 100
#: Gain in mean log-likelihood at which expectation maximisation ends.
TOLERANCE = 1e-4
#: Least σ of a component in bands: a narrower one could hide between their centres.
LEAST_SD_BANDS = 0.5
#: Largest number of components that "auto" tries.
MOST_COMPONENTS = 6
#: Numbers of components in a row without a lower BIC after which "auto" ends.
PATIENCE = 2


@dataclass(frozen=True, eq=False)
class _Start:
    """A mixture with the scale of the integral, and its masked error."""

    gaussians: Gaussians
    scale: float
    error: float


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A refined mixture in the units of the entries, with free scale."""

    gaussians: Gaussians
    scale: float
    likelihood_mse: float
    iterations: int
    least_squares: LeastSquaresFit


def fit_mixture(
    matrix: ReradiationMatrix,
    components: int | Literal["auto"] = "auto",
    scaling: Scaling = "integral",
    threshold: float | None = None,
) -> MixtureFit:
    """Fit a mixture of normal densities to the re-radiation of a matrix.

    Mixture and matrix are compared at the centres of the bands. The same matrix always gives the
    same mixture.

    Parameters
    ----------
    matrix
        The matrix. Its σ, where it is known, tells which entries are above the noise; the others
        are taken as 0.
    components
        Number of components; "auto" takes that of the least Bayesian information criterion.
    scaling
        "integral" keeps the amount of light, and so the brightness, "least-squares" has the least
        error (equations 4 and 5 of the paper).
    threshold
        Least value per band that is more than noise. Without it, entries are kept of which 5 % are
        expected to be noise.

    Returns
    -------
    MixtureFit
        The mixture, its error, and how both were found.

    Raises
    ------
    UsageError
        There is neither σ nor a threshold, or there are more components than the entries allow.
    DataError
        No entry is above the threshold.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.fit import fit_mixture
    >>> from labrig.material import ReradiationMixture
    >>> dye = ReradiationMixture(
    ...     20.0, np.ones(1), np.array([[460.0, 520.0]]), np.array([[[900.0, 100], [100, 400]]])
    ... )
    >>> matrix = dye.to_matrix(np.arange(300.0, 781, 10), np.arange(380.0, 781, 10))
    >>> fit = fit_mixture(matrix, components=1, threshold=1e-9)
    >>> fit.mixture.mean_nm.round(3).tolist(), round(fit.mixture.scale, 3)
    ([[460.0, 520.0]], 20.0)
    """
    entries = stokes_entries(matrix, threshold)
    kept = int(entries.is_kept.sum())
    most = min(kept, len(entries.value) // PARAMETERS)
    if components != "auto" and not 1 <= components <= most:
        raise UsageError(
            f"expected 1 to {most} components for {kept} entries above the threshold, "
            f"got {components}"
        )
    last = max(min(MOST_COMPONENTS, kept // PARAMETERS), 1) if components == "auto" else components
    best: tuple[MixtureCandidate, _Candidate] | None = None
    tried: list[MixtureCandidate] = []
    first = 1 if components == "auto" else components
    before = _greedy(entries, first - 1)
    for number in range(first, last + 1):
        found = _fit_candidate(entries, number, *before)
        before = found.gaussians, found.scale
        mse = _masked_mse(entries, found.gaussians, found.scale)
        bic = kept * float(np.log(max(mse, np.finfo(np.float64).tiny)))
        tried.append(MixtureCandidate(number, mse, bic + PARAMETERS * number * float(np.log(kept))))
        if best is None or tried[-1].bic < best[0].bic:
            best = tried[-1], found
        elif len(tried) - 1 - tried.index(best[0]) >= PATIENCE:
            break
    assert best is not None
    found = best[1]
    scale = found.scale
    if scaling == "integral":
        scale = _integral_scale(entries, found.gaussians)
    widths = matrix.output_width_nm
    return MixtureFit(
        mixture=_in_nm(entries, found.gaussians, scale),
        scaling=scaling,
        threshold=entries.threshold,
        false_discovery_rate=FALSE_DISCOVERY_RATE if threshold is None else None,
        kept_entries=kept,
        entries=len(entries.value),
        masked_mse=_masked_mse(entries, found.gaussians, scale),
        likelihood_mse=found.likelihood_mse,
        band_nm=float(widths[0]) if np.allclose(widths, widths[0]) else 1.0,
        iterations=found.iterations,
        refinement_iterations=found.least_squares.iterations,
        converged=found.least_squares.converged,
        selection="bic" if components == "auto" else "given",
        candidates=tuple(tried),
    )


def _fit_candidate(
    entries: StokesEntries, components: int, before: Gaussians, before_scale: float
) -> _Candidate:
    """Fit some number of components, given a mixture with one less."""
    least_sd = _least_sd(entries)
    likely = _likely(entries, entries.mass, components, least_sd)
    peaked = _likely(entries, entries.mass * entries.value, components, least_sd)
    by_likelihood = _by_error(entries, likely.gaussians)
    by_peaks = _by_error(entries, _square_root(peaked.gaussians))
    starts = [
        with_one_more(entries, before, before_scale),
        *((start.gaussians, start.scale) for start in by_likelihood[:REFINED_STARTS]),
        *((start.gaussians, start.scale) for start in by_peaks[:REFINED_STARTS]),
    ]
    tries = [refined(entries, *start, least_sd, is_final=False) for start in starts]
    gaussians, scale, tried = min(tries, key=lambda one: one[2].chi2)
    gaussians, scale, fit = refined(entries, gaussians, scale, least_sd, is_final=True)
    fit = replace(fit, iterations=tried.iterations + fit.iterations)
    error = by_likelihood[0].error
    return _Candidate(gaussians, scale, error, likely.iterations, fit)


def _greedy(entries: StokesEntries, components: int) -> tuple[Gaussians, float]:
    """Return a mixture to which one component after the other was added, and its scale."""
    gaussians, scale = Gaussians(np.empty((1, 0)), np.empty((1, 0, 2)), np.empty((1, 0, 3))), 0.0
    for _ in range(components):
        start = with_one_more(entries, gaussians, scale)
        gaussians, scale, _ = refined(entries, *start, _least_sd(entries), is_final=False)
    return gaussians, scale


def _least_sd(entries: StokesEntries) -> float:
    return LEAST_SD_BANDS * entries.band_nm / entries.unit_nm


def _likely(
    entries: StokesEntries, mass: FloatArray, components: int, least_sd: float
) -> LikelihoodFit:
    kept = entries.is_kept
    return maximise_likelihood(
        entries.monomials[:, kept],
        mass[np.newaxis, kept],
        scattered_starts(entries.points[:, kept], mass[kept], components, STARTS),
        least_sd**2,
        MAX_ITERATIONS,
        TOLERANCE,
    )


def _square_root(squares: Gaussians) -> Gaussians:
    """Return the mixtures of which each component's square is one of `squares`."""
    aa, ab, bb = np.moveaxis(squares.covariance, -1, 0)
    weights = np.sqrt(squares.weights * np.sqrt(aa * bb - ab * ab))
    return Gaussians(
        weights / weights.sum(axis=-1, keepdims=True), squares.mean, 2 * squares.covariance
    )


def _by_error(entries: StokesEntries, starts: Gaussians) -> list[_Start]:
    """Return the mixtures one by one, the one of the least error first."""
    each = [starts[[index]] for index in range(len(starts.weights))]
    scales = [_integral_scale(entries, one) for one in each]
    errors = [_masked_mse(entries, one, scale) for one, scale in zip(each, scales, strict=True)]
    found = [_Start(*start) for start in zip(each, scales, errors, strict=True)]
    return sorted(found, key=lambda start: start.error)


def _integral_scale(entries: StokesEntries, gaussians: Gaussians) -> float:
    """Return the scale that keeps the light in all entries (equation 5)."""
    light = gaussians.density(entries.monomials)[0] * entries.relative_width
    return float(entries.mass.sum() / (light @ entries.input_width_nm))


def _masked_mse(entries: StokesEntries, gaussians: Gaussians, scale: float) -> float:
    model = scale * gaussians.density(entries.monomials)[0] * entries.relative_width
    return float(((model - entries.value) ** 2).mean())


def _in_nm(entries: StokesEntries, gaussians: Gaussians, scale: float) -> ReradiationMixture:
    unit = entries.unit_nm
    aa, ab, bb = gaussians.covariance[0].T * unit**2
    order = np.argsort(-gaussians.weights[0])
    covariance = np.stack([np.stack([aa, ab], -1), np.stack([ab, bb], -1)], -2)
    return ReradiationMixture(
        scale * unit**2 / float(entries.output_width_nm.mean()),
        gaussians.weights[0][order] / gaussians.weights[0].sum(),
        (entries.origin_nm + gaussians.mean[0] * unit)[order],
        covariance[order],
    )
