"""The simulated camera's file, read by the programs that read real ones."""

import io
from fractions import Fraction

import exifread
import numpy as np
import pytest
import rawpy
from hypothesis import given, settings, strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from labrig.sim.dng import DIAL, Shot, encode_dng, exposure_label

SHOT = Shot(start_s=1767225600.75, exposure_s=2.0**-6, iso=800, f_number=5.6)


def encoded(mosaic: NDArray[np.uint16], shot: Shot = SHOT) -> bytes:
    return encode_dng(mosaic, shot)


@settings(max_examples=30, deadline=None)
@given(
    mosaic=hnp.arrays(
        np.uint16,
        st.tuples(st.integers(12, 30), st.integers(12, 30)).map(lambda s: (2 * s[0], 2 * s[1])),
        elements=st.integers(0, 65535) | st.sampled_from([0, 1024, 15600, 16383, 65535]),
    )
)
def test_rawpy_reads_every_number_back(mosaic: NDArray[np.uint16]) -> None:
    with rawpy.imread(io.BytesIO(encoded(mosaic))) as raw:
        assert np.array_equal(raw.raw_image_visible, mosaic)
        assert raw.black_level_per_channel == [1024] * 4
        assert raw.white_level == 15600
        assert raw.raw_pattern.tolist() == [[0, 1], [3, 2]]
        assert raw.color_desc == b"RGBG"


def test_exif_says_what_a_canon_says() -> None:
    tags = exifread.process_file(io.BytesIO(encoded(np.zeros((16, 16), dtype=np.uint16))))
    assert str(tags["Image Make"]) == "labrig"
    assert str(tags["Image Model"]) == "simulated EOS 5D Mark II"
    assert str(tags["EXIF ExposureTime"]) == "1/60"
    assert str(tags["EXIF FNumber"]) == "28/5"
    assert str(tags["EXIF ISOSpeedRatings"]) == "800"
    assert str(tags["EXIF DateTimeOriginal"]) == "2026:01:01 00:00:00"
    assert str(tags["EXIF SubSecTimeOriginal"]) == "75"


@pytest.mark.parametrize(
    ("exposure_s", "label"),
    [(32, "30"), (16, "15"), (1, "1"), (2 ** (-5 / 3), "0.3"), (1 / 64, "1/60"), (1 / 60, "1/60"),
     (1 / 128, "1/125"), (2**-13, "1/8000"), (47.3, "47")],
)  # fmt: skip
def test_exposure_is_written_as_the_dials_label(exposure_s: float, label: str) -> None:
    assert exposure_label(exposure_s) == Fraction(label)


def test_the_dial_falls_by_thirds_of_a_stop() -> None:
    assert len(DIAL) == 55
    steps = -np.diff(np.log2([float(label) for label in DIAL]))
    assert np.all((steps > 0.15) & (steps < 0.45))


def test_same_picture_same_bytes() -> None:
    mosaic = np.arange(256, dtype=np.uint16).reshape(16, 16)
    assert encoded(mosaic) == encoded(mosaic.copy())
