"""Mercury lines along a strip and its place by them, in frames made pixel by pixel."""

from dataclasses import replace

import numpy as np
import pytest

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError, FitError
from labrig.optics import Spectrum, Strip, nominal_lvf
from labrig.protocols.lvf_calibration.analysis import (
    place_on_sample,
    shifted_by_stripes,
    strip_lines,
    wavelengths_along,
)
from labrig.reduce.hdr import hdr_frame
from labrig.reduce.strip import find_strip, strip_profile
from tests.analyse.lvf_calibration.strip_pictures import (
    TRUE_MAP,
    Scene,
    bracket,
    halogen,
    mercury,
)

SMALL = Scene(96, 64)
MIDDLE = Scene(240, 160)


def true_nm(scene: Scene, strip: Strip, position: FloatArray) -> FloatArray:
    """Wavelength that the scene really has at positions of a strip, from its blue end."""
    fraction = position if strip.rising else 1 - position
    left, right = np.array(strip.left), np.array(strip.right)
    x, y = ((left + np.outer(fraction, right - left)) * [scene.width, scene.height]).T
    angle = np.radians(scene.tilt_degrees)
    across = (x - scene.width / 2) * np.cos(angle) + (y - scene.height / 2) * np.sin(angle)
    along = across / (scene.length * scene.width) + 0.5
    return TRUE_MAP.wavelength_nm(along if scene.rising else 1 - along)


@pytest.mark.parametrize("rising", [True, False])
@pytest.mark.parametrize("scene", [replace(MIDDLE, tilt_degrees=2.0), SMALL], ids=["", "small"])
def test_lines_tell_the_wavelength_along_the_strip(scene: Scene, rising: bool) -> None:
    scene = replace(scene, rising=rising)
    strip = find_strip(bracket(scene, halogen())).strip(rising=True)
    found = strip_lines(strip_profile(bracket(scene, mercury(), (0.5, 4.0)), strip), strip, None)
    assert found.strip.rising is rising
    fitted = wavelengths_along(found)
    position = np.linspace(0, 1, 9)
    off = fitted.map.wavelength_nm(position) - true_nm(scene, found.strip, position)
    assert (np.abs(off) < 3 * fitted.map.sigma_nm(position) + 0.3).all()
    assert np.abs(off[:6]).max() < 1.2


def test_a_strip_the_wrong_way_round_is_refused() -> None:
    strip = find_strip(bracket(MIDDLE, halogen())).strip(rising=True)
    profile = strip_profile(bracket(MIDDLE, mercury(), (0.5, 4.0)), strip)
    strip_lines(profile, strip, rising=True)
    with pytest.raises(FitError, match="the strip is the wrong way round"):
        strip_lines(profile, strip, rising=False)


def test_light_without_lines_is_refused() -> None:
    frame = bracket(MIDDLE, halogen())
    strip = find_strip(frame).strip(rising=True)
    with pytest.raises(FitError, match="no lines of mercury"):
        strip_lines(strip_profile(frame, strip), strip, None)


def test_the_strip_on_the_sample_is_placed_by_its_lines() -> None:
    before = replace(MIDDLE, tilt_degrees=1.0)
    strip = find_strip(bracket(before, halogen())).strip(rising=True)
    wavelengths = wavelengths_along(
        strip_lines(strip_profile(bracket(before, mercury(), (0.5, 4.0)), strip), strip, None)
    )
    on_sample = replace(MIDDLE, length=0.72, rising=False, tilt_degrees=-1.0)
    strip = find_strip(bracket(on_sample, halogen())).strip(rising=True)
    lines = strip_lines(
        strip_profile(bracket(on_sample, mercury(), (0.5, 4.0)), strip), strip, None
    )
    placed = place_on_sample(lines, wavelengths.map)
    assert placed.sigma_nm < 0.3
    position = np.linspace(0.05, 0.7, 8)
    there = true_nm(on_sample, placed.strip, position)
    np.testing.assert_allclose(wavelengths.map.wavelength_nm(position), there, atol=0.7)


@pytest.mark.parametrize("rising", [True, False])
def test_stripes_that_glow_shift_the_strip(rising: bool) -> None:
    scene = replace(MIDDLE, rising=rising)
    lines_nm = {404.6565: 1.0, 435.8335: 2.0}
    feet = np.concatenate([[nm - 0.5, nm, nm + 0.5] for nm in lines_nm])
    height = np.array([[0.0, h, 0.0] for h in lines_nm.values()]).ravel()
    glow = scene.frame(Spectrum("glow", feet, height), 0.5)[0]
    shifted = replace(glow, mosaic=np.roll(glow.mosaic, 4, axis=1))
    strip = Strip(left=(0.1, 0.5), right=(0.9, 0.5), height=0.25, rising=rising)
    lvf = nominal_lvf(TRUE_MAP, np.linspace(400.5, 709.5, 31), leakage=0.001)
    for raw, moved in ((glow, 0.0), (shifted, 4 / 240)):
        found = shifted_by_stripes(strip_profile(hdr_frame([(raw, 1.0)]), strip), strip, lvf, 310.0)
        assert found.strip.left[0] == pytest.approx(0.1 + moved, abs=0.0015)
        expected_nm = moved / 0.8 * 310 * (1 if rising else -1)
        assert found.shift_nm == pytest.approx(expected_nm, abs=0.6)
        assert found.sigma_nm < 0.5


def test_a_sample_that_does_not_glow_shifts_nothing() -> None:
    dark = MIDDLE.frame(halogen(), 1e-9)
    strip = Strip(left=(0.1, 0.5), right=(0.9, 0.5), height=0.25, rising=True)
    lvf = nominal_lvf(TRUE_MAP, np.linspace(400.5, 709.5, 31))
    with pytest.raises(FitError, match="no stripes"):
        shifted_by_stripes(strip_profile(hdr_frame([dark]), strip), strip, lvf, 310.0)


def test_a_strip_that_clips_throughout_is_refused() -> None:
    strip = find_strip(bracket(MIDDLE, halogen())).strip(rising=True)
    with pytest.raises(DataError, match="clips in every frame"):
        strip_lines(strip_profile(bracket(MIDDLE, mercury(), (30.0,)), strip), strip, None)
