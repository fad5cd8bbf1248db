from collections.abc import Callable

import numpy as np
import pytest

from labrig.foundation.errors import DataError
from labrig.reduce import RawFrame, fit_dark, hot_pixels

MakeRaw = Callable[..., RawFrame]


def test_level_and_uncertainty_over_exposure() -> None:
    """Against the closed form of a straight line through two points per end."""
    exposure_s = np.array([1.0, 1.0, 16.0, 16.0])
    truth = np.array([2.0, 2.5]) + exposure_s[:, np.newaxis] * np.array([0.5, 0.1])
    model = fit_dark(exposure_s, truth, np.full((4, 2), 0.2))
    for at_s in (1.0, 5.0, 16.0):
        level, sigma = model.dark_level(at_s)
        assert level == pytest.approx(np.array([2.0, 2.5]) + at_s * np.array([0.5, 0.1]))
        spread = 0.25 + (at_s - 8.5) ** 2 / (4 * 7.5**2)
        assert sigma == pytest.approx(0.2 * np.sqrt(spread))


def test_uncertainty_covers_the_truth() -> None:
    exposure_s = np.repeat([0.5, 2.0, 8.0], 3)
    sigma = np.full((9, 1), 0.3)
    pulls = []
    for seed in range(400):
        noise = np.random.default_rng(seed).normal(0, sigma)
        level, of_level = fit_dark(
            exposure_s, 4 + 0.2 * exposure_s[:, None] + noise, sigma
        ).dark_level(4.0)
        pulls.append((level[0] - 4.8) / of_level[0])
    # χ² above its expectation raises σ, so that pulls are a little narrow.
    assert 0.8 < np.std(pulls) < 1.05


def test_frames_that_scatter_more_than_they_say_count_less() -> None:
    level = np.array([[1.0], [3.0], [1.0], [3.0]])
    _, sigma = fit_dark(np.ones(4), level, np.full((4, 1), 0.01)).dark_level(1.0)
    # 68.27 % of Student's distribution with three degrees of freedom are within 1.197.
    assert sigma == pytest.approx(1.197 * np.std(level, ddof=1) / 2, rel=1e-3)


@pytest.mark.parametrize("exposures_s", [(1.0, 2.0, 4.0), (1.0, 1.0, 4.0, 4.0, 16.0, 16.0)])
def test_sigma_of_a_level_that_drifts_is_that_of_so_few_frames(
    exposures_s: tuple[float, ...],
) -> None:
    """A drift three times the frames' σ; 68 % of the errors are within σ, 1.2 % of 1500 apart."""
    exposure_s, within = np.array(exposures_s), []
    for seed in range(1500):
        rng = np.random.default_rng([41, len(exposures_s), seed])
        level = 0.2 + 0.01 * exposure_s[:, None]
        level = level + 0.03 * rng.standard_normal(level.shape)
        model = fit_dark(exposure_s, level, np.full(level.shape, 0.01))
        value, sigma = model.dark_level(exposures_s[-1])
        within.append(abs(value[0] - 0.2 - 0.01 * exposures_s[-1]) < sigma[0])
    assert np.mean(within) == pytest.approx(0.683, abs=0.04)


def test_one_exposure_holds_there_only() -> None:
    model = fit_dark(np.array([2.0, 2.01]), np.array([[5.0], [7.0]]), np.ones((2, 1)))
    level, sigma = model.dark_level(2.0)
    assert (level[0], model.only_exposure_s) == (6, 2.005)
    # √(1/2), raised by χ² = 2 of one degree of freedom, of which 68.27 % are within 1.837.
    assert sigma[0] == pytest.approx(1.837, rel=1e-3)
    with pytest.raises(DataError, match=r"got only 2\.005 s"):
        model.dark_level(4.0)


def test_no_dark_frames() -> None:
    with pytest.raises(DataError, match="got none"):
        fit_dark(np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3)))


def test_hot_pixels_are_those_bright_in_two_frames(make_raw: MakeRaw) -> None:
    rng = np.random.default_rng(2)
    glow = 1000 + 50 * np.linspace(0, 1, 120) ** 2  # brighter towards the amplifier: not hot
    hot = np.zeros((80, 120), bool)
    hot[5, 7] = hot[40, 60] = hot[40, 62] = hot[79, 119] = hot[0, 0] = True
    darks = []
    for _ in range(3):
        pixels = rng.normal(glow, 3, (80, 120))
        pixels[hot] += 200
        pixels[rng.integers(80), rng.integers(120)] += 5000  # a cosmic ray
        darks.append(make_raw(pixels))
    assert np.array_equal(hot_pixels(darks), hot)


def test_hot_pixels_need_two_frames_of_one_size(make_raw: MakeRaw) -> None:
    dark = make_raw(np.full((20, 20), 1000))
    with pytest.raises(DataError, match="2 or more"):
        hot_pixels([dark])
    with pytest.raises(DataError, match="one size and sensor"):
        hot_pixels([dark, make_raw(np.full((20, 20), 1000), cfa="BGGR")])
    with pytest.raises(DataError, match="one size"):
        hot_pixels([dark, make_raw(np.full((20, 22), 1000))])
