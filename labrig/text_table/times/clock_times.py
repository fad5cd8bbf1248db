"""Clocks in a column of times, counted in seconds from the first row.

What one cell leaves open (which number is the day, whether `12:05` are hours or minutes) is told by
all rows together, by the header or by the user, or refused. Differences are exact: they are taken
between whole numbers of the last digit.

Time itself does not go back. A clock without a date begins again each day; one with summer time is
set by an hour, which the spacing of the rows around it proves. A clock that goes back for another
reason was set by hand, and nothing tells by how much.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import date
from itertools import pairwise
from statistics import median

import numpy as np
import numpy.typing as npt

from labrig.foundation.errors import UsageError
from labrig.foundation.result_warning import Disturbance, ResultWarning

_HOUR_S, _HALF_DAY_S, _DAY_S = 3600, 43200, 86400
#: Rows before and after a jump whose spacing proves it, and the fewest of them.
_NEIGHBOURS, _FEWEST = 10, 4
#: Longest row spacing from which a jump of an hour stands out.
_MAX_SPACING_S = 3600
#: Largest spacing over the smallest one of regular rows.
_REGULAR_SHARE = 3.0

#: Hours that are left out, or counted twice, in some country, and the months of it.
_NIGHT_H = range(4)

_CHANGE_MONTHS = frozenset({2, 3, 4, 9, 10, 11})

_SUNDAY = 6
#: More jumps ahead by an hour than this are the pauses of a schedule.
_MAX_JUMPS = 2


@dataclass(frozen=True, eq=False)
class Clock:
    """Readings of a clock in the order of time.

    Attributes
    ----------
    ticks, per_s
        Readings in units of their last digit, and how many of them are a second; with dates from
        the calendar's beginning.
    resolution_s
        Last digit that is shown, in seconds.
    cells, lines
        Text and line of each reading.
    wrap_s
        Seconds after which the clock begins again; 0 if it does not.
    has_dates
        Whether the day of each reading is known.
    is_absolute
        Whether the readings are in UTC, which has no summer time.
    could_be_12_hour
        Whether all hours are from 1 to 12, with nothing that tells the half of the day.
    form
        What was found about the clock, in words.
    warnings
        Jumps, and what was done about them.
    """

    ticks: Sequence[int]
    per_s: int
    resolution_s: float
    cells: Sequence[str]
    lines: Sequence[int]
    wrap_s: int
    has_dates: bool
    is_absolute: bool
    could_be_12_hour: bool
    form: str = ""
    warnings: tuple[ResultWarning, ...] = ()


def continuous(clock: Clock) -> Clock:
    """Return the clock without jumps; one that goes back for no known reason is refused.

    Raises
    ------
    UsageError
        The clock goes back, and neither midnight nor summer time explains it.
    """
    if clock.could_be_12_hour:
        clock = _with_24_hours(clock)
    if clock.wrap_s:
        clock = _past_wraps(clock)
    return clock if clock.is_absolute else _without_summer_time(clock)


def _with_24_hours(clock: Clock) -> Clock:
    """Return a clock that goes from 12:59 to 1:00 as one that begins again after 12 hours."""
    steps = _steps(clock.ticks)
    if not any(
        step < 0 and _is_regular(clock, steps, row, step + _HALF_DAY_S * clock.per_s)
        for row, step in enumerate(steps)
    ):
        return clock
    half_day = _HALF_DAY_S * clock.per_s
    return replace(
        clock,
        ticks=[tick % half_day for tick in clock.ticks],
        wrap_s=_HALF_DAY_S,
        form="12-hour without AM and PM",
    )


def _past_wraps(clock: Clock) -> Clock:
    """Return the clock with a day (an hour of a stopwatch) added where it begins again."""
    wrap = clock.wrap_s * clock.per_s
    ticks, wraps = [clock.ticks[0]], 0
    for step, tick in zip(_steps(clock.ticks), clock.ticks[1:], strict=True):
        wraps += 2 * step < -wrap
        ticks.append(tick + wraps * wrap)
    return replace(clock, ticks=ticks)


def _without_summer_time(clock: Clock) -> Clock:
    steps = _steps(clock.ticks)
    hour = _HOUR_S * clock.per_s
    ahead = [row for row, step in enumerate(steps) if _is_regular(clock, steps, row, step - hour)]
    shift, shifts = 0, [0]
    warnings: list[ResultWarning] = []
    for row, step in enumerate(steps):
        line = f"line {clock.lines[row + 1]}"
        before, after = clock.cells[row].strip(), clock.cells[row + 1].strip()
        is_repeated_hour = step == 0 and clock.has_dates and _is_night_of_change(clock, row + 1)
        if (step < 0 or is_repeated_hour) and _is_regular(clock, steps, row, step + hour):
            shift += hour
            warnings.append(
                Disturbance(
                    "summer-time",
                    "the clock goes back from {before} to {after}, by an hour as at the end of "
                    "summer time: the spacing of the rows shows it, and an hour was added from "
                    "there on",
                    line,
                    before=before,
                    after=after,
                )
            )
        elif step < 0:
            _refuse_backward(clock, row, f"{line}: the clock goes back from {before} to {after}")
        elif row in ahead and _crosses_summer_time(clock, row):
            shift -= hour
            warnings.append(
                Disturbance(
                    "summer-time",
                    "the clock goes ahead from {before} to {after}, by an hour as at the start of "
                    "summer time: the spacing of the rows shows it, and an hour was taken off from "
                    "there on",
                    line,
                    before=before,
                    after=after,
                )
            )
        elif row in ahead and len(ahead) <= _MAX_JUMPS:
            warnings.append(
                Disturbance(
                    "clock-jumps",
                    "the clock goes ahead from {before} to {after}, by just an hour more than the "
                    "rows around it: it is taken for a pause; if the clock was set, take the hour "
                    "off the times that follow",
                    line,
                    before=before,
                    after=after,
                )
            )
        shifts.append(shift)
    ticks = [tick + by for tick, by in zip(clock.ticks, shifts, strict=True)]
    return replace(clock, ticks=ticks, warnings=(*clock.warnings, *warnings))


def _refuse_backward(clock: Clock, row: int, from_to: str) -> None:
    """Refuse a clock that goes back, unless its dates tell the order of the rows."""
    step = clock.ticks[row + 1] - clock.ticks[row]
    is_within_an_hour = step > -_HOUR_S * clock.per_s
    if clock.has_dates and not (is_within_an_hour and _is_night_of_change(clock, row + 1)):
        return
    raise UsageError(
        f"{from_to}, and the spacing of the rows does not show why: did summer time end, or was it "
        "set? Write the times with their offset from UTC (2026-10-25 02:00:00+01:00), or as "
        "seconds"
    )


def _steps(ticks: Sequence[int]) -> list[int]:
    return [after - before for before, after in pairwise(ticks)]


def _is_regular(clock: Clock, steps: Sequence[int], row: int, step: int) -> bool:
    """Return whether `step` is like the steps around row `row`, which are regular."""
    near = [*steps[max(row - _NEIGHBOURS, 0) : row], *steps[row + 1 : row + 1 + _NEIGHBOURS]]
    longest = _MAX_SPACING_S * clock.per_s
    near = [other for other in near if 0 <= other <= longest]
    if len(near) < _FEWEST:
        return False
    low, high = min(near), max(near)
    shown = clock.resolution_s * clock.per_s
    margin = high - low + shown
    return (
        high <= _REGULAR_SHARE * low + 2 * shown and max(low - margin, 0) <= step <= high + margin
    )


def _crosses_summer_time(clock: Clock, row: int) -> bool:
    """Return whether an hour is left out after row `row` that summer time may leave out."""
    day = _DAY_S * clock.per_s
    before, after = clock.ticks[row], clock.ticks[row + 1]
    begin = after // day * day
    hour = _HOUR_S * clock.per_s
    leaves_out = any(
        before < begin + number * hour and begin + (number + 1) * hour <= after
        for number in _NIGHT_H
    )
    return leaves_out and (not clock.has_dates or _is_night_of_change(clock, row + 1))


def _is_night_of_change(clock: Clock, row: int) -> bool:
    """Return whether clocks are set somewhere in the night of a row with a date."""
    days, ticks = divmod(clock.ticks[row], _DAY_S * clock.per_s)
    on = date.fromordinal(days)
    is_night = ticks < (len(_NIGHT_H) + 1) * _HOUR_S * clock.per_s
    return is_night and on.weekday() == _SUNDAY and on.month in _CHANGE_MONTHS


_HOURS_OF_HALF_DAY = 12
#: First of the two-digit years that belong to the last century, as in POSIX.
_PIVOT_YEAR = 69

#: First letters of the months' names in English, German and French.
_MONTHS = {
    letters: number
    for number, names in enumerate(
        (
            "jan", "feb fév fev", "mar mär mrz", "apr avr", "may mai", "jun juin", "jul juil",
            "aug aoû aou", "sep", "oct okt", "nov", "dec dez déc",
        ),
        start=1,
    )
    for letters in names.split()
}  # fmt: skip
#: Hours ahead of UTC by the names that clocks print; where one changes, summer time does.
_ZONES_H = {
    "Z": 0, "UTC": 0, "UT": 0, "GMT": 0, "WET": 0, "WEST": 1, "BST": 1, "CET": 1, "MEZ": 1,
    "CEST": 2, "MESZ": 2, "EET": 2, "EEST": 3, "MSK": 3, "JST": 9, "EST": -5, "EDT": -4,
    "CST": -6, "CDT": -5, "MST": -7, "MDT": -6, "PST": -8, "PDT": -7,
}  # fmt: skip

_WEEKDAY = re.compile(r"[^\W\d_]{2,10}\.?,?\s+(?=\d)")
#: As C's `ctime` and the shell's `date` print it: `Sat Oct 24 23:59:30 CEST 2026`.
_YEAR_LAST = re.compile(r"([^\W\d_]{3} \d{1,2}) (\d\d?:\d\d:\d\d\S*(?: [A-Z]{3,4})?) (\d{4})")
_NAMED_MONTH = re.compile(
    r"(?:(?P<d>\d{1,2})\.?[\s\-/]*(?P<m>[^\W\d_]{3,9})\.?[\s,\-/]+"
    r"|(?P<m2>[^\W\d_]{3,9})\.?\s+(?P<d2>\d{1,2}),?\s+)(?P<y>\d{4}|\d\d(?!:))(?!\d)"
)
_BASIC = re.compile(r"(\d{8})[T_](\d\d)(\d\d)(\d\d)")
#: `20261024235930`, which no count of seconds reaches.
_DIGITS = re.compile(
    r"((?:19|20)\d\d(?:0[1-9]|1[0-2])(?:0[1-9]|[12]\d|3[01]))([01]\d|2[0-3])([0-5]\d)([0-5]\d)"
)
_DATE = r"(?P<d1>\d{4}|\d\d?)(?P<mark>[-/.])(?P<d2>\d\d?)(?P=mark)(?P<d3>\d{4}|\d\d?)\.?"
_ANY_DATE = rf"(?:{_DATE}|(?P<compact>\d{{8}}))"
_TIME = (
    r"(?P<a>\d{1,3}):(?P<b>[0-5]\d)"
    r"(?::(?P<c>[0-5]\d)(?:[.,](?P<f>\d*)|:(?P<ms>\d{3}))?|[.,](?P<g>\d+))?"
    r"(?:\s*(?P<half>[AaPp])\.?\s?[Mm]\.?)?(?:\s*(?:Uhr|h))?"
)
_ZONE = (
    r"(?:\s*(?P<zone>Z|UTC|UT|GMT|[A-Z]{3,4})?(?P<offset>[+\-]\d\d?(?::?\d\d)?)?(?:\[[\w/]+\])?)?"
)
_FORMS = (
    re.compile(rf"(?:{_ANY_DATE}(?:T|[\s,;_]+|[-:](?=\d\d?:)))?{_TIME}{_ZONE}"),
    re.compile(rf"{_TIME}{_ZONE}[\s,;]+{_ANY_DATE}"),
    re.compile(_DATE),
)


@dataclass(frozen=True)
class ClockReading:
    """Content of a cell with a clock, before it is known which number is which.

    Attributes
    ----------
    date
        Its three numbers as they are written; empty without a date.
    parts
        Two or three numbers of the time; empty where only a date is given, which is midnight.
    fraction
        Digits of the fraction of the last part.
    half
        `a` or `p` of a 12-hour clock; empty for one of 24 hours.
    offset_s
        Seconds ahead of UTC; None if the cell does not say it.
    zone
        Name of a zone whose offset is not known.
    """

    date: tuple[str, ...]
    parts: tuple[int, ...]
    fraction: str
    half: str
    offset_s: int | None
    zone: str


def parse_clock(cell: str) -> ClockReading | None:
    """Return what a cell with a clock says; None if it is none.

    Examples
    --------
    >>> from labrig.text_table.times.clock_times import parse_clock
    >>> reading = parse_clock("24.10.2026 11:59:30,5 PM")
    >>> reading.date, reading.parts, reading.fraction, reading.half
    (('24', '10', '2026'), (11, 59, 30), '5', 'p')
    >>> parse_clock("995.679") is None
    True
    """
    text = " ".join(cell.replace("\N{MINUS SIGN}", "-").split())
    if digits := _DIGITS.fullmatch(text):
        text = "{} {}:{}:{}".format(*digits.groups())
    text = _YEAR_LAST.sub(r"\1, \3 \2", _BASIC.sub(r"\1 \2:\3:\4", text))
    text = _WEEKDAY.sub("", _NAMED_MONTH.sub(_as_iso, text, count=1), count=1)
    for form in _FORMS:
        if match := form.fullmatch(text):
            return _reading(match.groupdict())
    return None


def full_year(text: str) -> int:
    """Return the year that two or four digits stand for."""
    year = int(text)
    if len(text) > len("yy"):
        return year
    return year + (1900 if year >= _PIVOT_YEAR else 2000)


def _as_iso(match: re.Match[str]) -> str:
    """Return a date with the name of its month in the order year, month, day."""
    month = (match["m"] or match["m2"]).lower()
    number = _MONTHS.get(month[:4]) or _MONTHS.get(month[:3])
    if number is None:
        return match[0]
    return f"{full_year(match['y']):04d}-{number:02d}-{int(match['d'] or match['d2']):02d}"


def _reading(found: dict[str, str | None]) -> ClockReading | None:
    compact = found.get("compact")
    date = tuple(found[name] or "" for name in ("d1", "d2", "d3")) if found["d1"] else ()
    if compact:
        date = (compact[:4], compact[4:6], compact[6:])
    parts = tuple(int(found[name] or 0) for name in "abc" if found.get(name) is not None)
    half = (found.get("half") or "").lower()
    if half and parts[0] > _HOURS_OF_HALF_DAY:
        return None
    zone, offset = found.get("zone") or "", found.get("offset") or ""
    hours = _ZONES_H.get(zone)
    offset_s = None if hours is None and (zone or not offset) else 3600 * (hours or 0)
    if offset and offset_s is not None:
        offset_s += _seconds(offset)
    return ClockReading(
        date=date,
        parts=parts,
        fraction=found.get("f") or found.get("ms") or found.get("g") or "",
        half=half,
        offset_s=offset_s,
        zone=zone if hours is None else "",
    )


def _seconds(offset: str) -> int:
    """Return the seconds of an offset from UTC such as `+02:00` or `-0530`."""
    digits = offset[1:].replace(":", "")
    hours, minutes = (int(digits[:-2]), int(digits[-2:])) if len(digits) > 2 else (int(digits), 0)
    return (-1 if offset[0] == "-" else 1) * (3600 * hours + 60 * minutes)


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
_MIN_SPACINGS = 3
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
    warnings: tuple[ResultWarning, ...]


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
        enough = len(sizes) >= _MIN_SPACINGS
        ratio[order] = max(sizes) / median(sizes) if enough else _REGULAR
    best = min(orders, key=lambda order: ratio[order])
    others = [ratio[order] for order in orders if order != best]
    if ratio[best] < _REGULAR and all(other > _REGULAR * ratio[best] for other in others):
        orders = [best]
    return {order: days[order] for order in orders}
