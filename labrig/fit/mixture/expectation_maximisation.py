"""Weighted expectation maximisation of many mixtures at once.

Every entry of a matrix is an observation with the light in it as weight (Hua et al. 2021,
section 5.2 and appendix A).
"""

from dataclasses import dataclass

import numpy as np

from labrig.fit.mixture.gaussians import AnyFloatArray, Gaussians, product


@dataclass(frozen=True, eq=False)
class LikelihoodFit:
    """Mixtures of greatest likelihood.

    Attributes
    ----------
    gaussians
        B mixtures.
    iterations
        Number of iterations, the same of all.
    """

    gaussians: Gaussians
    iterations: int


def maximise_likelihood(
    monomials: AnyFloatArray,
    mass: AnyFloatArray,
    start: Gaussians,
    least_variance: float,
    max_iterations: int,
    tolerance: float,
) -> LikelihoodFit:
    """Maximise Σ mass · log p, until the mean log-likelihood of none gains `tolerance`.

    Parameters
    ----------
    monomials
        Monomials of the entries, shape (6, N).
    mass
        Light in the entries, one row for each mixture or one for all, shape (B, N) or (1, N); no
        row is 0 throughout.
    start
        B mixtures.
    least_variance
        Variance in any direction below which the grid does not resolve a component.
    max_iterations, tolerance
        When to stop.
    """
    share = mass / mass.sum(axis=-1, keepdims=True)
    gaussians, before, iterations = start, np.asarray(-np.inf), 0
    while iterations < max_iterations:
        iterations += 1
        log_density = gaussians.log_density(monomials)
        # Far from all components every density may underflow, but not that of the nearest one.
        nearest = log_density.max(axis=-2)
        log_density -= nearest[..., np.newaxis, :]
        relative = np.exp(log_density, out=log_density)
        total = relative.sum(axis=-2)
        relative *= (share / total)[..., np.newaxis, :]
        gaussians = Gaussians.from_moments(product(relative, monomials.T), least_variance)
        likelihood = ((nearest + np.log(total)) * share).sum(axis=-1)
        if (likelihood - before < tolerance).all():
            break
        before = likelihood
    return LikelihoodFit(gaussians, iterations)
