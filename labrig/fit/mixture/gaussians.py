"""Many mixtures of two-dimensional normal densities at once, in any unit of wavelength.

The log of a normal density is a polynomial of degree 2 in input and output, so that densities, and
the moments of their shares, are products with the table of the six monomials.

Every entry of a matrix is an observation with the light in it as weight (Hua et al. 2021,
section 5.2 and appendix A).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

#: Single or double precision, as the caller wants it.
AnyFloatArray = NDArray[Any]

LOG_2PI = float(np.log(2 * np.pi))
#: Weight below which a component is empty; its logarithm is still finite in single precision.
MIN_WEIGHT = 1e-12
#: Multiplications of a matrix product up to which OpenBLAS takes one thread.
ONE_THREAD = 2**18


@dataclass(frozen=True, eq=False)
class Gaussians:
    """B mixtures of K components.

    Attributes
    ----------
    weights
        Shape (B, K).
    mean
        Means [input, output], shape (B, K, 2).
    covariance
        Variance of the input, covariance, variance of the output, shape (B, K, 3).
    """

    weights: AnyFloatArray
    mean: AnyFloatArray
    covariance: AnyFloatArray

    @classmethod
    def from_moments(cls, moments: AnyFloatArray, least_variance: float) -> "Gaussians":
        """Return those with the sums (B, K, 6) of the monomials, in no direction too narrow."""
        weights = np.maximum(moments[..., 0], MIN_WEIGHT)
        first = moments[..., 1:3] / weights[..., np.newaxis]
        x, y = first[..., 0], first[..., 1]
        second = moments[..., 3:] / weights[..., np.newaxis]
        covariance = second - np.stack([x * x, x * y, y * y], axis=-1)
        return cls(weights, first, _widened(covariance, least_variance))

    def __getitem__(self, chosen: Any) -> "Gaussians":
        """Return the mixtures of some index, slice or indices."""
        return Gaussians(self.weights[chosen], self.mean[chosen], self.covariance[chosen])

    def log_density(self, monomials: AnyFloatArray) -> AnyFloatArray:
        """Return log of weight × density at points of `monomials` (6, N), shape (B, K, N)."""
        aa, ab, bb = _columns(self.covariance)
        x, y = _columns(self.mean)
        determinant = aa * bb - ab * ab
        xx, xy, yy = bb / determinant, -ab / determinant, aa / determinant
        constant = (
            np.log(self.weights)
            - LOG_2PI
            - 0.5 * np.log(determinant)
            - 0.5 * (xx * x * x + 2 * xy * x * y + yy * y * y)
        )
        coefficients = [constant, xx * x + xy * y, xy * x + yy * y, -0.5 * xx, -xy, -0.5 * yy]
        return product(np.stack(coefficients, axis=-1), monomials)

    def density(self, monomials: AnyFloatArray) -> AnyFloatArray:
        """Return the mixtures' densities at points of `monomials` (6, N), shape (B, N)."""
        return np.asarray(np.exp(self.log_density(monomials)).sum(axis=-2))


def product(left: AnyFloatArray, right: AnyFloatArray) -> AnyFloatArray:
    """Return `left` (…, m) @ `right` (m, n) in blocks that are computed by the calling thread.

    A product for each mixture is slow, and one for all is divided among threads, which wait for
    one another where chunks of a texture have a thread each.
    """
    rows = left.reshape(-1, left.shape[-1])
    result = np.empty((len(rows), right.shape[-1]), dtype=np.result_type(left, right))
    height = max(ONE_THREAD // right.size, 1)
    for first in range(0, len(rows), height):
        np.matmul(rows[first : first + height], right, out=result[first : first + height])
    return result.reshape(*left.shape[:-1], right.shape[-1])


def monomials_of(x: AnyFloatArray, y: AnyFloatArray) -> AnyFloatArray:
    """Return the monomials 1, x, y, x², xy, y² of points (N,), shape (6, N)."""
    return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y])


def _columns(array: AnyFloatArray) -> list[AnyFloatArray]:
    return [array[..., column] for column in range(array.shape[-1])]


def _widened(covariance: AnyFloatArray, least: float) -> AnyFloatArray:
    """Return covariances whose eigenvalues are at least `least`."""
    aa, ab, bb = _columns(covariance)
    middle, half = (aa + bb) / 2, (aa - bb) / 2
    radius = np.hypot(half, ab)
    high, low = np.maximum(middle + radius, least), np.maximum(middle - radius, least)
    stretch = (high - low) / np.maximum(2 * radius, np.finfo(covariance.dtype).tiny)
    centre = (high + low) / 2
    return np.stack([centre + stretch * half, stretch * ab, centre - stretch * half], axis=-1)


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
