"""Finding the strip of a variable filter, in frames made pixel by pixel."""

from dataclasses import replace

import numpy as np
import pytest

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.reduce.hdr import HdrFrame
from labrig.reduce.strip import FoundStrip, find_strip
from tests.analyse.lvf_calibration.strip_pictures import Scene, bracket, halogen

SMALL = Scene(96, 64)
MIDDLE = Scene(240, 160)


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
    return find_strip(HdrFrame(light.astype(np.float32), "L", 1, ("L",)))


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
