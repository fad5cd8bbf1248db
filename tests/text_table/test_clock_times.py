"""Clocks in a column of times."""

from collections.abc import Callable
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from labrig.foundation.errors import UsageError
from labrig.text_table.times import ClockTimes, is_clock_form, read_clock


def read(*cells: str, hint: str = "") -> ClockTimes:
    clock = read_clock(cells, range(2, 2 + len(cells)), hint)
    assert clock is not None
    return clock


def _twelve(moment: datetime) -> str:
    return f"{(moment.hour - 1) % 12 + 1}:{moment:%M:%S} {'ap'[moment.hour // 12]}.m."


#: How programs write a moment, and which numbers of its date could be taken for each other.
FORMS: dict[str, Callable[[datetime], str]] = {
    "ISO": lambda at: at.isoformat(sep=" ", timespec="milliseconds"),
    "ISO with Z": lambda at: at.isoformat(timespec="milliseconds") + "Z",
    "ISO with offset": lambda at: f"{at:%Y-%m-%dT%H:%M:%S}.{at.microsecond // 1000:03d}+02:00",
    "year first": lambda at: f"{at:%Y/%m/%d %H:%M:%S},{at.microsecond // 1000:03d}",
    "German": lambda at: f"{at:%d.%m.%Y %H:%M:%S},{at.microsecond // 1000:03d}",
    "German, short": lambda at: f"{at.day}.{at.month}.{at:%Y} {at.hour}:{at:%M:%S}",
    "US": lambda at: f"{at:%m/%d/%Y} {_twelve(at)}",
    "British": lambda at: f"{at:%d/%m/%Y %H:%M:%S}",
    "two digits": lambda at: f"{at:%d/%m/%y %H:%M:%S}",
    "month's name": lambda at: f"{at:%d-%b-%Y %H:%M:%S}",
    "C": lambda at: f"{at:%a %b %d %H:%M:%S} CET {at:%Y}",
    "time first": lambda at: f"{at:%H:%M:%S %Y-%m-%d}",
    "digits": lambda at: f"{at:%Y%m%d%H%M%S}",
    "basic": lambda at: f"{at:%Y%m%dT%H%M%S}",
    "no date": lambda at: f"{at:%H:%M:%S}.{at.microsecond // 1000:03d}",
    "no date, 12 hours": lambda at: _twelve(at).upper().replace(" ", "").replace(".", ""),
}


@settings(max_examples=60, deadline=None)
@given(
    form=st.sampled_from(list(FORMS)),
    start=st.datetimes(datetime(2000, 1, 1), datetime(2060, 1, 1)),
    steps_ms=st.lists(st.integers(1, 20_000_000), min_size=1, max_size=12),
    regular=st.booleans(),
    newest_first=st.booleans(),
)
def test_any_clock_gives_its_differences_or_is_refused(
    form: str, start: datetime, steps_ms: list[int], regular: bool, newest_first: bool
) -> None:
    if regular:
        steps_ms = steps_ms[:1] * 12
    moments = [start.replace(microsecond=0)]
    for step in steps_ms:
        moments.append(moments[-1] + timedelta(milliseconds=step))
    if ".%" not in form and "milli" not in form:
        moments = [moment.replace(microsecond=0) for moment in moments]
    cells = [FORMS[form](moment) for moment in moments]
    true_s = np.array([(moment - moments[0]).total_seconds() for moment in moments])
    if newest_first:
        cells, true_s = cells[::-1], true_s[::-1]
    try:
        clock = read(*cells)
    except UsageError as refusal:
        # Day and month fit both, or a clock without a date that goes back.
        assert "line" in str(refusal) or "--time-unit" in str(refusal)
        assert form in ("US", "British", "two digits") or "back" in str(refusal)
        return
    if newest_first and len(cells) == 2 and "no date" in form:
        return  # Two times of day do not tell which is the earlier one.
    assert clock.t_s.tolist() == pytest.approx(true_s.tolist(), abs=1e-12)
    assert not clock.warnings or regular


def test_summer_time_between_hourly_rows() -> None:
    cells = [f"2026-10-24 {hour}:45" for hour in range(18, 24)]
    cells += [f"2026-10-25 {hour:02}:45" for hour in (0, 1, 2, 2, 3, 4, 5)]
    clock = read(*cells)
    assert clock.t_s.tolist() == list(range(0, 3600 * len(cells), 3600))
    assert clock.warnings[0].code == "summer-time"


@pytest.mark.parametrize(
    ("cells", "t_s"),
    [
        (("12:05:00AM", "1:05:00 a.m.", "12:05:00pm"), [0, 3600, 43200]),
        (("11:59:58 PM", "12:00:01 AM"), [0, 3]),
        (("12:00 PM", "12:01 pm", "1:02 PM"), [0, 60, 3720]),
        (("00:05.2", "00:06.4", "1:00.0"), [0, 1.2, 54.8]),
        (("59:58.5", "59:59.0", "00:00.0", "00:01.5"), [0, 0.5, 1.5, 3]),
        (("59:58", "59:59", "1:00:00", "1:00:01"), [0, 1, 2, 3]),
        (("23:58", "23:59", "0:00", "0:01"), [0, 60, 120, 180]),
        (("25:00:00", "26:30:00"), [0, 5400]),
        (("12:00:05:123", "12:00:06:001"), [0, 0.878]),
        (("2026-10-24", "2026-10-25", "2026-10-27"), [0, 86400, 259200]),
        (("2026-10-24 23:59:59", "2026-10-25", "2026-10-25 00:00:01"), [0, 1, 2]),
        (("2026-10-25T02:59:58+02:00", "2026-10-25T02:00:00+0100"), [0, 2]),
        (("2026-10-25 02:59:58 CEST", "2026-10-25 02:00:00 CET"), [0, 2]),
        (("2026-03-29T01:59:58-05:30", "2026-03-29T03:00:00-04:30"), [0, 2]),
        (("24/Oct/2026:23:59:58 +0200", "25/Oct/2026:00:00:00 +0200"), [0, 2]),
        (("Sa 24. Okt 2026 23:59:58", "So 25. Okt 2026 0:00:00"), [0, 2]),
        (("Mar 1, 2026 11:59:58 PM", "Mar 2, 2026 12:00:00 AM"), [0, 2]),
    ],
    ids=lambda value: str(value)[:40],
)
def test_forms(cells: tuple[str, ...], t_s: list[float]) -> None:
    assert read(*cells).t_s.tolist() == t_s


def test_digits_beyond_those_of_a_float_of_seconds_are_kept() -> None:
    """Seconds since year 1 have only 1e-5 s left in a float."""
    clock = read("2026-10-24 12:00:00.123456789", "2026-10-24 12:00:00.123456790")
    assert clock.t_s[1] == 1e-9


def _every_two_seconds(start: datetime, hour_at: int, by_h: int) -> list[str]:
    moments = [start + timedelta(seconds=2 * k) for k in range(20)]
    return [
        f"{moment + timedelta(hours=by_h * (k >= hour_at)):%Y-%m-%d %H:%M:%S}"
        for k, moment in enumerate(moments)
    ]


@pytest.mark.parametrize("dates", [True, False])
def test_summer_time_ends_and_begins(dates: bool) -> None:
    for start, by_h in (
        (datetime(2026, 10, 25, 2, 59, 40), -1),
        (datetime(2026, 3, 29, 1, 59, 40), 1),
    ):
        cells = _every_two_seconds(start, 10, by_h)
        clock = read(*(cells if dates else [cell[11:] for cell in cells]))
        assert clock.t_s.tolist() == [2 * k for k in range(20)]
        (warning,) = clock.warnings
        assert (warning.code, warning.subject) == ("summer-time", "line 12")


def test_an_hour_at_another_time_is_a_pause_and_said() -> None:
    clock = read(*_every_two_seconds(datetime(2026, 3, 27, 13, 59, 40), 10, 1))
    assert clock.t_s[-1] == 38 + 3600
    assert clock.warnings[0].code == "clock-jumps"


def test_a_clock_that_goes_back_for_no_reason_is_refused_with_its_line() -> None:
    irregular = ("02:59:00", "02:59:20", "02:00:20", "02:05:00")
    for date in ("2026-10-25 ", ""):
        with pytest.raises(UsageError, match=r"line 4: the clock goes back .* offset from UTC"):
            read(*(date + cell for cell in irregular))


def test_a_clock_of_12_hours_without_halves_is_told_by_the_spacing() -> None:
    cells = [f"12:{minute}:00" for minute in range(54, 60)] + [f"1:0{k}:00" for k in range(6)]
    clock = read(*cells)
    assert clock.t_s.tolist() == [60 * k for k in range(12)]
    assert "12-hour" in clock.form


BOTH_FIT = ("03/04/2026 23:00:00", "04/04/2026 01:00:00", "09/04/2026 00:00:02")


def test_the_order_of_day_and_month_is_told_or_asked() -> None:
    with pytest.raises(UsageError, match=r"one way.*dd/mm/yyyy.*mm/dd/yyyy"):
        read(*BOTH_FIT)
    assert read(*BOTH_FIT, hint="dd/mm/yyyy").t_s.tolist() == [0, 7200, 435602]
    month_first = read(*BOTH_FIT, hint="Date (MM/DD/YYYY)")
    assert month_first.t_s[-1] == 184 * 86400 - 23 * 3600 + 2
    # A number above 12, or a midnight between regular rows.
    assert read("10/12/2026 12:00:00", "10/13/2026 12:00:00").t_s[-1] == 86400
    rows = [f"03/04/2026 23:59:5{k}" for k in (4, 6, 8)]
    rows += [f"04/04/2026 00:00:0{k}" for k in (0, 2, 4)]
    clock = read(*rows)
    assert clock.t_s.tolist() == [0, 2, 4, 6, 8, 10]
    assert "day.month.year" in clock.form


@pytest.mark.parametrize(
    ("cells", "hint"),
    [
        (("12:00", "12:01", "12:03"), ""),
        (("12:00:00", "5"), ""),
        (("12:00:00", "12:05"), ""),
        (("12:00:00", "12:00:01 PM"), ""),
        (("2026-10-24 12:00:00Z", "2026-10-24 12:00:01"), ""),
        (("13:00:00 PM", "13:00:01 PM"), "none"),
        (("2026-13-41 12:00:00", "2026-13-42 12:00:00"), ""),
    ],
)
def test_refused(cells: tuple[str, ...], hint: str) -> None:
    if hint == "none":
        assert read_clock(cells, [2, 3]) is None
        return
    with pytest.raises(UsageError, match="expected"):
        read(*cells)


def test_hours_and_minutes_are_told_from_minutes_and_seconds_by_the_header() -> None:
    cells = ("12:00", "12:01", "12:03")
    assert read(*cells, hint="hh:mm").t_s.tolist() == [0, 60, 180]
    assert read(*cells, hint="Uhrzeit").t_s.tolist() == [0, 60, 180]
    assert read(*cells, hint="t / min").t_s.tolist() == [0, 1, 3]
    assert read(*cells, hint="elapsed (mm:ss)").t_s.tolist() == [0, 1, 3]


def test_forms_of_clocks_are_no_units() -> None:
    assert [is_clock_form(text) for text in ("hh:mm", "dd.mm.yyyy", "ms", "1 h", "mile")] == [
        True, True, False, False, False,
    ]  # fmt: skip


def test_numbers_are_no_clocks() -> None:
    for cell in ("995.679", "20261024", "1e-3", "1:2", "", "-5", "12:61"):
        assert read_clock([cell, cell], [1, 2]) is None
    aware = datetime(2026, 1, 1, tzinfo=UTC)
    assert read(aware.isoformat(), aware.isoformat()).t_s.tolist() == [0, 0]
