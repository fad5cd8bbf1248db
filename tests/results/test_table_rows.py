"""Rows of a table that are no measurement, and rows that are."""

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from labrig.foundation.errors import UsageError
from labrig.results import Series, parse_series
from tests.warned import of_code

T_S = np.arange(60.0)
LIGHT = [f"{value:.3f}" for value in 1000 * np.exp(-0.05 * T_S)]


def read(values: Sequence[str], t_s: Sequence[object] | np.ndarray = T_S) -> Series:
    rows = [f"{time},{value}" for time, value in zip(t_s, values, strict=True)]
    (series,) = parse_series("\n".join(["t_s,volt", *rows]), "x")
    return series


MARKS = [
    "9.9e37", "+9.90000000E+37", "-9.9E+37", "9.91e37", "1e38", "-1e38", "3.4028235e+38",
    "9.99999e9", "1e9", "-9999", "-999.9", "OL", "O.L", "-OL", "OVLD", "OVER", "overload",
    "Overflow", "inf", "-INF", "nan", "NaN", "#N/A", "N/A", "-----", "****", "1.#INF", "--",
    "OVER RANGE",
]  # fmt: skip


@pytest.mark.parametrize("mark", MARKS)
@pytest.mark.parametrize("rows", [(0, 1, 2), (7,)])
def test_marks_are_left_out_and_named(mark: str, rows: tuple[int, ...]) -> None:
    values = [mark if row in rows else value for row, value in enumerate(LIGHT)]
    series = read(values)
    kept = [row for row in range(60) if row not in rows]
    assert series.t_s.tolist() == [float(row) for row in kept]
    assert series.values[:, 0].tolist() == [float(LIGHT[row]) for row in kept]
    (warning,) = series.warnings
    assert warning.code == "row-without-value"
    assert warning.subject.startswith(f"line{'s' * (len(rows) > 1)} {rows[0] + 2}")
    assert warning.values == {"cell": mark, "left_out": len(rows)}


def test_what_is_no_number_and_no_mark_is_refused_with_its_line() -> None:
    for cell in ("many", "", "12 V"):
        with pytest.raises(UsageError, match="line 9: expected a number"):
            read([*LIGHT[:7], cell, *LIGHT[8:]])


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    brightest=st.floats(0.3, 1e5),
    background=st.sampled_from([0.0, 0.1, 5.0]),
    scale=st.sampled_from([1.0, 0.0137, 250.0]),
    n=st.integers(10, 200),
    digits=st.integers(3, 9),
)
def test_counts_are_not_complained_about(
    seed: int, brightest: float, background: float, scale: float, n: int, digits: int
) -> None:
    t_s = np.linspace(0, 60, n)
    counts = np.random.default_rng(seed).poisson(brightest * np.exp(-0.1 * t_s) + background)
    assert read([f"{scale * count:.{digits}g}" for count in counts], t_s).warnings == ()


def test_a_meter_that_rounds_is_not_complained_about() -> None:
    """Slow light gives equal values, also above a change of the meter's range."""
    assert read([f"{value:.3g}" for value in 1040 * np.exp(-0.002 * T_S)]).warnings == ()
    assert read([f"{value:.2f}" for value in 0.2 * np.exp(-0.1 * T_S)]).warnings == ()


def test_a_row_that_is_there_twice_counts_once() -> None:
    rows = [*range(20), 19, *range(20, 60), 59]
    series = read([LIGHT[row] for row in rows], [T_S[row] for row in rows])
    assert series.t_s.tolist() == T_S.tolist()
    repeated = of_code(series.warnings, "row-repeated")
    assert (repeated.subject, repeated.values["left_out"]) == ("lines 22, 63", 2)


def test_measurements_at_one_time_are_all_kept() -> None:
    values = np.random.default_rng(1).poisson(np.repeat(30 * np.exp(-0.1 * T_S), 3))
    series = read([str(value) for value in values], np.repeat(T_S, 3))
    assert (len(series.t_s), series.warnings) == (180, ())


def test_readings_that_a_logger_holds_count_once() -> None:
    noise = np.random.default_rng(2).normal(size=60)
    values = np.repeat(1000 * np.exp(-0.05 * T_S) + noise, 3)
    series = read([f"{value:.3f}" for value in values], np.arange(180))
    assert series.t_s.tolist() == list(range(0, 180, 3))
    assert of_code(series.warnings, "reading-held").values["left_out"] == 120


def test_three_values_are_a_ceiling() -> None:
    light = 1000 * np.exp(-0.2 * T_S)
    series = read([f"{min(value, 600):.1f}" for value in light])
    assert series.usable.tolist() == (light < 600).tolist()


@pytest.mark.parametrize("begin", [0, 20])
def test_a_ceiling_is_found_wherever_it_is(begin: int) -> None:
    """Also with noise of the limit, and below the charge of a sample."""
    light = np.append(np.linspace(100, 900, begin), 1000 * np.exp(-0.03 * T_S))
    values = np.minimum(np.round(light), 800.0)
    top = np.flatnonzero(values == 800)
    values[top[2]] = 799
    series = read([f"{value:.0f}" for value in values], np.arange(len(values)))
    assert np.flatnonzero(~series.usable).tolist() == list(range(top[0], top[-1] + 1))
    clipped = of_code(series.warnings, "detector-clipped").values
    assert (clipped["state"], clipped["left_out"]) == ("saturated", top[-1] - top[0] + 1)


def test_a_floor_is_left_out_but_not_rare_photons() -> None:
    light = 10 * np.exp(-0.1 * T_S)
    series = read([f"{value if value > 1 else 0:.3f}" for value in light])
    assert series.usable.tolist() == (light > 1).tolist()
    clipped = of_code(series.warnings, "detector-clipped").values
    assert (clipped["state"], clipped["level"]) == ("at its lowest value", 0)


def test_a_time_that_goes_back_is_said_or_refused() -> None:
    late = np.where(T_S > 30, T_S - 1.5, T_S)
    (warning,) = read(LIGHT, late).warnings
    assert (warning.code, warning.subject) == ("time-goes-back", "line 33")
    assert warning.values == {"before_s": 30, "after_s": 29.5}
    with pytest.raises(UsageError, match=r"line 42: .*counter"):
        read(LIGHT, T_S % 40)
    assert read(LIGHT[:40] * 2, np.tile(T_S[:40], 2)).warnings == ()
    assert read(LIGHT[::-1], T_S[::-1]).warnings == ()


def test_dates_may_be_beside_their_times() -> None:
    (series,) = parse_series(
        "Date,Time,Signal\n10/24/2026,11:59:58 PM,5\n10/25/2026,12:00:01 AM,3\n", "x"
    )
    assert (series.t_s.tolist(), series.channels) == ([0, 3], ("Signal",))
    (one,) = parse_series("Datum;Licht\n24.10.2026 23:59:58;5,5\n25.10.2026 0:00:01;3,5\n", "x")
    assert (one.t_s.tolist(), one.values[0, 0]) == ([0, 3], 5.5)


def test_a_clock_too_coarse_for_its_rows_is_said() -> None:
    cells = [f"12:00:{row // 3:02d}" for row in range(60)]
    (warning,) = read(LIGHT, cells).warnings
    assert (warning.code, warning.values) == ("clock-too-coarse", {"resolution_s": 1})
