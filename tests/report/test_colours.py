"""From raw values to the screen."""

import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from labrig.foundation import colour_science
from labrig.optics import XYZ_TO_SRGB, CameraResponse, read_camera, srgb_bytes
from labrig.report.colours import (
    HALOGEN_K,
    MAX_SWATCHES,
    camera_to_xyz,
    colour_matching,
    into_gamut,
    screen_for,
    swatches,
)
from labrig.report.photographs import daylight_picture, glow_pictures
from labrig.report.report_model import GlowPhotograph

from .made import decay_series, frame, patch, write_dng

CAMERA = read_camera("canon_eos_5d_mark_ii")
SCREEN = screen_for(CAMERA)


def decoded(source: str) -> NDArray[np.uint8]:
    """RGB of a data URI."""
    import base64

    data = np.frombuffer(base64.b64decode(source.partition(",")[2]), np.uint8)
    image = cv2.imdecode(data, cv2.IMREAD_COLOR)
    return np.asarray(image, dtype=np.uint8)[..., ::-1]


def test_white_under_the_lamp_is_white() -> None:
    planck = CAMERA.wavelength_nm**-5 / np.expm1(1.438777e7 / HALOGEN_K / CAMERA.wavelength_nm)
    raw = CAMERA.response(planck)
    np.testing.assert_allclose(SCREEN.lamp_lit @ (raw / raw.max()), 1.0, atol=1e-4)


def test_what_shines_like_equal_energy_is_nearly_white() -> None:
    raw = CAMERA.response(np.ones_like(CAMERA.wavelength_nm))
    linear = SCREEN.glow @ (raw / raw.max())
    # Illuminant E in sRGB, whose white is D65: a little reddish.
    np.testing.assert_allclose(linear, [1.205, 0.948, 0.909], atol=0.01)


@pytest.mark.parametrize(("peak_nm", "strongest"), [(450.0, 2), (530.0, 1), (620.0, 0)])
def test_emissions_have_their_colour(peak_nm: float, strongest: int) -> None:
    raw = CAMERA.response(np.exp(-0.5 * ((CAMERA.wavelength_nm - peak_nm) / 20) ** 2))
    assert np.argmax(into_gamut(SCREEN.glow @ raw)) == strongest


def test_a_deep_blue_glow_is_not_black() -> None:
    raw = CAMERA.response(np.exp(-0.5 * ((CAMERA.wavelength_nm - 440.0) / 20) ** 2))
    blue = into_gamut(SCREEN.glow @ raw)
    assert blue.min() >= 0
    assert blue[2] > 10 * blue[:2].max()


def test_the_transfer_curve() -> None:
    np.testing.assert_array_equal(srgb_bytes(np.array([0.0, 0.2140, 1.0, 7.0])), [0, 127, 255, 255])


def test_swatches_fade_and_keep_their_hue() -> None:
    shown = swatches(decay_series(40), SCREEN)
    assert len(shown) == MAX_SWATCHES
    brightness = [int(swatch.glow[3:5], 16) for swatch in shown]
    assert brightness == sorted(brightness, reverse=True)
    assert all("ff" in swatch.hue for swatch in shown if swatch.hue)


def test_noise_has_no_hue() -> None:
    series = decay_series()
    noise = replace(series, values=np.ones_like(series.values), sigma=np.ones_like(series.sigma))
    assert {swatch.hue for swatch in swatches(noise, SCREEN)} == {""}
    assert {swatch.glow for swatch in swatches(noise, SCREEN)} == {"#000000"}


def test_swatches_are_for_rgb_only() -> None:
    assert swatches(decay_series(channels=("L",)), SCREEN) == ()


def test_the_best_exposed_daylight_photograph_is_shown(tmp_path: Path) -> None:
    light = np.array([6.0, 9.0, 4.0])
    frames = [
        frame(write_dng(tmp_path / f"{n}.dng", light * 4.0**n), n, "daylight", exposure_s)
        for n, exposure_s in ((1, 0.01), (5, 0.16), (8, 0.64))
    ]
    picture = daylight_picture(frames, [patch(decay_series())], SCREEN)
    assert picture is not None
    assert "5.dng" in picture.caption
    (mark,) = picture.marks
    assert (mark.x, mark.y, mark.width, mark.height) == (8.0, 6.0, 16.0, 12.0)
    assert (picture.width, picture.height) == (32, 24)


def test_glow_is_on_one_exposure_and_brightened(tmp_path: Path) -> None:
    light = np.array([300.0, 4000.0, 2000.0])
    bright = frame(write_dng(tmp_path / "1.dng", light), 1)
    # The same light seen twice as long is no brighter; a tenth of it is.
    longer = frame(write_dng(tmp_path / "2.dng", 2 * light), 2, exposure_s=2.0)
    dim = frame(write_dng(tmp_path / "3.dng", light / 10), 3)
    photographs = [GlowPhotograph(taken, 1.0) for taken in (bright, longer, dim)]
    one, same, tenth = glow_pictures(photographs, SCREEN)
    middle = (12, 16)
    np.testing.assert_allclose(
        decoded(one.source)[middle].astype(int), decoded(same.source)[middle].astype(int), atol=2
    )
    assert decoded(tenth.source)[middle].max() < 0.45 * decoded(one.source)[middle].max()
    assert tenth.brightened == "10"
    np.testing.assert_allclose(
        decoded(tenth.brightened_source)[middle].astype(int),
        decoded(one.source)[middle].astype(int),
        atol=6,
    )


def test_saturated_glow_is_white(tmp_path: Path) -> None:
    has_saturation = frame(write_dng(tmp_path / "1.dng", np.array([900.0, 16000.0, 2000.0])))
    (picture,) = glow_pictures([GlowPhotograph(has_saturation, 1.0)], SCREEN)
    assert picture.has_saturation
    assert decoded(picture.source)[12, 16].min() > 250


def test_equal_energy_comes_out_exactly() -> None:
    camera = CAMERA
    raw = camera.response(np.ones_like(camera.wavelength_nm))
    xyz = camera_to_xyz(camera) @ (raw / raw.max())
    np.testing.assert_allclose(xyz, 1.0, atol=2e-3)


def test_an_observer_as_camera_gives_the_observer() -> None:
    wavelength_nm = np.arange(380.0, 781.0, 5.0)
    mixing = np.array([[1.0, 0.2, 0.1], [0.3, 1.0, 0.1], [0.0, 0.2, 1.0]])
    camera = CameraResponse("ideal", wavelength_nm, colour_matching(wavelength_nm) @ mixing.T)
    matrix = camera_to_xyz(camera)
    np.testing.assert_allclose(
        matrix / matrix[1, 1], np.linalg.inv(mixing) / np.linalg.inv(mixing)[1, 1], atol=1e-9
    )


def test_colours_are_those_of_colour_science() -> None:
    colour = colour_science.load()
    observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    np.testing.assert_allclose(colour_matching(observer.wavelengths), observer.values, rtol=1e-9)
    linear = np.linspace(0, 1, 999)
    curve = colour.cctf_encoding(linear, function="sRGB")
    np.testing.assert_array_equal(srgb_bytes(linear), np.rint(255 * curve))
    np.testing.assert_allclose(XYZ_TO_SRGB, colour.RGB_COLOURSPACES["sRGB"].matrix_XYZ_to_RGB)


def test_the_misfit_is_what_the_docstring_says() -> None:
    camera = CAMERA
    target = colour_matching(camera.wavelength_nm)
    fitted = camera.sensitivity @ camera_to_xyz(camera).T
    scale = target.sum(axis=0)[1] / fitted.sum(axis=0)[1]
    rms = np.sqrt(np.mean((fitted * scale - target) ** 2, axis=0))
    np.testing.assert_allclose(rms, [0.09, 0.09, 0.16], atol=0.01)


def test_numpy_prints_as_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With a package that does when it is imported as colour-science does, which takes seconds."""
    change = "numpy.set_printoptions(legacy='1.13')"
    assert "np.set_printoptions(legacy=" in Path(colour_science.load().__file__).read_text(
        encoding="utf-8"
    )
    (tmp_path / "colour.py").write_text(f"import numpy\n{change}\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(sys.modules, "colour", sys)
    del sys.modules["colour"]
    before = np.get_printoptions()
    assert colour_science.load().__file__ == str(tmp_path / "colour.py")
    assert np.get_printoptions() == before
