"""Clocks in a column of times, counted in seconds from the first row.

What one cell leaves open (which number is the day, whether `12:05` are hours or minutes) is told by
all rows together, by the header or by the user, or refused. Differences are exact: they are taken
between whole numbers of the last digit.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
from itertools import pairwise
from statistics import median

import numpy as np
import numpy.typing as npt

from labrig.foundation.errors import UsageError
from labrig.text_table.times.clock_jumps import Clock, continuous
from labrig.text_table.times.clock_reading import ClockReading, full_year, parse_clock

SECONDS_A_DAY = 86400
_HALF_DAY_H, _DAY_H = 12, 24
_TWO_PARTS, _THREE_PARTS = 2, 3
#: Orders of the numbers in a date: indices of year, month and day.
_ORDERS = {
    "year-month-day": (0, 1, 2),
    "day.month.year": (2, 1, 0),
    "month/day/year": (2, 0, 1),
}
#: What says an order with the option `--time-unit`.
_SAID = {
    "year-month-day": "yyyy-mm-dd",
    "day.month.year": "dd/mm/yyyy",
    "month/day/year": "mm/dd/yyyy",
}
#: Longest row spacing over the median one of rows that are regular. With the wrong order of day
#: and month the longest one is more by this factor.
_REGULAR = 10.0
#: Fewest row spacings that tell whether rows are regular.
_FEWEST_SPACINGS = 3
#: Forms of clocks in headers and in the option `--time-unit`.
_HOURS_MINUTES = re.compile(r"\bh+:m|uhrzeit|clock|time of day|heure|\blocal|\butc|\bh(ours)?\b")
_MINUTES_SECONDS = re.compile(r"(?<!:)\bm+(in)?:s|\bmin(utes)?\b")
_DATE_FORMS = {
    "year-month-day": re.compile(r"\b(y+|j+|year)\W+m\w*\W+[dt]\w*"),
    "day.month.year": re.compile(r"\b(d+|t+|day)\W+m\w*"),
    "month/day/year": re.compile(r"\b(m+|month)\W+d\w*"),
}


@dataclass(frozen=True, eq=False)
class ClockTimes:
    """Times by a clock.

    Attributes
    ----------
    t_s
        Seconds from the earliest row, shape (n,).
    form
        How the clock was understood, in words.
    resolution_s
        Last digit that the clock shows, in seconds.
    warnings
        Jumps of the clock, and what was done about them.
    """

    t_s: npt.NDArray[np.float64]
    form: str
    resolution_s: float
    warnings: tuple[str, ...]


def is_clock_form(text: str) -> bool:
    """Return whether a text says how a clock is to be read, such as `hh:mm` or `dd/mm/yyyy`.

    Examples
    --------
    >>> from labrig.text_table.times.clock_times import is_clock_form
    >>> is_clock_form("mm:ss"), is_clock_form("dd/mm/yyyy"), is_clock_form("ms")
    (True, True, False)
    """
    form = text.lower()
    return any(
        pattern.search(form) for pattern in (re.compile(r"\w:\w"), *_DATE_FORMS.values())
    ) and not any(mark.isdigit() for mark in form)


def read_clock(cells: Sequence[str], lines: Sequence[int], hint: str = "") -> ClockTimes | None:
    """Return the times of a column of clocks; None if its first cell is no clock.

    Parameters
    ----------
    cells
        Cells of the column.
    lines
        Line number of each cell, for messages.
    hint
        What the header and the user say of the form, such as `hh:mm` or `dd/mm/yyyy`.

    Returns
    -------
    ClockTimes or None
        Times from the earliest row, which may be the last one of the table. Without dates a time of
        day that falls by more than half a day is one of the next day.

    Raises
    ------
    UsageError
        A cell differs in form from the others, the clock can be read in two ways, or it goes back.

    Examples
    --------
    >>> from labrig.text_table.times.clock_times import read_clock
    >>> clock = read_clock(["24.10.2026 23:59:59,5", "25.10.2026 00:00:01"], [2, 3])
    >>> clock.t_s.tolist(), clock.form
    ([0.0, 1.5], 'clock, day.month.year, counted from the first row, 24.10.2026 23:59:59,5')
    """
    if parse_clock(cells[0]) is None:
        return None
    readings = _readings(cells, lines)
    hint = hint.lower()
    unit_s = _unit_of_two_parts(readings, cells, lines, hint)
    per_s = 10 ** max(len(reading.fraction) for reading in readings)
    of_day = [_ticks_of_day(reading, unit_s, per_s) for reading in readings]
    order, days = _days(readings, cells, hint, [ticks / per_s for ticks in of_day])
    ticks = [
        of + (day * SECONDS_A_DAY - (reading.offset_s or 0)) * per_s
        for of, day, reading in zip(of_day, days, readings, strict=True)
    ]
    has_offsets = len({reading.offset_s for reading in readings}) > 1
    resolution_s = _resolution_s(readings, unit_s, per_s)
    wrap_s = _wrap_s(readings, unit_s)
    newest_first = _is_newest_first(ticks, wrap_s * per_s)
    rows = range(len(ticks))[:: -1 if newest_first else 1]
    clock = continuous(
        Clock(
            ticks=[ticks[row] for row in rows],
            per_s=per_s,
            resolution_s=resolution_s,
            cells=[cells[row] for row in rows],
            lines=[lines[row] for row in rows],
            wrap_s=wrap_s,
            has_dates=bool(readings[0].date) and order != "",
            is_absolute=readings[0].offset_s is not None,
            could_be_12_hour=_could_be_12_hour(readings, unit_s),
        )
    )
    t_s = np.array([(tick - clock.ticks[0]) / per_s for tick in clock.ticks])
    parts = (
        "stopwatch, minutes:seconds" if unit_s == 1 else "clock",
        "12-hour" if readings[0].half else "",
        clock.form,
        order,
        "offsets from UTC taken off" if has_offsets else "",
        f"counted from the {'last' if newest_first else 'first'} row, {cells[rows[0]].strip()}",
    )
    return ClockTimes(
        t_s=t_s[::-1] if newest_first else t_s,
        form=", ".join(part for part in parts if part),
        resolution_s=resolution_s,
        warnings=clock.warnings,
    )


def _readings(cells: Sequence[str], lines: Sequence[int]) -> list[ClockReading]:
    """Return what every cell says, in one form."""
    readings = []
    first = parse_clock(cells[0])
    for cell, line in zip(cells, lines, strict=True):
        reading = parse_clock(cell)
        if reading is None or first is None or _kind(reading) != _kind(first):
            raise UsageError(
                f"line {line}: expected a time in the form of the first, '{cells[0].strip()}', got "
                f"'{cell.strip()}'; write all times in one form, or delete the row"
            )
        readings.append(reading)
    return readings


def _kind(reading: ClockReading) -> tuple[bool, bool, bool, str]:
    """Return what a clock shows; one with a date alone is at midnight and may miss the rest."""
    return (
        bool(reading.date),
        bool(reading.half),
        reading.offset_s is not None,
        reading.zone,
    )


def _unit_of_two_parts(
    readings: Sequence[ClockReading], cells: Sequence[str], lines: Sequence[int], hint: str
) -> int:
    """Return the unit in seconds of the last part of `12:05`: 60, or 1 of a stopwatch."""
    two = [row for row, reading in enumerate(readings) if len(reading.parts) == _TWO_PARTS]
    first = readings[0]
    if not two or first.date or first.half or first.offset_s is not None:
        return 60
    three = [row for row, reading in enumerate(readings) if len(reading.parts) == _THREE_PARTS]
    if three:
        # A stopwatch shows its hours when it has some.
        if (
            two[-1] < three[0]
            and readings[three[0]].parts[0] == 1
            and not any(readings[row].parts[0] >= 60 for row in two)
        ):
            return 1
        raise UsageError(
            f"line {lines[two[0]]}: expected times in one form, got '{cells[two[0]].strip()}' and "
            f"'{cells[three[0]].strip()}'; write all as hh:mm:ss"
        )
    hours = [reading.parts[0] for reading in readings]
    turns = list(pairwise(hours))
    if any(reading.fraction for reading in readings) or (59, 0) in turns:
        return 1
    if (23, 0) in turns:
        return 60
    says_hours, says_minutes = _HOURS_MINUTES.search(hint), _MINUTES_SECONDS.search(hint)
    if bool(says_hours) == bool(says_minutes):
        raise UsageError(
            f"expected times that can be read in one way, got '{cells[0].strip()}', hours and "
            "minutes or minutes and seconds: say '--time-unit hh:mm' or '--time-unit mm:ss'"
        )
    return 60 if says_hours else 1


def _ticks_of_day(reading: ClockReading, unit_s: int, per_s: int) -> int:
    """Return the time of day in units of the last digit."""
    parts = [*reading.parts]
    if reading.half:
        parts[0] = parts[0] % _HALF_DAY_H + (_HALF_DAY_H if reading.half == "p" else 0)
    if len(parts) == _TWO_PARTS and unit_s == 1:
        parts.insert(0, 0)
    seconds = sum(part * weight for part, weight in zip(parts, (3600, 60, 1), strict=False))
    digits = len(str(per_s)) - 1
    return seconds * per_s + int(reading.fraction.ljust(digits, "0") or 0)


def _resolution_s(readings: Sequence[ClockReading], unit_s: int, per_s: int) -> float:
    """Return the last digit of the clock in seconds."""
    longest = max(len(reading.parts) for reading in readings)
    if not longest:
        return SECONDS_A_DAY
    return unit_s if longest == _TWO_PARTS and unit_s > 1 else 1 / per_s


def _wrap_s(readings: Sequence[ClockReading], unit_s: int) -> int:
    """Return after how many seconds the clock begins again; 0 if it does not."""
    if readings[0].date:
        return 0
    highest = max(reading.parts[0] for reading in readings)
    if unit_s == 1:
        return 0 if highest >= 60 or len(readings[-1].parts) > _TWO_PARTS else 3600
    return SECONDS_A_DAY if highest < _DAY_H else 0


def _is_newest_first(ticks: Sequence[int], wrap: int) -> bool:
    """Return whether most rows are earlier than the row before."""
    signs = 0
    for before, after in pairwise(ticks):
        step = (after - before + wrap // 2) % wrap - wrap // 2 if wrap else after - before
        signs += (step > 0) - (step < 0)
    return signs < 0


def _could_be_12_hour(readings: Sequence[ClockReading], unit_s: int) -> bool:
    """Return whether the clock may be one of 12 hours that does not say which half of the day."""
    first = readings[0]
    return (
        unit_s > 1
        and not first.date
        and not first.half
        and all(1 <= reading.parts[0] <= _HALF_DAY_H for reading in readings)
    )


def _days(
    readings: Sequence[ClockReading], cells: Sequence[str], hint: str, of_day_s: Sequence[float]
) -> tuple[str, list[int]]:
    """Return the order of the numbers in the dates, empty if it does not matter, and the days."""
    if not readings[0].date:
        return "", [0] * len(readings)
    dates = {reading.date for reading in readings}
    days = {order: found for order in _ORDERS if (found := _ordinals(dates, order)) is not None}
    hinted = [order for order, form in _DATE_FORMS.items() if form.search(hint)][:1]
    if hinted:
        days = {order: found for order, found in days.items() if order in hinted}
    elif "." in cells[0].split(":")[0] and "day.month.year" in days:
        # Nobody writes the month first between points.
        days = {"day.month.year": days["day.month.year"]}
    if not days:
        raise UsageError(
            f"expected dates that all are of the calendar{' as ' + hinted[0] if hinted else ''}, "
            f"got '{cells[0].strip()}' and the like"
        )
    if len(days) > 1 and len(dates) == 1:
        return "", [0] * len(readings)
    if len(days) > 1:
        days = _likely(days, readings, of_day_s)
    if len(days) > 1:
        raise UsageError(
            f"expected dates that can be read in one way, got '{cells[0].strip()}', "
            f"{' or '.join(days)}: say "
            + " or ".join(f"'--time-unit {_SAID[order]}'" for order in days)
        )
    ((order, ordinals),) = days.items()
    return order, [ordinals[reading.date] for reading in readings]


def _ordinals(dates: set[tuple[str, ...]], order: str) -> dict[tuple[str, ...], int] | None:
    """Return the ordinal days of dates that are written in an order; None if one is no date."""
    year, month, day = _ORDERS[order]
    try:
        return {
            numbers: date(
                _year(numbers[year]), _two(numbers[month]), _two(numbers[day])
            ).toordinal()
            for numbers in dates
        }
    except ValueError:
        return None


def _year(text: str) -> int:
    if len(text) == 1:
        raise ValueError("a year has two or four digits")
    return full_year(text)


def _two(text: str) -> int:
    if len(text) > len("12"):
        raise ValueError("a day or month has one or two digits")
    return int(text)


def _likely(
    days: dict[str, dict[tuple[str, ...], int]],
    readings: Sequence[ClockReading],
    of_day_s: Sequence[float],
) -> dict[str, dict[tuple[str, ...], int]]:
    """Return the orders of day and month in which time goes on, and in regular steps."""
    steps_s = {}
    for order, ordinals in days.items():
        t_s = [
            ordinals[reading.date] * SECONDS_A_DAY + of
            for reading, of in zip(readings, of_day_s, strict=True)
        ]
        steps_s[order] = [after - before for before, after in pairwise(t_s)]
    monotone = [
        order
        for order, steps in steps_s.items()
        # Summer time may end.
        if all(step >= -3600 for step in steps) or all(step <= 3600 for step in steps)
    ]
    orders = monotone or list(days)
    ratio = {}
    for order in orders:
        sizes = [abs(step) for step in steps_s[order] if step]
        enough = len(sizes) >= _FEWEST_SPACINGS
        ratio[order] = max(sizes) / median(sizes) if enough else _REGULAR
    best = min(orders, key=lambda order: ratio[order])
    others = [ratio[order] for order in orders if order != best]
    if ratio[best] < _REGULAR and all(other > _REGULAR * ratio[best] for other in others):
        orders = [best]
    return {order: days[order] for order in orders}
