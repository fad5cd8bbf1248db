"""The photon-transfer model: what was put in is found, with no more error than there must be."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from labrig.reduce.photon_transfer import NoiseModel, variance_terms

read_noises = st.floats(0.3, 100.0)
gains = st.floats(0.01, 3.0)
unevens = st.floats(0.0, 1e-4)


@settings(max_examples=30, deadline=None)
@given(read_noises, gains, unevens)
def test_exact_variances_give_the_model_itself(read: float, photon: float, uneven: float) -> None:
    truth = NoiseModel(read, photon, uneven)
    level = np.geomspace(1.0, 10_000.0, 30)
    variance = truth.variance_dn2(level)
    found = NoiseModel.fit(variance_terms(level), variance, sigma_dn2=variance)
    np.testing.assert_allclose(found.variance_dn2(level), variance, rtol=1e-9)
    held = NoiseModel.fit(variance_terms(level), variance, sigma_dn2=variance, read_dn2=read)
    assert held.read_dn2 == read
    assert held.photon_dn == pytest.approx(photon, rel=1e-6)


@settings(max_examples=30, deadline=None)
@given(read_noises, gains, st.integers(0, 10**6))
def test_parts_add_up_and_none_is_negative(read: float, photon: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    level = rng.uniform(-10.0, 5000.0, 12)
    variance = NoiseModel(read, photon).variance_dn2(level) * rng.uniform(0.2, 3.0, 12)
    for columns in (2, 3):
        found = NoiseModel.fit(variance_terms(level)[:, :columns], variance, sigma_dn2=variance)
        parts = found.parts_dn2(level)
        assert (parts >= 0).all()
        np.testing.assert_allclose(parts.sum(axis=-1), found.variance_dn2(level))
        assert found.uneven == 0 or columns == 3


def test_scatter_of_pixels_gives_gain_and_read_noise_within_their_errors() -> None:
    """Variances of 400 pixels each, 7 % uncertain: the gain of 25 levels to 2 %."""
    rng = np.random.default_rng(1)
    level = np.geomspace(5.0, 5000.0, 25)
    gains, reads = [], []
    for _ in range(60):
        electrons = rng.poisson(4.0 * level, (400, len(level)))
        dn = electrons / 4.0 + 3.0 * rng.standard_normal(electrons.shape)
        expected = variance = dn.var(axis=0, ddof=1)
        for _ in range(4):
            found = NoiseModel.fit(variance_terms(level)[:, :2], variance, sigma_dn2=expected)
            expected = found.variance_dn2(level)
        gains.append(1 / found.photon_dn)
        reads.append(np.sqrt(found.read_dn2))
    assert np.mean(gains) == pytest.approx(4.0, rel=0.01)
    assert np.std(gains) < 0.1
    assert np.mean(reads) == pytest.approx(3.0, rel=0.02)
