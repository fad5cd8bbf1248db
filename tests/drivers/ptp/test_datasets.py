"""Datasets of the PTP standard, read from bytes that cameras and chance have written."""

import struct

import pytest
from hypothesis import given, strategies as st

from labrig.drivers.ptp.device_info import parse_device_info
from labrig.drivers.ptp.standard.object_info import parse_object_info
from labrig.drivers.ptp.standard.properties import (
    PropertyDescription,
    parse_property_description,
)
from labrig.foundation.errors import DeviceError

#: ExposureTime of libgphoto2's virtual Nikon: 10 ms now, nine times from 1 s to 0.1 ms.
EXPOSURE_TIME = bytes.fromhex(
    "0d50 0600 01 64000000 64000000 02 0900 10270000 e8030000 f4010000 c8000000 64000000 32000000"
    "19000000 0c000000 01000000"
)
#: Its BatteryLevel, 50 % of a range from 0 to 100, which cannot be set.
BATTERY_LEVEL = bytes.fromhex("0150 0200 00 32 32 01 00 64 01")
#: Its ImageSize, a text.
IMAGE_SIZE = bytes.fromhex("0350 ffff 00 02 3600 0000 02 3600 0000 00")
#: An object of the same camera.
JPEG = bytes.fromhex(
    "01000100 0138 0000 8d1e0000 0000 00000000 00000000 00000000 00000000 00000000 00000000"
    "03000000 0000 00000000 00000000"
) + b"".join(
    bytes([len(text) + 1]) + (text + "\0").encode("utf-16-le")
    for text in ("GPH_0099.JPG", "20261121T130122", "20261121T130122", "keyword")
)


def test_an_enumeration() -> None:
    described = parse_property_description(EXPOSURE_TIME)
    times = (10000, 1000, 500, 200, 100, 50, 25, 12, 1)
    assert described == PropertyDescription(6, True, 100, times)
    assert described.settable_to([7]) == times
    assert described.encode(500) == b"\xf4\1\0\0"
    assert described.decode(b"\xf4\1\0\0") == 500
    with pytest.raises(DeviceError, match="f4 01"):
        described.decode(b"\xf4\1")


def test_a_range() -> None:
    described = parse_property_description(BATTERY_LEVEL)
    assert described == PropertyDescription(2, False, 50, range(0, 101))
    assert described.settable_to([10, 20]) == (50,), "it cannot be set"
    settable = PropertyDescription(4, True, 5, range(0, 100, 5))
    assert settable.settable_to([1, 10, 100]) == [10]


def test_a_text_is_no_number() -> None:
    assert parse_property_description(IMAGE_SIZE) is None


def test_an_object() -> None:
    info = parse_object_info(JPEG)
    assert (info.storage, info.object_format, info.size_bytes) == (0x00010001, 0x3801, 7821)
    assert (info.name, info.stem, info.suffix) == ("GPH_0099.JPG", "GPH_0099", ".jpg")
    assert info.captured == "20261121T130122"
    assert not info.is_raw


@pytest.mark.parametrize(
    ("name", "object_format", "is_raw"),
    [
        ("DSC_0001.NEF", 0x3000, True),
        ("DSC_0001.NEF", 0x3802, True),
        ("DSC_0001.DNG", 0x3811, True),
        ("DSC_0001.NEF", 0xB103, True),
        ("DSC_0001.NEF", 0x3801, False),
        ("DSC_0001.JPG", 0x3000, False),
        ("DSC_0001.HIF", 0xB982, False),
        ("DSC_0001.WAV", 0x3008, False),
        ("IMG1", 0x3000, False),
        ("DSC_0001.N/F", 0x3000, False),
    ],
)
def test_what_can_be_raw(name: str, object_format: int, is_raw: bool) -> None:
    head = struct.pack("<IHHI", 1, object_format, 0, 1000) + bytes(40)
    text = bytes([len(name)]) + name.encode("utf-16-le")
    assert parse_object_info(head + text + b"\0").is_raw is is_raw


datasets = st.binary(max_size=80) | st.builds(
    lambda known, at, byte, end: (known[:at] + byte + known[at + 1 :])[:end],
    st.sampled_from([EXPOSURE_TIME, BATTERY_LEVEL, IMAGE_SIZE, JPEG]),
    st.integers(0, 60),
    st.binary(max_size=2),
    st.integers(0, 200),
)


@given(datasets)
def test_any_bytes_are_read_or_said_to_be_cut_short(data: bytes) -> None:
    for parse in (parse_device_info, parse_object_info, parse_property_description):
        try:
            parse(data)
        except DeviceError as error:
            assert "cut short" in str(error)
            assert "\n" not in str(error)
