"""Paths of single wavelengths and folds agree with the exact light of a furnace and of a plane."""

import numpy as np
import pytest

from tests.acceptance.wavelength_noise import (
    BANDS,
    CHUNK,
    Draw,
    cases,
    furnace,
    made_up,
    measured,
    single_wavelengths,
)

PAPER = made_up()
CASES = cases(PAPER)


@pytest.mark.parametrize(
    ("case", "method", "paths"),
    [
        ("furnace", "4 wavelengths", 2 * CHUNK),
        ("sphere", "4 wavelengths", 4 * CHUNK),
        ("plane, even lamp", "1 wavelength", 4 * CHUNK),
        ("plane, lamp of 1 nm", "4 wavelengths, balanced", 4 * CHUNK),
    ],
)
def test_single_wavelengths_have_the_mean_of_the_exact_light(
    case: str, method: str, paths: int
) -> None:
    exact, methods = CASES[case]
    found = measured(methods[method], exact, paths, seed=len(case) + len(method))
    error = found.light - exact.reshape(BANDS, -1).mean(axis=1)
    is_lit = found.sigma > 0
    assert abs(found.bias) < 3
    assert abs(error.sum()) < 3 * np.sqrt((found.sigma**2).sum())
    assert np.sqrt(np.mean((error[is_lit] / found.sigma[is_lit]) ** 2)) < 1.4


def test_folds_have_the_mean_of_the_bands_light() -> None:
    exact, methods = CASES["furnace"]
    found = measured(methods["fold, 24 bands"], exact, 4 * CHUNK, seed=3)
    of_bands = np.linalg.solve(np.eye(BANDS) - PAPER.fold, np.ones(BANDS))
    assert (np.abs(found.light - of_bands) < 4 * found.sigma).all()
    # What bands of 20 nm cost: light of a band that excites only a part of it.
    assert abs(found.bias_part) < 0.01


def test_a_tenth_less_of_the_reflected_light_would_be_seen() -> None:
    exact, _ = CASES["furnace"]
    right = single_wavelengths(furnace(PAPER), 4)

    def wrong(rng: np.random.Generator, paths: int) -> tuple[np.ndarray, np.ndarray, int]:
        started, light, vertices = right(rng, paths)
        return started, 1 + 0.9 * (light - 1), vertices

    draw: Draw = wrong
    assert measured(draw, exact, 4 * CHUNK, seed=5).bias < -3
