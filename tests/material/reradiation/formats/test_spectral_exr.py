"""Spectral and bispectral OpenEXR images, in the layout of Fichet et al. (JCGT 2021)."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
from hypothesis import given, settings, strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from labrig.foundation.errors import DiskError, UsageError
from labrig.material import (
    ReradiationMatrix,
    read_reradiation,
    read_spectral_image,
    write_reradiation,
)
from tests.material.reradiation.formats.matrices import (
    assert_same,
    random_matrices,
    two_dyes,
)

#: Attributes of every image of the layout's authors, but for its size.
HEADER: dict[str, Any] = {
    "EV": 0.0,
    "compression": OpenEXR.ZIP_COMPRESSION,
    "lineOrder": OpenEXR.INCREASING_Y,
    "pixelAspectRatio": 1.0,
    "screenWindowWidth": 1.0,
    "spectralLayoutVersion": "1.0",
    "type": OpenEXR.scanlineimage,
}
#: Rounding of 32-bit numbers, and of a product.
FLOAT32 = 6.0e-8


def image(path: Path, channels: dict[str, float | np.ndarray], **header: object) -> Path:
    """Write an image of 2 × 3 pixels."""
    pixels = {
        name: np.broadcast_to(np.float32(value), (3, 2)).copy() for name, value in channels.items()
    }
    whole = {key: value for key, value in (HEADER | header).items() if value is not None}
    OpenEXR.File(whole, pixels).write(str(path))
    return path


def header_of(path: Path) -> dict[str, Any]:
    header = OpenEXR.File(str(path), header_only=True).header()
    return {key: value for key, value in header.items() if key != "channels"}


def square(matrix: ReradiationMatrix) -> ReradiationMatrix:
    """One grid of input and output, nothing re-radiated at shorter wavelengths."""
    nm = np.arange(400.0, 701.0, 20.0)
    square = matrix.rebinned(nm, nm)
    return replace(square, reradiation=np.where(square.is_stokes, square.reradiation, 0.0))


def test_a_matrix_comes_back(tmp_path: Path) -> None:
    for paper in (two_dyes(1), square(two_dyes(1))):
        write_reradiation(tmp_path / "m.exr", paper)
        assert_same(read_reradiation(tmp_path / "m.exr"), paper, rtol=FLOAT32)


@settings(max_examples=15)
@given(matrix=random_matrices())
def test_any_matrix_comes_back(
    tmp_path_factory: pytest.TempPathFactory, matrix: ReradiationMatrix
) -> None:
    path = tmp_path_factory.mktemp("any") / "m.exr"
    # The layout gives wavelengths to six decimals.
    grids = {name: np.round(getattr(matrix, name), 6) for name in ("input_nm", "output_nm")}
    rounded = replace(matrix, input_nm=grids["input_nm"], output_nm=grids["output_nm"])
    write_reradiation(path, rounded)
    # The smallest numbers of all are those of 32 bits.
    assert_same(read_reradiation(path), rounded, rtol=FLOAT32)


def test_channels_and_attributes_are_the_layouts(tmp_path: Path) -> None:
    path = tmp_path / "m.exr"
    write_reradiation(path, square(two_dyes(2)))
    nm = range(400, 701, 20)
    channels = OpenEXR.File(str(path), separate_channels=True).channels()
    assert set(channels) == (
        {"R", "G", "B"}
        | {f"T.{input_nm},000000nm" for input_nm in nm}
        | {
            f"T.{input_nm},000000nm.{output_nm},000000nm"
            for input_nm in nm
            for output_nm in nm
            if output_nm > input_nm
        }
    )
    assert {channel.pixels.dtype for channel in channels.values()} == {np.dtype(np.float32)}
    header = header_of(path)
    assert {key: header[key] for key in HEADER} == HEADER
    assert header["name"] == "yellow paper"
    assert "emissiveUnits" not in header
    of_paper = square(two_dyes(2))
    pair = channels["T.460,000000nm.520,000000nm"].pixels[0, 0]
    assert_allclose(pair, of_paper.reradiation[6, 3] * 20, rtol=FLOAT32)
    assert_allclose(channels["T.500,000000nm"].pixels[0, 0], of_paper.reflectance[5], rtol=FLOAT32)


def test_the_preview_of_a_white_is_white_and_of_a_yellow_paper_yellow(tmp_path: Path) -> None:
    nm = np.arange(360.0, 831.0, 5.0)
    table = np.zeros((len(nm), len(nm)))
    write_reradiation(
        tmp_path / "white.exr", ReradiationMatrix("", nm, nm, np.ones(len(nm)), table)
    )
    slope = np.where(nm > 500, 0.8, 0.1)
    write_reradiation(tmp_path / "yellow.exr", ReradiationMatrix("", nm, nm, slope, table))
    white, yellow = (
        [OpenEXR.File(str(tmp_path / f"{name}.exr"), separate_channels=True).channels()[c].pixels
         for c in "RGB"]
        for name in ("white", "yellow")
    )  # fmt: skip
    assert_allclose(np.ravel(white), 1.0, atol=2e-3)
    red, green, blue = np.ravel(yellow)
    assert min(red, green) > 4 * blue


def test_light_is_read_with_its_unit(tmp_path: Path) -> None:
    path = image(
        tmp_path / "lamp.exr",
        {"S0.0,5um": 2.0, "S0.450nm": 1.0, "S0.4,0E2nm": 3.0, "S1.450nm": 9.0, "Y": 1.0},
        emissiveUnits="W.m^-2.sr^-1",
    )
    read = read_spectral_image(path)
    assert (read.name, read.emissive_units) == ("lamp", "W.m^-2.sr^-1")
    assert_array_equal(read.emissive_nm, [400.0, 450.0, 500.0])
    assert read.emissive.shape == (3, 2, 3)
    assert_array_equal(read.spectrum().value, [3.0, 1.0, 2.0])
    with pytest.raises(UsageError, match="expected a surface"):
        read_reradiation(path)


def test_light_by_frequency_is_read(tmp_path: Path) -> None:
    channels: dict[str, float | np.ndarray] = {"S0.600THz": 1.0, "S0.500THz": 2.0}
    read = read_spectral_image(image(tmp_path / "a.exr", channels, emissiveUnits="W"))
    assert_allclose(read.emissive_nm, [499.654097, 599.584916], rtol=1e-9)


def test_pixels_are_chosen(tmp_path: Path) -> None:
    half = np.array([[0.1, 0.5], [0.2, 0.6], [0.3, 0.7]])
    path = image(tmp_path / "a.exr", {"T.400nm": half, "T.500nm": 0.5, "T.400nm.500nm": 0.01})
    with pytest.raises(UsageError, match="2 × 3 different pixels"):
        read_reradiation(path)
    chosen = read_reradiation(path, pixel=(1, 2))
    assert_allclose(chosen.reflectance, [0.7, 0.5])
    assert_allclose(chosen.reradiation, [[0.0, 0.0], [1e-4, 0.0]])
    for pixel in ((2, 0), (0, 3), (-1, 0)):
        with pytest.raises(UsageError, match="expected a pixel in 2 × 3"):
            read_reradiation(path, pixel=pixel)
    with pytest.raises(UsageError, match="expected light"):
        read_spectral_image(path).spectrum()


def test_a_surface_without_bispectral_layers_re_radiates_nothing(tmp_path: Path) -> None:
    path = image(tmp_path / "a.exr", {"T.400nm": 0.5, "T.500nm": 0.25})
    assert not read_reradiation(path).reradiation.any()


def test_pairs_that_are_left_out_are_zero_or_not_measured(tmp_path: Path) -> None:
    channels: dict[str, float | np.ndarray] = {f"T.{nm}nm": 0.5 for nm in (400, 500, 600)}
    path = image(tmp_path / "a.exr", channels | {"T.400nm.600nm": 0.2})
    read = read_reradiation(path)
    expected = [[0.0, 0.0, 0.0], [np.nan, 0.0, 0.0], [2e-3, np.nan, 0.0]]
    assert_allclose(read.reradiation, expected, rtol=1e-6)


@pytest.mark.parametrize(
    ("channels", "header", "message"),
    [
        ({"T.400nm": 0.5, "T.500nm": 0.5}, {"spectralLayoutVersion": None}, "got none"),
        ({"T.400nm": 0.5, "T.500nm": 0.5}, {"spectralLayoutVersion": "7"}, "got '7'"),
        ({"S0.400nm": 0.5, "S0.500nm": 0.5}, {}, "expected the attribute emissiveUnits"),
        ({"R": 1.0, "G": 1.0, "B": 1.0}, {}, "expected spectral channels"),
        ({"T.400nm": 0.5}, {}, "expected two or more wavelengths"),
        ({"T.400m": 0.5, "T.500m": 0.5}, {}, "expected wavelengths from 100 to"),
        ({"T.400nm": 0.5, "T.500nm": 0.5, "T.x": 0.5}, {}, "T.500,000000nm, got 'T.x'"),
        ({"T.0Hz": 0.5, "T.500nm": 0.5}, {}, "expected channels of wavelengths, got 0Hz"),
        ({"T.400nm": 0.5, "T.400,0nm": 0.5}, {}, "two channels have the same wavelength"),
        ({"T.400nm": 0.5, "T.500nm": np.inf}, {}, "some pixel is infinite"),
        ({"T.400nm": 0.5, "T.500nm": 50.0}, {}, "above 2 in magnitude"),
        ({"T.400nm": 0.5, "T.400nm.500nm": 0.1}, {}, "two or more wavelengths"),
    ],
)
def test_an_image_without_the_layout_is_refused(
    tmp_path: Path, channels: dict[str, float | np.ndarray], header: dict[str, Any], message: str
) -> None:
    path = image(tmp_path / "a.exr", channels, **header)
    with pytest.raises(UsageError, match=message) as caught:
        read_reradiation(path)
    assert "\n" not in str(caught.value)
    assert "a.exr" in str(caught.value)


def test_an_image_that_is_cut_is_refused(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path = image(tmp_path / "a.exr", {"T.400nm": 0.5, "T.500nm": 0.5})
    content = path.read_bytes()
    path.write_bytes(content[:-10])
    with pytest.raises(UsageError, match="the file is cut or broken"):
        read_reradiation(path)
    path.write_bytes(content[:100])
    with pytest.raises(UsageError, match="not an OpenEXR image, or a broken one"):
        read_reradiation(path)
    assert not capfd.readouterr().out


def test_what_an_image_cannot_hold_is_refused(tmp_path: Path) -> None:
    paper = two_dyes(3)
    with pytest.raises(UsageError, match="the re-radiation is relative"):
        write_reradiation(tmp_path / "m.exr", replace(paper, unit="relative"))
    with pytest.raises(UsageError, match="no such file"):
        read_spectral_image(tmp_path / "m.exr")
    with pytest.raises(DiskError, match="cannot be written"):
        write_reradiation(tmp_path / "nowhere/m.exr", square(paper))


@settings(max_examples=30)
@given(at=st.floats(0, 1), change=st.one_of(st.none(), st.binary(min_size=1, max_size=6)))
def test_a_broken_image_is_read_or_refused_in_one_line(
    tmp_path_factory: pytest.TempPathFactory, at: float, change: bytes | None
) -> None:
    path = tmp_path_factory.mktemp("any") / "m.exr"
    image(path, {"T.400nm": 0.5, "T.500nm": 0.4, "T.400nm.500nm": 0.1})
    content = path.read_bytes()
    place = int(at * len(content))
    after = b"" if change is None else change + content[place + len(change) :]
    path.write_bytes(content[:place] + after)
    try:
        read_reradiation(path)
    except UsageError as error:
        assert "\n" not in str(error)


def test_the_authors_light_is_read(real_data: Path) -> None:
    read = read_spectral_image(real_data / "spectral_exr/D65.exr")
    light = read.spectrum()
    assert (light.name, read.emissive_units) == ("D65", "W.m^-2.sr^-1")
    assert light.wavelength_nm[[0, -1]].tolist() == [380.0, 825.0]
    # CIE 15: D65 is 100 at 560 nm, 54.6482 at 390 nm.
    assert light.at(560.0) == 100.0
    assert_allclose(light.at(390.0), 54.6482, rtol=FLOAT32)
    assert not len(read.reflective_nm)


def test_the_authors_chart_is_read_and_written_with_its_attributes(
    real_data: Path, tmp_path: Path
) -> None:
    chart = real_data / "spectral_exr/Macbeth.exr"
    read = read_spectral_image(chart)
    assert read.reflective.shape == (400, 600, 36)
    pixels = OpenEXR.File(str(chart), separate_channels=True).channels()
    for column, row in ((50, 350), (250, 250), (50, 50)):
        path = tmp_path / f"{column}-{row}.exr"
        write_reradiation(path, replace(read.matrix((column, row)), name=""))
        ours = header_of(path)
        sizes = ("dataWindow", "displayWindow")
        assert set(ours) == set(header_of(chart))
        for key in set(ours) - {*sizes, "screenWindowCenter"}:
            assert ours[key] == header_of(chart)[key], key
        mine = OpenEXR.File(str(path), separate_channels=True).channels()
        for name, channel in pixels.items():
            # The preview has another table of the observer.
            tolerance = 1e-3 if name in "RGB" else 0
            assert_allclose(mine[name].pixels[0, 0], channel.pixels[row, column], atol=tolerance)
            assert mine[name].pixels.dtype == channel.pixels.dtype
        fluorescent = {name for name in mine if name.count("nm") == 2}
        assert set(mine) - fluorescent == set(pixels)
        assert len(fluorescent) == 36 * 35 / 2
