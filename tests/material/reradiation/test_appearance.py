"""Colours of surfaces under lights, against colour-science and by hand."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from labrig.foundation import colour_science
from labrig.foundation.errors import DataError
from labrig.material import ReradiationMatrix, appearance, compare_colours
from labrig.optics import read_light

colour = colour_science.load()
NM = np.arange(300.0, 781.0, 10.0)


def surface(reflectance: np.ndarray, into: float = 0.0) -> ReradiationMatrix:
    """Reflectance, and a dye that turns 400 nm to 450 nm into 520 nm."""
    values = np.diag(reflectance)
    values[22, 10:16] = into
    return ReradiationMatrix.from_bands("surface", NM, NM, values)


@pytest.mark.parametrize("light", ["D65", "A", "FL2"])
def test_a_reflecting_surface_is_what_colour_science_says(light: str) -> None:
    reflectance = 0.5 + 0.3 * np.sin(NM / 60)
    seen_surface = appearance(surface(reflectance), read_light(light))
    eye = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    power = (
        colour.SDS_ILLUMINANTS[light]
        .copy()
        .interpolate(colour.SpectralShape(360, 780, 1), interpolator=colour.LinearInterpolator)
    )
    nm = power.wavelengths
    by_nm = power.values * np.interp(nm, NM, reflectance)
    functions = eye.copy().trim(colour.SpectralShape(nm[0], nm[-1], 1)).values
    expected = by_nm @ functions / (power.values @ functions[:, 1])
    assert_allclose(seen_surface.xyz, expected, rtol=2e-4)
    assert seen_surface.reradiated_y == 0
    expected_lab = colour.XYZ_to_Lab(expected, colour.XYZ_to_xy(seen_surface.white))
    assert_allclose(seen_surface.lab, expected_lab, atol=0.02)


def test_a_perfect_white_is_white() -> None:
    for light in ("D65", "A", "FL11"):
        white = appearance(surface(np.ones(49)), read_light(light))
        assert_allclose(white.xyz, white.white, rtol=1e-12)
        assert_allclose(white.lab, [100, 0, 0], atol=1e-3)


def test_what_is_reradiated_adds_luminance() -> None:
    plain, dyed = surface(np.full(49, 0.2)), surface(np.full(49, 0.2), 0.3)
    light = read_light("D65")
    without, with_dye = appearance(plain, light), appearance(dyed, light)
    assert_allclose(with_dye.xyz[1] - without.xyz[1], with_dye.reradiated_y, rtol=1e-9)
    assert with_dye.reradiated_y > 0.01
    assert with_dye.lab[1] < -5


def test_a_narrow_light_has_the_white_of_a_screen() -> None:
    dyed = surface(np.full(49, 0.2), 0.3)
    brighter = surface(np.full(49, 0.2), 0.33)
    broad, narrow = compare_colours(brighter, dyed, [read_light("D65"), read_light("450nm")])
    assert (broad.white, narrow.white) == ("light", "D65")
    # Only the re-radiated part differs, by a tenth, and it is nearly all that an eye sees.
    assert 0.03 < narrow.xyz_error < 0.1
    assert 1 < narrow.delta_e < 6
    same = compare_colours(dyed, dyed, [read_light("395nm"), read_light("A")])
    assert [difference.delta_e for difference in same] == [0.0, 0.0]


def test_the_scale_of_the_light_does_not_matter() -> None:
    dyed = surface(np.linspace(0.1, 0.6, 49), 0.2)
    light = read_light("A")
    brighter = type(light)("A", light.wavelength_nm, 7 * light.value)
    assert_allclose(appearance(dyed, light).xyz, appearance(dyed, brighter).xyz)


def test_a_light_that_no_eye_sees_is_refused() -> None:
    with pytest.raises(DataError, match="no"):
        appearance(surface(np.ones(49)), read_light("320nm"))


def test_a_black_reference_has_no_difference_under_a_narrow_light() -> None:
    white, black = (surface(reflectance) for reflectance in (np.ones(49), np.zeros(49)))
    (difference,) = compare_colours(white, black, [read_light("450nm")])
    assert np.isnan(difference.delta_e)
    assert np.isnan(difference.xyz_error)
