"""What libgphoto2's labels mean, as it gives them to a Canon, a Nikon and a Sony."""

import math

import pytest
from hypothesis import given, strategies as st

from labrig.drivers.gphoto2_camera import labels

THIRDS = """
    30 25 20 15 13 10.3 8 6.3 5 4 3.2 2.5 2 1.6 1.3 1 0.8 0.6 0.5 0.4 0.3 1/4 1/5 1/6 1/8 1/10 1/13
    1/15 1/20 1/25 1/30 1/40 1/50 1/60 1/80 1/100 1/125 1/160 1/200 1/250 1/320 1/400 1/500 1/640
    1/800 1/1000 1/1250 1/1600 1/2000 1/2500 1/3200 1/4000 1/5000 1/6400 1/8000
"""
NIKON_THIRDS = """
    30 25 20 15 13 10 8 6 5 4 3 25/10 2 16/10 13/10 1 10/13 10/16 1/2 10/25 1/3 1/4 1/5 1/6 1/8 1/10
    1/13 1/15 1/20 1/25 1/30 1/40 1/50 1/60 1/80 1/100 1/125 1/160 1/200 1/250 1/320 1/400 1/500
    1/640 1/800 1/1000 1/1250 1/1600 1/2000 1/2500 1/3200 1/4000 1/5000 1/6400 1/8000
"""
SONY_THIRDS = """
    300/10 250/10 200/10 150/10 130/10 100/10 80/10 60/10 50/10 40/10 32/10 25/10 20/10 16/10 13/10
    10/10 8/10 6/10 5/10 4/10 1/3 1/4 1/5 1/6 1/8 1/10 1/13 1/15 1/20 1/25 1/30 1/40 1/50 1/60
"""
HALVES = """
    30 20 15 10 8 6 4 3 2 1.5 1 0.7 0.5 0.3 1/4 1/6 1/8 1/10 1/15 1/20 1/30 1/45 1/60 1/90 1/125
    1/180 1/250 1/350 1/500 1/750 1/1000 1/1500 1/2000 1/3000 1/4000 1/6000 1/8000
"""


@pytest.mark.parametrize(
    ("said", "steps"), [(THIRDS, 3), (NIKON_THIRDS, 3), (SONY_THIRDS, 3), (HALVES, 2)]
)
def test_a_dial_in_steps_of_a_stop(said: str, steps: int) -> None:
    dial = said.split()
    times_s = labels.true_times_s(["Bulb", "Auto", *dial, "Time"])
    assert list(times_s) == dial
    expected = [2.0 ** (5 - n / steps) for n in range(len(dial))]
    assert list(times_s.values()) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("said", [THIRDS, NIKON_THIRDS, SONY_THIRDS, HALVES])
def test_a_time_is_found_by_its_label_and_by_its_true_value(said: str) -> None:
    times_s = labels.true_times_s(said.split())
    for label, true_s in times_s.items():
        assert labels.label_of_time(true_s, times_s) == label
        named_s = labels.labelled_time_s(label)
        assert named_s is not None
        assert labels.label_of_time(named_s, times_s) == label


def test_a_time_between_two_of_the_dial_is_none_of_it() -> None:
    times_s = labels.true_times_s(THIRDS.split())
    assert labels.label_of_time(2.0 ** (-5 / 6), times_s) is None
    assert labels.label_of_time(100.0, times_s) is None
    assert labels.label_of_time(1.0, {}) is None


@pytest.mark.parametrize(
    ("label", "time_s"),
    [("0.0166s", 0.0166), ('2.5"', 2.5), ("300/10", 30.0), ("1/60", 1 / 60), ("1 sec", 1.0)],
)
def test_ways_to_write_a_time(label: str, time_s: float) -> None:
    assert labels.labelled_time_s(label) == pytest.approx(time_s)


@pytest.mark.parametrize("label", ["bulb", "Auto", "", "1/0", "0", "-1", "Time", "x 200", "1//2"])
def test_what_is_no_time(label: str) -> None:
    assert labels.labelled_time_s(label) is None


def test_longer_than_any_dial_is_a_timer_and_as_it_says() -> None:
    assert labels.true_times_s(["15", "30", "60", "900"]) == {
        "15": 16.0, "30": 32.0, "60": 60.0, "900": 900.0,
    }  # fmt: skip


@given(st.lists(st.text("0123456789/.s ²", max_size=8)))
def test_any_list_of_labels(said: list[str]) -> None:
    for label, true_s in labels.true_times_s(said).items():
        named_s = labels.labelled_time_s(label)
        assert named_s is not None
        assert abs(math.log2(true_s / named_s)) <= 0.25


@pytest.mark.parametrize(
    ("label", "value"),
    [("5.6", 5.6), ("f/5.6", 5.6), ("F2", 2.0), ("f 11", 11.0), ("0", None), ("auto", None)],
)
def test_apertures(label: str, value: float | None) -> None:
    assert labels.f_number(label) == value


@pytest.mark.parametrize(
    ("label", "value"), [("400", 400), ("Auto", None), ("Hi 1", None), ("0", None), ("²", None)]
)
def test_sensitivities(label: str, value: int | None) -> None:
    assert labels.iso(label) == value


@pytest.mark.parametrize(
    ("label", "is_raw"),
    [
        *((label, True) for label in ("RAW", "NEF (Raw)", "raw", "DNG")),
        *((label, False) for label in ("cRAW", "mRAW", "sRAW1", "RAW + L", "NEF+Fine")),
        *((label, False) for label in ("JPEG Fine", "RAW+HEIF", "RAW,JPEG", "TIFF (RGB)", "")),
    ],
)
def test_image_formats(label: str, is_raw: bool) -> None:
    assert labels.is_raw_alone(label) is is_raw
