"""Mixtures fitted to all texels of a texture at once."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.testing import assert_allclose

from labrig.fit import fit_mixture, fit_mixture_texture
from labrig.foundation.errors import UsageError
from labrig.material import ReradiationMatrix, ReradiationMixture

INPUT_NM = np.arange(300.0, 781.0, 10.0)
OUTPUT_NM = np.arange(380.0, 781.0, 10.0)
IS_STOKES = OUTPUT_NM[:, np.newaxis] > INPUT_NM


def texel(rng: np.random.Generator) -> ReradiationMixture:
    """Two dyes away from the diagonal, which would take their nearest light."""
    sd = rng.uniform(12, 18, (2, 2))
    mean = np.array([[360.0, 470], [490, 600]]) + rng.uniform(-15, 15, (2, 2))
    weight = float(rng.uniform(0.3, 0.7))
    return ReradiationMixture(
        float(rng.uniform(1, 40)),
        np.array([weight, 1 - weight]),
        mean,
        sd[:, :, None] ** 2 * np.eye(2),
    )


def texture(seed: int, count: int) -> tuple[list[ReradiationMixture], np.ndarray]:
    rng = np.random.default_rng(seed)
    truth = [texel(rng) for _ in range(count)]
    return truth, np.array([one.to_matrix(INPUT_NM, OUTPUT_NM).reradiation for one in truth])


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_each_texel_has_its_own_mixture(seed: int) -> None:
    truth, reradiation = texture(seed, 5)
    found = fit_mixture_texture(reradiation, INPUT_NM, OUTPUT_NM)
    assert len(found) == 5
    for number, wanted in enumerate(truth):
        light = found[number].to_matrix(INPUT_NM, OUTPUT_NM).reradiation
        assert_allclose(light.sum(), reradiation[number].sum(), rtol=1e-4)
        error = ((light - reradiation[number])[IS_STOKES] ** 2).mean() * 100
        assert_allclose(found.masked_mse[number], error, rtol=1e-2, atol=1e-11)
        order = np.argsort(found[number].mean_nm[:, 0])
        assert_allclose(found[number].mean_nm[order], wanted.mean_nm, atol=6)


def test_texels_do_not_depend_on_their_neighbours() -> None:
    _, reradiation = texture(1, 300)
    together = fit_mixture_texture(reradiation, INPUT_NM, OUTPUT_NM)
    alone = fit_mixture_texture(reradiation[270:271], INPUT_NM, OUTPUT_NM)
    assert_allclose(together[270].mean_nm, alone[0].mean_nm, atol=0.5)
    assert_allclose(together.scale[270], alone.scale[0], rtol=1e-3)


def test_a_texel_has_hardly_more_error_than_expectation_maximisation_alone() -> None:
    _, reradiation = texture(2, 6)
    rng = np.random.default_rng(2)
    noisy = reradiation + 3e-5 * rng.standard_normal(reradiation.shape)
    found = fit_mixture_texture(noisy, INPUT_NM, OUTPUT_NM, threshold=1e-3)
    reflectance = np.full(len(OUTPUT_NM), 0.5)
    for number, table in enumerate(noisy):
        matrix = ReradiationMatrix("", INPUT_NM, OUTPUT_NM, reflectance, table)
        one = fit_mixture(matrix, 2, threshold=1e-3)
        assert found.masked_mse[number] < 1.1 * one.likelihood_mse


def test_dark_texels_and_those_not_measured_are_dark() -> None:
    _, reradiation = texture(3, 4)
    reradiation[1] = 0
    reradiation[2] = np.nan
    found = fit_mixture_texture(reradiation, INPUT_NM, OUTPUT_NM)
    assert (found.scale > 0).tolist() == [True, False, False, True]
    assert found[1].to_matrix(INPUT_NM, OUTPUT_NM).reradiated_fraction.tolist() == [0] * 49
    assert np.isfinite(found.masked_mse).all()
    dark = fit_mixture_texture(np.zeros((2, 41, 49)), INPUT_NM, OUTPUT_NM)
    assert dark.scale.tolist() == [0, 0]


def test_a_texel_of_two_components_takes_52_bytes() -> None:
    _, reradiation = texture(4, 10)
    # Scale, and weight, two means and three covariances of each, of four bytes.
    assert fit_mixture_texture(reradiation, INPUT_NM, OUTPUT_NM).stored_bytes == 10 * 4 * 13


@pytest.mark.parametrize(
    ("shape", "components", "message"),
    [
        ((2, 49, 41), 2, "of shape"),
        ((41, 49), 2, "of shape"),
        ((0, 41, 49), 2, "at least one texel"),
        ((2, 41, 49), 0, "at least 1 component"),
    ],
)
def test_what_is_no_texture_is_refused(
    shape: tuple[int, ...], components: int, message: str
) -> None:
    with pytest.raises(UsageError, match=message):
        fit_mixture_texture(np.zeros(shape), INPUT_NM, OUTPUT_NM, components)
