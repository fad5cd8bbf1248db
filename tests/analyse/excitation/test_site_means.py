"""Means over sites a few pixels wide, from means over the pixels of each colour."""

import numpy as np
import pytest

from labrig.protocols.excitation.analysis.charging_series import site_means, site_weights
from labrig.reduce import SensorLayout
from tests.analyse.excitation.bench import true_irradiance


def glow(position: np.ndarray) -> np.ndarray:
    """A band that falls by half from site to site, above a little leakage."""
    return np.asarray(np.exp(-0.5 * ((position - 0.3) / 0.09) ** 2) + 0.01)


@pytest.mark.parametrize(("width", "height"), [(96, 64), (192, 128), (384, 48)])
def test_a_steep_glow_is_that_of_the_sites_in_all_colours(width: int, height: int) -> None:
    irradiance = true_irradiance(width, height)
    strip, layout = irradiance.lvf_strip(), SensorLayout(width, height, "RGGB")
    slices = strip.slices()
    about = np.linspace(-0.5, 0.5, 101)
    left, right = (end[0] * width for end in (strip.left, strip.right))
    measured = np.empty((31, 3))
    for number, region in enumerate(slices.values()):
        first, weights = layout.column_weights(region)
        columns = first + np.arange(weights.shape[1]) + 0.5
        along = 1 - (columns[:, None] + about - left) / (right - left)  # falling to the right
        measured[number] = weights @ glow(along).mean(axis=1)
    sites = glow(np.array(irradiance.position)[:, None] + about / 31).mean(axis=1)
    weights = site_weights(slices, irradiance, layout)
    sigma, usable = 0.01 * measured[None], np.ones((1, 31), bool)
    means, mean_sigma = site_means(measured[None], sigma, usable, weights)
    inner = slice(1, -1)
    off = np.abs(means[0, inner] / sites[inner, None] - 1)
    assert off.max() < 0.02
    assert off.max() < 0.2 * np.abs(measured[inner] / sites[inner, None] - 1).max()
    assert np.median(mean_sigma / sigma) == pytest.approx(1.0, abs=0.2)


def test_a_site_that_rests_on_a_clipped_neighbour_is_not_known() -> None:
    weights = np.tile(np.eye(4), (3, 1, 1))
    weights[1, 1, 2] = 0.2  # of one colour
    values = np.ones((1, 4, 3))
    usable = np.array([[True, True, False, True]])
    means, sigma = site_means(values, values, usable, weights)
    assert np.isfinite(means[0]).all(axis=1).tolist() == [True, False, False, True]
    assert np.isnan(sigma[0, 1]).all()
