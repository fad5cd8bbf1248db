"""Files of pictures: what is read back is what was written, also by other programs."""

from pathlib import Path

import cv2
import numpy as np
import OpenEXR
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray
from PIL import Image

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DiskError, UsageError
from labrig.material import read_spectral_image
from labrig.optics import XYZ_TO_SRGB
from labrig.reproduce import (
    read_linear_exr,
    read_spectral_exr,
    tristimulus,
    write_linear_exr,
    write_png,
    write_spectral_exr,
)

EDGES_NM = np.linspace(300.0, 780.0, 25)


def random_image(height: int, width: int, bands: int, seed: int = 1) -> NDArray[np.float32]:
    rng = np.random.default_rng(seed)
    return (10 ** rng.uniform(-9, 2, (height, width, bands))).astype(np.float32)


def test_a_png_has_its_pixels_and_texts_in_other_programs(tmp_path: Path) -> None:
    picture = np.random.default_rng(1).integers(0, 256, (5, 7, 3), dtype=np.uint8)
    texts = {"Display transform": "D65 of 80 cd/m² is white", "Time": "12 s", "Empty": ""}
    write_png(tmp_path / "a.png", picture, texts)
    with Image.open(tmp_path / "a.png") as image:
        image.load()
        np.testing.assert_array_equal(np.asarray(image), picture)
        assert {key: image.info[key] for key in texts} == texts
        assert "srgb" in image.info
    bgr = cv2.imread(str(tmp_path / "a.png"))
    assert bgr is not None
    np.testing.assert_array_equal(bgr[..., ::-1], picture)
    assert [path.name for path in tmp_path.iterdir()] == ["a.png"]


@settings(max_examples=25)
@given(st.dictionaries(st.from_regex(r"[A-Za-z]{1,20}", fullmatch=True), st.text(max_size=60)))
def test_texts_of_a_png_are_read_back(
    tmp_path_factory: pytest.TempPathFactory, texts: dict[str, str]
) -> None:
    path = tmp_path_factory.mktemp("png") / "a.png"
    texts = {key: text.replace("\0", "") for key, text in texts.items()}
    texts = {key: text.encode("utf-8", "ignore").decode() for key, text in texts.items()}
    write_png(path, np.zeros((1, 1, 3), np.uint8), texts)
    with Image.open(path) as image:
        assert {key: image.info[key] for key in texts} == texts


def test_other_than_a_picture_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    for wrong in (np.zeros((2, 2), np.uint8), np.zeros((2, 2, 3)), np.zeros((0, 2, 3), np.uint8)):
        with pytest.raises(UsageError, match="expected bytes"):
            write_png(path, wrong, {})  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="keyword"):
        write_png(path, np.zeros((2, 2, 3), np.uint8), {"": "x"})


@pytest.mark.parametrize("edges_nm", [EDGES_NM, np.array([380.0, 400.25, 500.0, 501.0, 780.0])])
def test_a_spectral_image_is_read_back_exactly(tmp_path: Path, edges_nm: FloatArray) -> None:
    image = random_image(4, 6, len(edges_nm) - 1)
    texts = {"time": "12 s", "scene": "a1b2c3", "unit": "cd/m²"}
    write_spectral_exr(tmp_path / "a.exr", image, edges_nm, texts)
    frame = read_spectral_exr(tmp_path / "a.exr")
    np.testing.assert_array_equal(frame.radiance, image)
    np.testing.assert_array_equal(frame.edges_nm, edges_nm)
    assert frame.texts == texts
    assert frame.units == "W.m^-2.sr^-1.nm^-1"


def test_a_spectral_image_follows_the_layout(tmp_path: Path) -> None:
    image = random_image(2, 3, 24)
    write_spectral_exr(tmp_path / "a.exr", image, EDGES_NM)
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        channels, header = file.channels(), file.header()
        expected = {f"S0.{nm},000000nm" for nm in range(310, 780, 20)} | {"R", "G", "B"}
        assert set(channels) == expected
        np.testing.assert_array_equal(channels["S0.450,000000nm"].pixels, image[..., 7])
        linear = np.stack([channels[name].pixels for name in "RGB"], axis=-1)
        assert header["spectralLayoutVersion"] == "1.0"
    shown = tristimulus(image, EDGES_NM) @ XYZ_TO_SRGB.T
    np.testing.assert_allclose(linear, shown, rtol=1e-5, atol=1e-5 * np.abs(shown).max())
    read = read_spectral_image(tmp_path / "a.exr")
    np.testing.assert_array_equal(read.emissive_nm, np.arange(310.0, 780.0, 20.0))


def test_an_image_of_another_program_has_edges_half_way(tmp_path: Path) -> None:
    flat = np.ones((2, 2), np.float32)
    header = {"spectralLayoutVersion": "1.0", "emissiveUnits": "W.m^-2.sr^-1.nm^-1"}
    channels = {"S0.400,5nm": flat, "S0.500nm": 2 * flat, "S0.640nm": 3 * flat}
    OpenEXR.File(header, channels).write(str(tmp_path / "b.exr"))
    frame = read_spectral_exr(tmp_path / "b.exr")
    np.testing.assert_allclose(frame.edges_nm, [350.75, 450.25, 570.0, 710.0])
    np.testing.assert_array_equal(frame.radiance[0, 0], [1, 2, 3])


@pytest.mark.parametrize("written", ["400 500", "400 500 x", "500 400 300", "1 2 3", ""])
def test_edges_of_other_bands_are_refused(tmp_path: Path, written: str) -> None:
    flat = np.ones((2, 2), np.float32)
    header = {
        "spectralLayoutVersion": "1.0",
        "emissiveUnits": "relative",
        "bandEdgesNm": written,
    }
    OpenEXR.File(header, {"S0.450nm": flat, "S0.550nm": flat}).write(str(tmp_path / "b.exr"))
    with pytest.raises(UsageError, match=r"^[^\n]*expected edges[^\n]*$"):
        read_spectral_exr(tmp_path / "b.exr")


def test_linear_srgb_is_read_back_and_not_clipped(tmp_path: Path) -> None:
    xyz = 1e3 * np.random.default_rng(3).uniform(0, 1, (3, 5, 3))
    write_linear_exr(tmp_path / "c.exr", xyz)
    np.testing.assert_allclose(read_linear_exr(tmp_path / "c.exr"), xyz, rtol=1e-4, atol=1e-2)
    with OpenEXR.File(str(tmp_path / "c.exr")) as file:
        assert file.channels()["RGB"].pixels.min() < 0
        assert file.header()["whiteLuminance"] == 1.0
        assert file.header()["chromaticities"][0] == pytest.approx(0.64)


def test_a_file_that_is_none_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "d.exr"
    write_spectral_exr(path, random_image(20, 20, 24), EDGES_NM)
    path.write_bytes(path.read_bytes()[:-200])
    for read in (read_spectral_exr, read_linear_exr):
        with pytest.raises(UsageError, match=r"^[^\n]+$"):
            read(path)
        with pytest.raises(UsageError, match=r"^[^\n]+$"):
            read(tmp_path / "none.exr")
    write_linear_exr(tmp_path / "e.exr", np.ones((2, 2, 3)))
    with pytest.raises(UsageError, match="spectral"):
        read_spectral_exr(tmp_path / "e.exr")


def test_a_folder_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(DiskError):
        write_spectral_exr(tmp_path / "none/a.exr", random_image(2, 2, 24), EDGES_NM)
    with pytest.raises(DiskError):
        write_png(tmp_path / "none/a.png", np.zeros((2, 2, 3), np.uint8), {})
    with pytest.raises(UsageError, match="image"):
        write_spectral_exr(tmp_path / "a.exr", np.ones(24), EDGES_NM)
    with pytest.raises(UsageError, match="two bands"):
        write_spectral_exr(tmp_path / "a.exr", np.ones((2, 2, 1)), [400, 700])


def test_a_surface_is_no_light(tmp_path: Path) -> None:
    flat = np.ones((2, 2), np.float32)
    OpenEXR.File({"spectralLayoutVersion": "1.0"}, {"T.450nm": flat}).write(str(tmp_path / "f.exr"))
    with pytest.raises(UsageError, match="light"):
        read_spectral_exr(tmp_path / "f.exr")


def test_a_linear_picture_has_numbers_only(tmp_path: Path) -> None:
    xyz = np.ones((2, 3, 3))
    xyz[1, 2, 0] = np.nan
    write_linear_exr(tmp_path / "c.exr", xyz)
    with pytest.raises(UsageError, match="1 of 6 pixels"):
        read_linear_exr(tmp_path / "c.exr")
