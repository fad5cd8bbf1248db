"""Start values of mixtures, the same for the same entries."""

import numpy as np

from labrig.fit.mixture.entries import StokesEntries
from labrig.fit.mixture.gaussians import Gaussians
from labrig.foundation.arrays import FloatArray

SEED = 2021
#: Widest σ of an added component that is tried, and how often it is halved.
WIDEST_SD_BANDS, HALVINGS = 4.0, 2
#: Number of entries around which an added component is tried.
MOST_CENTRES = 48


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
    centres = entries.points[:, lacking[: min(MOST_CENTRES, int(entries.is_kept.sum()))]]
    off = entries.points[:, np.newaxis] - centres[:, :, np.newaxis]
    distance2 = (off**2).sum(axis=0)
    best = (-np.inf, 0.0, 0, 0.0)
    sd = WIDEST_SD_BANDS * entries.band_nm / entries.unit_nm
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
