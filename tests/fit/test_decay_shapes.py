"""Exposure-averaged decays against numerical integration and differences."""

import numpy as np
import pytest

from labrig.foundation.arrays import FloatArray
from labrig.material import exponential_means, exponential_means_and_slopes
from tests.fit import truths

T_S = np.array([0.0, 0.3, 5.0, 50.0, 175.0])
EXPOSURE_S = np.array([0.0, 1e-3, 0.5, 2.0, 5.0])


@pytest.mark.parametrize("rate", [1e-5, 0.003, 0.02, 0.5, 3.0])
def test_exponential_mean_is_the_integral(rate: float) -> None:
    mean = exponential_means(np.array([rate]), T_S, EXPOSURE_S)[:, 0]
    expected = truths.exposed(truths.exponentials((rate, 1.0)), T_S, EXPOSURE_S)
    np.testing.assert_allclose(mean, expected, rtol=1e-13)


@pytest.mark.parametrize("exposure_s", [np.zeros(5), EXPOSURE_S])
@pytest.mark.parametrize("rate", [1e-5, 0.003, 0.02, 0.5])
def test_exponential_slope_is_the_difference(rate: float, exposure_s: FloatArray) -> None:
    def mean(log_rate: float) -> FloatArray:
        return exponential_means(np.array([np.exp(log_rate)]), T_S, exposure_s)[:, 0]

    means, slopes = exponential_means_and_slopes(np.array([rate]), T_S, exposure_s)
    np.testing.assert_array_equal(means[:, 0], mean(float(np.log(rate))))
    step = 1e-4
    difference = (mean(np.log(rate) + step) - mean(np.log(rate) - step)) / (2 * step)
    np.testing.assert_allclose(slopes[:, 0], difference, rtol=1e-6, atol=1e-12)


def test_mean_of_a_short_exposure_tends_to_the_moment() -> None:
    rates = np.array([0.02, 0.5])
    moment = exponential_means(rates, T_S, np.zeros(5))
    np.testing.assert_allclose(exponential_means(rates, T_S, np.full(5, 1e-12)), moment, rtol=1e-11)


@pytest.mark.parametrize("exposure_s", [1e30, 1e100, 1e300])
def test_an_absurdly_long_exposure_sees_nothing_and_warns_of_nothing(exposure_s: float) -> None:
    means, slopes = exponential_means_and_slopes(
        np.array([1e3]), np.zeros(1), np.array([exposure_s])
    )
    np.testing.assert_allclose([means, slopes], 0.0, atol=1e-30)
