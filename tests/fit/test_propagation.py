"""Uncertainties of what is computed from fitted parameters."""

import numpy as np
from hypothesis import given, settings, strategies as st

from labrig.fit.nonlinear_least_squares import propagated_covariance


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_it_is_the_scatter_of_transformed_draws(seed: int) -> None:
    rng = np.random.default_rng(seed)
    root, transform = rng.standard_normal((3, 3)), rng.standard_normal((2, 3))
    # Draws whose covariance is exactly root · rootᵀ.
    draws = np.sqrt(3) * np.concatenate([root, -root], axis=1)
    np.testing.assert_allclose(draws @ draws.T / 6, root @ root.T)
    found = propagated_covariance(root @ root.T, transform)
    scattered = (transform @ draws) @ (transform @ draws).T / 6
    np.testing.assert_allclose(found, scattered, atol=1e-9 * np.abs(scattered).max())


def test_what_is_not_determined_spoils_only_what_depends_on_it() -> None:
    covariance = np.array([[4.0, 1.0, 0.0], [1.0, 9.0, 0.0], [0.0, 0.0, np.inf]])
    transform = np.array([[1.0, 1.0, 0.0], [0.0, 1.0, 2.0]])
    assert propagated_covariance(covariance, transform).tolist() == [[15.0, 0.0], [0.0, np.inf]]
