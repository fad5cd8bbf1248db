"""Offsets of columns are found where no light is, and taken away with what they add to sums."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

from labrig.foundation.errors import DataError
from labrig.material import (
    ReradiationMatrix,
    instrument_noise,
    with_sigma,
    without_offset,
)
from tests.material.reradiation import bfc450
from tests.material.reradiation.synthetic import (
    INPUT_NM,
    OUTPUT_NM,
    YELLOW,
    measurement,
)

FAR = OUTPUT_NM[:, np.newaxis] > INPUT_NM + 15
#: Columns with an offset that can be found.
FOUND = FAR & (INPUT_NM >= 420)
SUMMED = (INPUT_NM >= 430) & (INPUT_NM <= 600)


def pull_rms(errors: list[NDArray[np.float64]], corrected: list[ReradiationMatrix]) -> float:
    pulls = np.array(errors) / [matrix.reradiation_sigma for matrix in corrected]
    return float(np.sqrt(np.mean(pulls[:, FOUND] ** 2)))


def sum_rms(errors: list[NDArray[np.float64]]) -> float:
    """Root mean square of the error of sums over columns."""
    sums = 10 * np.where(FAR, errors, 0.0).sum(axis=1)
    return float(np.sqrt(np.mean(sums[:, SUMMED] ** 2)))


def test_sums_are_nearer_to_the_truth_and_sigma_is_that_of_what_is_left() -> None:
    before, after, corrected = [], [], []
    for seed in range(40):
        sample = measurement(seed, YELLOW)
        measured = with_sigma(sample.measured)
        corrected.append(without_offset(measured))
        before.append(measured.reradiation - sample.truth.reradiation)
        after.append(corrected[-1].reradiation - sample.truth.reradiation)
    assert sum_rms(after) < 0.6 * sum_rms(before)
    assert_allclose(pull_rms(after, corrected), 1, atol=0.13)


def test_only_columns_with_three_noise_entries_change() -> None:
    measured = with_sigma(measurement(2, YELLOW).measured)
    corrected = without_offset(measured)
    assert measured.reradiation_sigma is not None
    assert corrected.reradiation_sigma is not None
    changed = (corrected.reradiation != measured.reradiation).any(axis=0)
    assert_array_equal(changed, INPUT_NM >= 420)
    assert_allclose(
        corrected.reradiation_sigma / measured.reradiation_sigma,
        np.broadcast_to(np.where(changed, 0.8, 1.0), (41, 49)),
    )
    assert_array_equal(corrected.reflectance, measured.reflectance)
    assert_array_equal(corrected.reflectance_sigma, measured.reflectance_sigma)


def test_an_offset_is_taken_away_on_both_sides() -> None:
    measured = measurement(3, YELLOW).measured
    shifted = measured.reradiation + np.where(INPUT_NM == 600, 3e-4, 0.0)
    clean = [
        without_offset(with_sigma(replace(measured, reradiation=values))).reradiation[:, 30]
        for values in (measured.reradiation, shifted)
    ]
    assert abs(np.mean(clean[1] - clean[0])) < 1e-4


def test_sigma_is_asked_for() -> None:
    with pytest.raises(DataError, match="σ of the re-radiation of 'sample 0'"):
        without_offset(measurement(0).measured)


@pytest.mark.campaign
@pytest.mark.usefixtures("shared_data")
@pytest.mark.parametrize("repeats", [False, True])
def test_real_tiles_have_smaller_sums_and_right_sigma(repeats: bool) -> None:
    tiles = list(bfc450.tiles())
    noise = instrument_noise(tiles[::2]) if repeats else None
    measured = [with_sigma(tile, noise) for tile in tiles[1::4]]
    corrected = [without_offset(tile) for tile in measured]
    after = [tile.reradiation for tile in corrected]
    assert sum_rms(after) < 0.45 * sum_rms([tile.reradiation for tile in measured])
    assert_allclose(pull_rms(after, corrected), 1, atol=0.13)
