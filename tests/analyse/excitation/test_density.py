"""Largest optical density of a sample, by what is known of it."""

import numpy as np
import pytest

from labrig.calibration import PatchReflectance
from labrig.protocols.excitation.analysis.material import largest_density
from labrig.results import PRIOR_DENSITY, DensityBasis

BANDS_NM = (400.0, 450.0, 500.0, 700.0)


def reflectance(*albedo: float, sigma: float = 0.01) -> PatchReflectance:
    return PatchReflectance(
        wavelength_nm=(425.0, 475.0, 600.0),
        albedo=albedo,
        albedo_sigma=(sigma,) * 3,
        radiance_factor=albedo,
        radiance_factor_sigma=(sigma,) * 3,
        common_sigma=0.0,
    )


def test_without_a_measurement_the_back_may_get_a_hundredth_of_the_light() -> None:
    density, basis = largest_density(BANDS_NM, None, None)
    assert density.tolist() == 3 * [PRIOR_DENSITY]
    assert basis is DensityBasis.PRIOR


def test_an_albedo_bounds_each_band() -> None:
    density, basis = largest_density(BANDS_NM, None, reflectance(0.52, 0.92, 1.02))
    assert density == pytest.approx([-np.log10(0.5), -np.log10(0.9), 0.0])
    assert basis is DensityBasis.REFLECTANCE


def test_a_black_sample_is_not_bounded() -> None:
    density, basis = largest_density(BANDS_NM, None, reflectance(0.0, 0.5, 0.5))
    assert density[0] == pytest.approx(PRIOR_DENSITY)
    assert basis is DensityBasis.PRIOR


def test_the_protocol_goes_before_a_reflectance() -> None:
    density, basis = largest_density(BANDS_NM, 0.3, reflectance(0.99, 0.99, 0.99))
    assert density.tolist() == [0.3, 0.3, 0.3]
    assert basis is DensityBasis.STATED
