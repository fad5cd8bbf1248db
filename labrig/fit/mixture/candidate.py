"""A mixture of some number of components with the least squared error.

Weighted expectation maximisation from several starts, then least squares from the best of them:
the likelihood weighs the faint tails of a dye like its peak, the squared error does not.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from labrig.fit.mixture.entries import StokesEntries, masked_mse, with_integral
from labrig.fit.mixture.gaussians import Gaussians, LikelihoodFit, maximise_likelihood
from labrig.fit.mixture.refinement import NAMES, SKEWED_NAMES, refined, refined_skewed
from labrig.fit.nonlinear_least_squares import Ending, LeastSquaresFit
from labrig.foundation.arrays import FloatArray
from labrig.material import ReradiationMixture

SEED = 2021
#: Widest σ of an added component that is tried, and how often it is halved.
MAX_SD_BANDS, HALVINGS = 4.0, 2
#: Number of entries around which an added component is tried.
MAX_CENTRES = 48


def scattered_starts(
    points: FloatArray, mass: FloatArray, components: int, count: int, least_variance: float
) -> Gaussians:
    """Return mixtures whose means are entries far from one another (k-means++).

    Parameters
    ----------
    points
        Centres [input, output] of the entries, shape (2, N).
    mass
        Light in each entry, at least one of them above 0, shape (N,).
    components
        Number K of components.
    count
        Number B of mixtures.
    least_variance
        Least variance of a component in input and in output.

    References
    ----------
    D. Arthur, S. Vassilvitskii, *k-means++: the advantages of careful seeding*, SODA 2007.
    """
    rng = np.random.default_rng(SEED)
    chosen = np.empty((count, components), dtype=np.intp)
    distance2 = np.full((count, len(mass)), np.inf)
    chance = np.broadcast_to(mass, distance2.shape)
    for k in range(components):
        up_to = np.cumsum(chance, axis=1)
        # With more components than entries of light the later means repeat the first.
        drawn = rng.random(count)[:, np.newaxis] * up_to[:, -1:]
        chosen[:, k] = np.minimum((up_to <= drawn).sum(axis=1), len(mass) - 1)
        off = points[:, np.newaxis] - points[:, chosen[:, k], np.newaxis]
        distance2 = np.minimum(distance2, (off**2).sum(axis=0))
        chance = distance2 * mass
    centre = points @ mass / mass.sum()
    variance = ((points - centre[:, np.newaxis]) ** 2) @ mass / mass.sum()
    spread = np.maximum(variance / components, least_variance)
    shape = (count, components)
    return Gaussians(
        np.full(shape, 1 / components),
        points.T[chosen],
        np.broadcast_to([spread[0], 0.0, spread[1]], (*shape, 3)),
    )


def with_one_more(
    entries: StokesEntries, gaussians: Gaussians, scale: float
) -> tuple[Gaussians, float]:
    """Return one mixture with a component more, where that lessens the error most.

    Parameters
    ----------
    entries
        The entries.
    gaussians, scale
        One mixture, B = 1, and its scale.

    Returns
    -------
    gaussians, scale
        The mixture with a round component around one of the entries, and its scale.
    """
    model = scale * gaussians.density(entries.monomials)[0] * entries.relative_width
    residual = entries.wanted - model
    # Where most is missing, most can be gained.
    lacking = np.argsort(-np.where(entries.is_kept, residual, -np.inf), kind="stable")
    centres = entries.points[:, lacking[: min(MAX_CENTRES, int(entries.is_kept.sum()))]]
    off = entries.points[:, np.newaxis] - centres[:, :, np.newaxis]
    distance2 = (off**2).sum(axis=0)
    best = (-np.inf, 0.0, 0, 0.0)
    sd = MAX_SD_BANDS * entries.band_nm / entries.unit_nm
    shapes = np.exp(-0.5 * distance2 / sd**2)
    weight2 = (entries.weight / entries.weight.max()) ** 2
    for _ in range(HALVINGS + 1):
        norms2 = np.square(shapes) @ weight2
        along = np.maximum(shapes @ (weight2 * residual), 0.0)
        gains = along**2 / norms2
        at = int(np.argmax(gains))
        best = max(best, (float(gains[at]), sd, at, float(along[at] / norms2[at])))
        # Half as wide is the fourth power.
        sd, shapes = sd / 2, np.square(np.square(shapes))
    _, sd, at, height = best
    amount = height * 2 * np.pi * sd**2
    total = scale + amount
    weights = np.append(scale * gaussians.weights[0], amount) / total
    mean = np.concatenate([gaussians.mean[0], centres[:, [at]].T])
    covariance = np.concatenate([gaussians.covariance[0], [[sd**2, 0.0, sd**2]]])
    return Gaussians(weights[np.newaxis], mean[np.newaxis], covariance[np.newaxis]), total


#: Starts of expectation maximisation by light and by its square, which noise far from the dye
#: hardly draws, and how many of the best of either are refined.
STARTS, REFINED_STARTS = 8, 1
MAX_ITERATIONS = 100
#: Gain in mean log-likelihood at which expectation maximisation ends.
TOLERANCE = 1e-4
#: Least σ of a component in bands: a narrower one could hide between their centres.
MIN_SD_BANDS = 0.5


@dataclass(frozen=True, eq=False)
class Candidate:
    """A refined mixture, with the scale of the least squared error.

    Attributes
    ----------
    mixture
        The mixture.
    likelihood_mse
        Masked error of expectation maximisation alone.
    iterations, refinement_iterations, converged
        Course of expectation maximisation and of the refinement.
    at_bound
        Numbers of components of the mixture, from 1, and names of parameters that a bound holds.
    """

    mixture: ReradiationMixture
    likelihood_mse: float
    iterations: int
    refinement_iterations: int
    converged: bool
    at_bound: tuple[tuple[int, str], ...] = ()


def likeliest(entries: StokesEntries, components: int) -> Candidate:
    """Return the mixture of greatest likelihood, with the scale of the integral."""
    least_sd = _least_sd(entries)
    likely = _likely(entries, entries.mass, components, least_sd)
    gaussians, _ = _by_error(entries, likely.gaussians)[0]
    mixture = with_integral(entries, _in_nm(entries, gaussians, 1.0))
    converged = likely.iterations < MAX_ITERATIONS
    return Candidate(mixture, masked_mse(entries, mixture), likely.iterations, 0, converged)


def candidates(
    entries: StokesEntries, first: int, skewed: bool, is_final: bool = True
) -> Iterator[Candidate]:
    """Yield the mixtures of `first` components, of one more, and so on without end.

    Without `is_final` they are only as near to the minimum as tells how good they are.
    """
    least_sd = _least_sd(entries)
    gaussians, scale = _greedy(entries, first - 1, least_sd)
    components = first
    while True:
        likely, starts = _starts(entries, components, least_sd)
        starts.append(with_one_more(entries, gaussians, scale))
        tries = [refined(entries, *start, least_sd, is_final=False) for start in starts]
        gaussians, scale, tried = min(tries, key=lambda attempt: attempt[2].chi2)
        fit, spent = tried, tried.iterations
        if is_final:
            gaussians, scale, fit = refined(entries, gaussians, scale, least_sd, is_final)
            spent += fit.iterations
        likely_mixture = with_integral(entries, _in_nm(entries, starts[0][0], 1.0))
        mixture, weights = _in_nm(entries, gaussians, scale), gaussians.weights
        names: Sequence[str] = NAMES
        if skewed:
            names = SKEWED_NAMES
            medians, amount, skew, fit = refined_skewed(
                entries, gaussians, scale, least_sd, is_final
            )
            mixture = _in_nm(entries, medians, amount, skew)
            weights = medians.weights
            spent += fit.iterations
        yield Candidate(
            mixture,
            masked_mse(entries, likely_mixture),
            likely.iterations,
            spent,
            fit.ending is not Ending.SLOW_PROGRESS,
            _held(fit, weights[0], names),
        )
        components += 1


def _held(
    fit: LeastSquaresFit, weights: FloatArray, names: Sequence[str]
) -> tuple[tuple[int, str], ...]:
    """Return what a bound holds, with the numbers that components have in the mixture."""
    held = fit.at_bound.reshape(-1, len(names))[_order(weights)]
    return tuple(
        (number, name)
        for number, own in enumerate(held.tolist(), start=1)
        for name, is_held in zip(names, own, strict=True)
        if is_held
    )


def _order(weights: FloatArray) -> NDArray[np.intp]:
    """Return the components by falling weight."""
    return np.argsort(-weights, kind="stable")


def _least_sd(entries: StokesEntries) -> float:
    return MIN_SD_BANDS * entries.band_nm / entries.unit_nm


def _greedy(entries: StokesEntries, components: int, least_sd: float) -> tuple[Gaussians, float]:
    """Return a mixture to which one component after the other was added, and its scale."""
    gaussians, scale = Gaussians(np.empty((1, 0)), np.empty((1, 0, 2)), np.empty((1, 0, 3))), 0.0
    for _ in range(components):
        start = with_one_more(entries, gaussians, scale)
        gaussians, scale, _ = refined(entries, *start, least_sd, is_final=False)
    return gaussians, scale


def _starts(
    entries: StokesEntries, components: int, least_sd: float
) -> tuple[LikelihoodFit, list[tuple[Gaussians, float]]]:
    """Return mixtures of greatest likelihood with their scales, the best of all first."""
    likely = _likely(entries, entries.mass, components, least_sd)
    peaked = _likely(entries, entries.mass * entries.value, components, least_sd)
    by_light = _by_error(entries, likely.gaussians)
    by_peaks = _by_error(entries, _square_root(peaked.gaussians))
    return likely, [*by_light[:REFINED_STARTS], *by_peaks[:REFINED_STARTS]]


def _likely(
    entries: StokesEntries, mass: FloatArray, components: int, least_sd: float
) -> LikelihoodFit:
    kept = entries.is_kept
    return maximise_likelihood(
        entries.monomials[:, kept],
        mass[np.newaxis, kept],
        scattered_starts(entries.points[:, kept], mass[kept], components, STARTS, least_sd**2),
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


def _by_error(entries: StokesEntries, starts: Gaussians) -> list[tuple[Gaussians, float]]:
    """Return the mixtures one by one with the scale of the integral, the least error first."""
    model = starts.density(entries.monomials) * entries.relative_width
    scales = entries.mass.sum() / (model @ entries.input_width_nm)
    residuals = entries.weight * (scales[:, np.newaxis] * model - entries.wanted)
    errors = (residuals**2).mean(axis=-1)
    order = np.argsort(errors, kind="stable")
    return [(starts[[index]], float(scales[index])) for index in order]


def _in_nm(
    entries: StokesEntries, gaussians: Gaussians, scale: float, skew: FloatArray | None = None
) -> ReradiationMixture:
    unit = entries.unit_nm
    aa, ab, bb = gaussians.covariance[0].T * unit**2
    order = _order(gaussians.weights[0])
    covariance = np.stack([np.stack([aa, ab], -1), np.stack([ab, bb], -1)], -2)
    return ReradiationMixture(
        scale * unit**2 / float(entries.output_width_nm.mean()),
        gaussians.weights[0][order] / gaussians.weights[0].sum(),
        (entries.origin_nm + gaussians.mean[0] * unit)[order],
        covariance[order],
        None if skew is None else skew[order],
    )
