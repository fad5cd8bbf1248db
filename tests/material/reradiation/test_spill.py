"""Spill beside the diagonal is found in each matrix and taken away."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

from labrig.material import ReradiationMatrix, with_sigma, without_spill
from tests.material.reradiation.synthetic import (
    ABOVE_DIAGONAL,
    BELOW_DIAGONAL,
    BRIGHTENER,
    INPUT_NM,
    ORANGE,
    OUTPUT_NM,
    YELLOW,
    Dye,
    measurement,
)

SAMPLES = {"tile": (), "one dye": (YELLOW,), "two dyes": (BRIGHTENER, ORANGE)}


def above(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(matrix[ABOVE_DIAGONAL] * 10)


@pytest.mark.parametrize("dyes", SAMPLES.values(), ids=SAMPLES)
@pytest.mark.parametrize("level", [0.0, 0.007, 0.06])
def test_what_is_left_is_within_sigma(dyes: tuple[Dye, ...], level: float) -> None:
    before, after = [], []
    for seed in range(15):
        sample = measurement(seed, *dyes, common=0.0, spill_level=level)
        measured = with_sigma(sample.measured)
        clean = without_spill(measured)
        assert measured.reradiation_sigma is not None
        assert clean.reradiation_sigma is not None
        truth = above(sample.truth.reradiation)
        before.append((above(measured.reradiation) - truth) / above(measured.reradiation_sigma))
        after.append((above(clean.reradiation) - truth) / above(clean.reradiation_sigma))
        assert (clean.reradiation[BELOW_DIAGONAL] == 0).all()
    assert 0.75 < np.sqrt(np.mean(np.square(after))) < 1.15
    assert abs(np.mean(after)) < 0.15
    if level == 0.06:
        assert np.sqrt(np.mean(np.square(before))) > 5


def test_only_the_neighbours_of_the_diagonal_change() -> None:
    measured = with_sigma(measurement(4, YELLOW).measured)
    clean = without_spill(measured)
    other = ~(ABOVE_DIAGONAL | BELOW_DIAGONAL)
    assert_array_equal(clean.reflectance, measured.reflectance)
    assert_array_equal(clean.reradiation[other], measured.reradiation[other])
    assert measured.reradiation_sigma is not None
    assert clean.reradiation_sigma is not None
    assert_array_equal(
        clean.reradiation_sigma[~ABOVE_DIAGONAL], measured.reradiation_sigma[~ABOVE_DIAGONAL]
    )
    moved = abs(clean.reradiation - measured.reradiation)[ABOVE_DIAGONAL]
    grown = clean.reradiation_sigma**2 - measured.reradiation_sigma**2
    # At 370 nm of input there is no reflectance.
    parts = np.concatenate([[0.0], np.full(39, 0.2), [0.8]])
    assert_allclose(np.sqrt(grown[ABOVE_DIAGONAL]), parts * moved, atol=1e-7)


def test_a_matrix_without_spill_stays_as_it_is() -> None:
    truth = measurement(1, YELLOW, ORANGE).truth
    assert_array_equal(without_spill(truth).reradiation, truth.reradiation)


def test_one_strange_wavelength_spoils_no_other() -> None:
    measured = measurement(2, YELLOW).measured
    bad = measured.to_bands()
    bad[20, 29] += 0.2
    clean, spoilt = (
        without_spill(ReradiationMatrix.from_bands("", INPUT_NM, OUTPUT_NM, values)).reradiation
        for values in (measured.to_bands(), bad)
    )
    assert abs(clean - spoilt).max() * 10 < 5e-4


def test_bands_without_common_neighbours_have_no_spill_to_find() -> None:
    measured = measurement(2, YELLOW).measured
    other = measured.rebinned(INPUT_NM + 3, OUTPUT_NM)
    assert without_spill(other) is other


@settings(max_examples=25, deadline=None)
@given(
    slope=st.floats(0, 0.2),
    mean=st.floats(0, 0.1),
    seed=st.integers(0, 99),
    bands=st.integers(10, 41),
)
def test_exact_spill_is_taken_away_exactly(
    slope: float, mean: float, seed: int, bands: int
) -> None:
    rng = np.random.default_rng(seed)
    nm = 400 + np.cumsum(rng.uniform(5, 15, bands))
    curve = rng.uniform(0, 1, bands)
    parts = slope * np.diff(curve), mean * (curve[1:] + curve[:-1]) / 2
    values = np.diag(curve) + np.diag(parts[0] + parts[1], 1)
    values -= np.diag(0.5 * parts[0] + 0.63 * parts[1], -1)
    clean = without_spill(ReradiationMatrix.from_bands("", nm, nm, values))
    assert_allclose(clean.to_bands(), np.diag(curve), atol=1e-9)
