import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st
from tifffile import imwrite

from labrig.foundation.errors import FrameError, UsageError
from labrig.reduce import RawFrame, read_raw
from labrig.reduce.raw import libraw_stderr

WriteDng = Callable[..., bytes]
MOSAIC = np.random.default_rng(1).integers(0, 65536, (40, 60)).astype(np.uint16)


@pytest.mark.parametrize("cfa", ["RGGB", "BGGR", "GRBG", "GBRG"])
def test_a_dng_is_read_as_written_with_black_in_the_order_of_its_cfa(
    write_dng: WriteDng, cfa: str
) -> None:
    raw = read_raw(write_dng(MOSAIC, cfa, black=(1000, 1010, 1020, 1030)))
    assert np.array_equal(raw.mosaic, MOSAIC)
    assert (raw.cfa, raw.black, raw.white) == (cfa, (1000, 1010, 1020, 1030), 15000)
    assert (raw.width, raw.height) == (60, 40)


def test_exif_is_read(write_dng: WriteDng, tmp_path: Path) -> None:
    path = tmp_path / "ä.dng"
    path.write_bytes(write_dng(MOSAIC, exposure=(1, 60), f_number=(28, 5), iso=400))
    raw = read_raw(path)
    assert (raw.exposure_s, raw.f_number, raw.iso) == (1 / 60, 5.6, 400)
    assert (raw.make, raw.model) == ("labrig", "test camera")


@pytest.mark.parametrize(
    "settings", [{}, {"exposure": (0, 1), "f_number": (0, 0), "iso": 0}, {"iso": 65535}]
)
def test_placeholders_are_none(write_dng: WriteDng, settings: dict[str, object]) -> None:
    raw = read_raw(write_dng(MOSAIC, **settings))
    assert (raw.exposure_s, raw.f_number, raw.iso) == (None, None, None)


def test_a_real_photograph_of_a_canon(real_data: Path) -> None:
    canon = read_raw(real_data / "canon_550d/canon_550d_kissx4_colorchecker.dng")
    assert canon.mosaic.shape == (1156, 1734)
    assert (canon.cfa, canon.black, canon.white) == ("RGGB", (2056,) * 4, 15000)
    assert (int(canon.mosaic.min()), int(canon.mosaic.max())) == (1958, 12128)
    assert (canon.model, canon.exposure_s, canon.iso) == ("Canon EOS Kiss X4", None, None)


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (b"", "empty file"),
        (b"\xff\xd8\xff\xe0 and so on", "JPEG"),
        (b"t_s,R\n0,1\n", "no RAW container"),
        (b"II*\0", "cut off"),
        (b"II*\0\x10\0\0\0CR\2\0", "cut off"),
        (b"MM\0*\0\0\0\x08", "cut off"),
        (b"FUJIFILMCCD-RAW 0201FF129502X-T2", "cut off"),
        (b"\0\0\0\x18ftypcrx \0\0\0\1crx isom", "cut off"),
    ],
)
def test_what_is_no_raw_file_is_refused(content: bytes, why: str) -> None:
    with pytest.raises(FrameError, match=f"^x.cr2: expected a RAW file .*{why}"):
        read_raw(content, "x.cr2")


def test_a_file_that_cannot_be_opened_is_the_users_error(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no such file"):
        read_raw(tmp_path / "missing.cr2")
    with pytest.raises(UsageError, match="a folder"):
        read_raw(tmp_path)


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"mosaic": MOSAIC[:5]}, "shape"),
        ({"mosaic": MOSAIC.astype(float)}, "float64"),
        ({"cfa": "RGBE"}, "RGBE"),
        ({"cfa": "RGGBRGGB"}, "in a square"),
        ({"cfa": "LRGB"}, "LRGB"),
        ({"cfa": "L"}, "1 black levels"),
        ({"mosaic": MOSAIC[:17], "cfa": "RGB" * 12, "black": (1e3,) * 36}, "18 x 18"),
        ({"white": 900.0}, "below white"),
    ],
)
def test_an_impossible_frame_cannot_be_made(change: dict[str, object], why: str) -> None:
    fields = {"mosaic": MOSAIC, "cfa": "RGGB", "black": (1e3, 1e3, 1e3, 1e3), "white": 15e3}
    with pytest.raises(FrameError, match=why):
        RawFrame(**fields | change)  # type: ignore[arg-type]


def test_a_file_with_all_colours_in_every_pixel_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "linear.dng"
    pixels = np.random.default_rng(2).integers(0, 65536, (40, 60, 3)).astype(np.uint16)
    tags = [(50706, "B", 4, (1, 4, 0, 0), True), (50708, "s", 0, "linear", True)]
    imwrite(path, pixels, photometric=34892, planarconfig="contig", extratags=tags)
    with pytest.raises(FrameError, match="all colours in every pixel"):
        read_raw(path)


def test_cut_off_files_are_refused_quietly(
    write_dng: WriteDng, capfd: pytest.CaptureFixture[str]
) -> None:
    content = write_dng(MOSAIC)
    for length in range(0, len(content) - 1, 97):
        with pytest.raises(FrameError):
            read_raw(content[:length])
    assert capfd.readouterr() == ("", "")


@settings(max_examples=40, deadline=2000, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_damaged_files_are_read_or_refused(write_dng: WriteDng, data: st.DataObject) -> None:
    content = bytearray(write_dng(MOSAIC, exposure=(1, 60), iso=100))
    header = st.integers(0, 600)
    for position in data.draw(st.lists(header, min_size=1, max_size=8)):
        content[position] = data.draw(st.integers(0, 255))
    _read_or_refused(bytes(content))


@settings(max_examples=30, deadline=2000, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_damaged_real_files_are_read_or_refused(shared_data: Path, data: st.DataObject) -> None:
    content = bytearray((shared_data / "raw_photos" / "kodak_dc50.kdc").read_bytes())
    for position in data.draw(st.lists(st.integers(0, 2000), max_size=8)):
        content[position] = data.draw(st.integers(0, 255))
    _read_or_refused(bytes(content[: data.draw(st.integers(0, len(content)))]))


def _read_or_refused(content: bytes) -> None:
    try:
        raw = read_raw(content)
    except FrameError as error:
        assert "\n" not in str(error)
    else:
        assert raw.mosaic.dtype == np.uint16


def test_only_libraw_is_kept_quiet(capfd: pytest.CaptureFixture[str]) -> None:
    with libraw_stderr():
        os.write(2, b"unknown file: Unexpected end of file\nlamp off\nCorrupt JPEG data: x\n")
    os.write(2, b"door closed\n")
    assert capfd.readouterr().err == "lamp off\ndoor closed\n"
