"""Finding a strip, its lines and its place, in pictures made pixel by pixel."""

from dataclasses import replace

import numpy as np
import pytest

from labrig.analyse.lvf_calibration.finder import FoundStrip, find_strip
from labrig.analyse.lvf_calibration.lines import (
    place_on_sample,
    shifted_by_stripes,
    strip_lines,
    wavelengths_along,
)
from labrig.analyse.lvf_calibration.picture import Picture, picture_of
from labrig.calibration import Strip
from labrig.errors import DataError, FitError
from labrig.fit.least_squares import FloatArray
from labrig.optics import Spectrum, nominal_lvf
from tests.analyse.lvf_calibration.strip_pictures import TRUE_MAP, Scene, halogen, mercury

SMALL = Scene(96, 64)
MIDDLE = Scene(240, 160)


def bracket(scene: Scene, light: Spectrum, exposures: tuple[float, ...] = (0.4, 4.0)) -> Picture:
    return picture_of(
        replace(scene, seed=scene.seed + k).frame(light, e) for k, e in enumerate(exposures)
    )


def true_nm(scene: Scene, strip: Strip, position: FloatArray) -> FloatArray:
    """Wavelength that the scene really has at positions of a strip, from its blue end."""
    share = position if strip.rising else 1 - position
    left, right = np.array(strip.left), np.array(strip.right)
    x, y = ((left + np.outer(share, right - left)) * [scene.width, scene.height]).T
    angle = np.radians(scene.tilt_degrees)
    across = (x - scene.width / 2) * np.cos(angle) + (y - scene.height / 2) * np.sin(angle)
    along = across / (scene.length * scene.width) + 0.5
    return TRUE_MAP.wavelength_nm(along if scene.rising else 1 - along)


@pytest.mark.parametrize(
    ("scene", "off_px"),
    [
        (MIDDLE, 2.0),
        (replace(MIDDLE, tilt_degrees=4.5, rising=False), 2.0),
        (replace(MIDDLE, tilt_degrees=-3.0, thickness=0.12), 2.0),
        (replace(MIDDLE, electrons=1500.0, read_noise_dn=12.0), 5.0),
        (replace(SMALL, tilt_degrees=1.5), 2.0),
    ],
    ids=["straight", "tilted", "thin", "noisy", "small"],
)
def test_a_strip_is_found(scene: Scene, off_px: float) -> None:
    found = find_strip(bracket(scene, halogen()))
    assert found.tilt_degrees == pytest.approx(scene.tilt_degrees, abs=1.3)
    assert found.length == pytest.approx(scene.length * scene.width, abs=2 * off_px)
    assert found.height == pytest.approx(scene.thickness * scene.height, abs=3)
    middle = np.mean(found.corners, axis=0)
    np.testing.assert_allclose(middle, [scene.width / 2, scene.height / 2], atol=off_px)
    strip = found.strip(rising=True)
    assert strip.height * scene.height < found.height - 1


def found_in(light: FloatArray) -> FoundStrip:
    return find_strip(Picture(light.astype(np.float32), "L", 1, ("L",)))


def test_pictures_without_a_strip_that_can_be_read() -> None:
    rng = np.random.default_rng(0)
    dark = rng.normal(0, 1, (120, 200))
    with pytest.raises(DataError, match="no strip is lit"):
        found_in(dark)
    square = dark.copy()
    square[40:80, 60:100] += 1000
    with pytest.raises(DataError, match="expected a long strip"):
        found_in(square)
    short = dark.copy()
    short[50:60, 60:110] += 1000
    with pytest.raises(DataError, match=r"5\d pixels long, 62 or more"):
        found_in(short)
    with pytest.raises(DataError, match=r"tilted by \+[67]\.\d° .* at most 5°"):
        find_strip(bracket(replace(MIDDLE, tilt_degrees=7.0), halogen()))


@pytest.mark.parametrize("rising", [True, False])
@pytest.mark.parametrize("scene", [replace(MIDDLE, tilt_degrees=2.0), SMALL], ids=["", "small"])
def test_lines_tell_the_wavelength_along_the_strip(scene: Scene, rising: bool) -> None:
    scene = replace(scene, rising=rising)
    strip = find_strip(bracket(scene, halogen())).strip(rising=True)
    found = strip_lines(bracket(scene, mercury(), (0.5, 4.0)), strip, None)
    assert found.strip.rising is rising
    fitted = wavelengths_along(found)
    position = np.linspace(0, 1, 9)
    off = fitted.map.wavelength_nm(position) - true_nm(scene, found.strip, position)
    assert (np.abs(off) < 3 * fitted.map.sigma_nm(position) + 0.3).all()
    assert np.abs(off[:6]).max() < 1.2


def test_a_strip_the_wrong_way_round_is_refused() -> None:
    strip = find_strip(bracket(MIDDLE, halogen())).strip(rising=True)
    picture = bracket(MIDDLE, mercury(), (0.5, 4.0))
    strip_lines(picture, strip, rising=True)
    with pytest.raises(FitError, match="the strip is the wrong way round"):
        strip_lines(picture, strip, rising=False)


def test_light_without_lines_is_refused() -> None:
    picture = bracket(MIDDLE, halogen())
    with pytest.raises(FitError, match="no lines of mercury"):
        strip_lines(picture, find_strip(picture).strip(rising=True), None)


def test_the_strip_on_the_sample_is_placed_by_its_lines() -> None:
    before = replace(MIDDLE, tilt_degrees=1.0)
    strip = find_strip(bracket(before, halogen())).strip(rising=True)
    wavelengths = wavelengths_along(
        strip_lines(bracket(before, mercury(), (0.5, 4.0)), strip, None)
    )
    on_sample = replace(MIDDLE, length=0.72, rising=False, tilt_degrees=-1.0)
    strip = find_strip(bracket(on_sample, halogen())).strip(rising=True)
    lines = strip_lines(bracket(on_sample, mercury(), (0.5, 4.0)), strip, None)
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
        found = shifted_by_stripes(picture_of([(raw, 1.0)]), strip, lvf, 310.0)
        assert found.strip.left[0] == pytest.approx(0.1 + moved, abs=0.0015)
        expected_nm = moved / 0.8 * 310 * (1 if rising else -1)
        assert found.shift_nm == pytest.approx(expected_nm, abs=0.6)
        assert found.sigma_nm < 0.5


def test_a_sample_that_does_not_glow_shifts_nothing() -> None:
    dark = MIDDLE.frame(halogen(), 1e-9)
    strip = Strip(left=(0.1, 0.5), right=(0.9, 0.5), height=0.25, rising=True)
    lvf = nominal_lvf(TRUE_MAP, np.linspace(400.5, 709.5, 31))
    with pytest.raises(FitError, match="no stripes"):
        shifted_by_stripes(picture_of([dark]), strip, lvf, 310.0)


def test_a_strip_that_clips_throughout_is_refused() -> None:
    strip = find_strip(bracket(MIDDLE, halogen())).strip(rising=True)
    with pytest.raises(DataError, match="clips in every frame"):
        strip_lines(bracket(MIDDLE, mercury(), (30.0,)), strip, None)
