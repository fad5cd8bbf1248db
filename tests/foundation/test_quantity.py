"""Quantities with units."""

import math

import pytest
from hypothesis import given, strategies as st

from labrig.foundation.quantity import (
    LENGTH_MM,
    MASS_PER_AREA_G_PER_M2,
    TIME_S,
    duration_text,
    parse,
)


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("90 min", 5400.0),
        ("5s", 5.0),
        ("320 ms", 0.32),
        ("1/60 s", 1 / 60),
        ("2 h", 7200.0),
        ("1e3 ms", 1.0),
        (".5 s", 0.5),
        ("5 \u03bcs", 5e-6),
        ("5\u00a0\u00b5s", 5e-6),
        ("5\u202fs", 5.0),
    ],
)
def test_durations(text: str, seconds: float) -> None:
    assert parse(text, TIME_S) == pytest.approx(seconds, rel=1e-15)


@pytest.mark.parametrize("text", ["300 g/m2", "300 g/m²", "30 mg/cm2", "30mg/cm²"])
def test_masses_per_area(text: str) -> None:
    assert parse(text, MASS_PER_AREA_G_PER_M2) == pytest.approx(300.0, rel=1e-15)


def test_thicknesses() -> None:
    assert parse("400 um", LENGTH_MM) == pytest.approx(0.4, rel=1e-15)
    with pytest.raises(ValueError, match="um, µm, mm, cm"):
        parse("0.4 g/m2", LENGTH_MM)


@pytest.mark.parametrize(
    "text", ["5", "five s", "5 parsec", "-5 s", "1/0 s", "nan s", "1e999 s", ""]
)
def test_what_is_no_duration_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="expected"):
        parse(text, TIME_S)


@given(st.floats(1e-6, 1e8))
def test_a_written_duration_is_read_back(seconds: float) -> None:
    assert parse(f"{seconds!r} s", TIME_S) == seconds


@given(st.floats(1e-4, 1e6))
def test_a_spoken_duration_is_right_to_a_percent(seconds: float) -> None:
    words = duration_text(seconds).split()
    total = sum(
        float(number) * TIME_S[unit] for number, unit in zip(words[::2], words[1::2], strict=True)
    )
    assert math.isclose(total, seconds, rel_tol=0.01)
