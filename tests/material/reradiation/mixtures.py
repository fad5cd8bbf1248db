"""Mixtures drawn at random."""

import numpy as np

from labrig.material import ReradiationMixture


def random_mixture(seed: int, components: int = 3) -> ReradiationMixture:
    """Components of 3 to 60 nm, some of them across the diagonal; of every other seed skewed."""
    rng = np.random.default_rng(seed)
    sd = rng.uniform(3, 60, (components, 2))
    ab = rng.uniform(-0.9, 0.9, components) * sd.prod(axis=1)
    weights = rng.dirichlet(np.ones(components))
    mean = rng.uniform([350, 430], [550, 650], (components, 2))
    covariance = np.array(
        [[[s**2, c], [c, t**2]] for (s, t), c in zip(sd, ab, strict=True)],
    )
    scale, skew = float(rng.uniform(1, 50)), rng.uniform(-1.2, 1.2, (components, 2))
    return ReradiationMixture(scale, weights, mean, covariance, skew if seed % 2 else None)
