"""Channels whose noise correlates: charge that strays between pixels, rows read together."""

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from labrig.fit import DecayFit, fit_decay
from labrig.foundation.errors import FitError
from tests.fit import truths

RATE = 0.02
CORRELATION = np.array([[1.0, 0.5, 0.1], [0.5, 1.0, 0.45], [0.1, 0.45, 1.0]])


def observed(seed: int) -> truths.Observed:
    """A decay with flicker whose channels scatter together; the middle one is left out once."""
    clean = truths.observe(truths.exponentials((RATE, 1.0)), seed, snr=1e9, flicker=0.004)
    sigma = truths.observe(truths.exponentials((RATE, 1.0)), seed, snr=100).sigma
    rng = np.random.default_rng(seed + 500)
    together = rng.normal(size=sigma.shape) @ np.linalg.cholesky(CORRELATION).T
    noisy = clean.values + sigma * together
    sigma[3, 1] = np.inf
    return truths.Observed(clean.t_s, clean.exposure_s, noisy, sigma)


def fitted(seed: int, correlation: Sequence[Sequence[float]] | np.ndarray | None) -> DecayFit:
    seen = observed(seed)
    return fit_decay(
        seen.t_s,
        seen.values,
        seen.sigma,
        exposure_s=seen.exposure_s,
        channels="RGB",
        n_states=1,
        flicker=None,
        correlation=correlation,
    )


@pytest.mark.campaign
def test_sigma_is_right_where_it_is_known_and_too_small_where_not() -> None:
    def pulls(correlation: np.ndarray | None) -> np.ndarray:
        states = [fitted(seed, correlation).states[0] for seed in range(60)]
        return np.array([(s.k_r_per_s - RATE) / s.k_r_per_s_sigma for s in states])

    known, ignored = pulls(CORRELATION), pulls(None)
    assert 0.8 < known.std() < 1.2
    assert ignored.std() > 1.1 * known.std()


def test_chi2_is_right_where_it_is_known() -> None:
    chi2 = [fitted(seed, CORRELATION).reduced_chi2 for seed in range(12)]
    assert np.mean(chi2) == pytest.approx(1.0, abs=0.1)


def test_independent_channels_are_the_default() -> None:
    one, other = fitted(1, np.eye(3)), fitted(1, None)
    assert one.states == other.states
    assert one.chi2 == other.chi2


@settings(max_examples=10)
@given(st.floats(-0.4, 0.4), st.integers(0, 5))
def test_the_order_of_channels_does_not_matter(r: float, seed: int) -> None:
    seen = observed(seed)
    correlation = np.array([[1.0, r, 0.2], [r, 1.0, 0.0], [0.2, 0.0, 1.0]])
    found = []
    for order in ([0, 1, 2], [2, 0, 1]):
        fit = fit_decay(
            seen.t_s,
            seen.values[:, order],
            seen.sigma[:, order],
            exposure_s=seen.exposure_s,
            channels=[("R", "G", "B")[c] for c in order],
            n_states=1,
            flicker=0.004,
            correlation=correlation[np.ix_(order, order)],
        )
        found.append((fit.states[0].k_r_per_s, fit.states[0].k_r_per_s_sigma))
    assert found[0] == pytest.approx(found[1], rel=1e-6)


@pytest.mark.parametrize(
    "matrix", [np.eye(2), 2 * np.eye(3), np.full((3, 3), 1.0), CORRELATION + np.eye(3, k=1)]
)
def test_what_is_no_correlation(matrix: np.ndarray) -> None:
    with pytest.raises(FitError, match="expected a correlation matrix of 3 channels"):
        fitted(1, matrix)


@pytest.mark.campaign
def test_dark_levels_wrong_in_all_channels_alike() -> None:
    """A sensor that has warmed since its dark frames."""
    dark_sigma, common = 0.004, np.where(np.eye(3), 1.0, 0.99)

    def pulls(offset_correlation: np.ndarray | None) -> np.ndarray:
        found = []
        for seed in range(60):
            seen = truths.observe(truths.exponentials((RATE, 1.0)), seed, snr=150, flicker=0.004)
            wrong_by = dark_sigma * np.random.default_rng(seed + 900).normal()
            state = fit_decay(
                seen.t_s,
                seen.values + wrong_by,
                seen.sigma,
                exposure_s=seen.exposure_s,
                channels="RGB",
                n_states=1,
                flicker=0.004,
                offset_sigma=dark_sigma,
                offset_correlation=offset_correlation,
            ).states[0]
            found.append((state.k_r_per_s - RATE) / state.k_r_per_s_sigma)
        return np.array(found)

    known, ignored = pulls(common), pulls(None)
    assert 0.8 < known.std() < 1.2
    assert ignored.std() > 1.07 * known.std()
