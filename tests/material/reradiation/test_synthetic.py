"""The samples of the other tests are what they are said to be."""

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal

from tests.material.reradiation.synthetic import (
    BRIGHTENER,
    COMMON_NOISE,
    INPUT_NM,
    ORANGE,
    OUTPUT_NM,
    YELLOW,
    measurement,
    noise,
    noise_sigma,
    skewed,
)


def test_a_seed_is_a_sample() -> None:
    first, same, other = (measurement(seed, YELLOW).measured for seed in (1, 1, 2))
    assert_array_equal(first.to_bands(), same.to_bands())
    assert abs(first.to_bands() - other.to_bands()).max() > 0.01


def test_bands_are_skewed_about_their_peaks() -> None:
    nm = np.arange(400.0, 701.0)
    for skew in (-0.4, 0.4):
        band = skewed(nm, 550.0, 30.0, skew)
        assert nm[band.argmax()] == 550
        assert np.sign(np.average(nm, weights=band) - 550) == np.sign(skew)


def test_one_dye_follows_kashas_rule_and_two_do_not() -> None:
    assert measurement(0, YELLOW).truth.singular_values()[1] < 0.12
    assert measurement(0, BRIGHTENER, ORANGE).truth.singular_values()[1] > 0.3
    assert measurement(0).truth.reradiated_fraction.max() == 0


def test_noise_has_its_sigma_and_its_common_part() -> None:
    rng = np.random.default_rng(0)
    sigma = noise_sigma(rng)
    assert sigma.shape == (len(OUTPUT_NM), len(INPUT_NM))
    pulls = np.array([noise(rng, sigma) for _ in range(200)]) / sigma
    assert_allclose(pulls.std(), 1, atol=0.02)
    assert_allclose(np.mean(pulls[:, 1:] * pulls[:, :-1]), COMMON_NOISE, atol=0.03)
