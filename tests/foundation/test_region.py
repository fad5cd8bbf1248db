"""Regions in pixels and in fractions."""

import pytest
from hypothesis import given, strategies as st

from labrig.foundation.errors import UsageError
from labrig.foundation.region import parse_region, region_pixels


def test_pixels_and_fractions() -> None:
    assert region_pixels((10, 20, 30, 40), 100, 100) == (10, 20, 30, 40)
    assert region_pixels((0.5, 0, 0.5, 1), 1407, 936) == (704, 0, 703, 936)


@given(
    st.integers(20, 6000), st.integers(20, 6000), st.floats(0, 0.9), st.floats(0, 0.9),
    st.floats(0.1, 1), st.floats(0.1, 1),
)  # fmt: skip
def test_what_lies_in_the_frame_is_in_it_as_pixels(
    width: int, height: int, x: float, y: float, w: float, h: float
) -> None:
    region = (x, y, min(w, 1 - x), min(h, 1 - y))
    left, top, wide, high = region_pixels(region, width, height)
    assert left >= 0
    assert top >= 0
    assert left + wide <= width
    assert top + high <= height


@pytest.mark.parametrize(
    "text",
    [
        "", "1,2,3", "1,2,3,x", "-1,2,3,4", "1,2,0,4", "1.5,2,3,4", "nan,0,1,1",
        "inf,0,1,1", "0,0,inf,1", "-inf,0,1,1", "1e308,0,1e308,1",
    ],
)  # fmt: skip
def test_what_is_no_region_is_refused(text: str) -> None:
    with pytest.raises(UsageError, match=r"x, ?y, ?width, ?height"):
        parse_region(text)


def test_fractions_that_leave_the_frame_are_told_as_in_a_protocol() -> None:
    with pytest.raises(UsageError, match=r"inside of the frame.*end at 1.4 of its width"):
        parse_region("0.9,0.9,0.5,0.5")


def test_a_region_outside_is_refused() -> None:
    with pytest.raises(UsageError, match="leaves the frame of 96 × 64"):
        region_pixels((90, 0, 10, 10), 96, 64)
