"""Jumps of a clock: midnight, noon of a 12-hour clock, begin and end of summer time.

Time itself does not go back. A clock without a date begins again each day; one with summer time is
set by an hour, which the spacing of the rows around it proves. A clock that goes back for another
reason was set by hand, and nothing tells by how much.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import date
from itertools import pairwise

from labrig.foundation.errors import UsageError

_HOUR_S, _HALF_DAY_S, _DAY_S = 3600, 43200, 86400
#: Rows before and after a jump whose spacing proves it, and the fewest of them.
_NEIGHBOURS, _FEWEST = 10, 4
#: Longest row spacing from which a jump of an hour stands out.
_LONGEST_SPACING_S = 3600
#: Largest spacing over the smallest one of regular rows.
_REGULAR = 3.0
#: Hours that are left out, or counted twice, in some country, and the months of it.
_NIGHT_H = range(4)
_MONTHS = frozenset({2, 3, 4, 9, 10, 11})
_SUNDAY = 6
#: More jumps ahead by an hour than this are the pauses of a schedule.
_MOST_JUMPS = 2


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
    warnings: tuple[str, ...] = ()


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
    shift, shifts, warnings = 0, [0], []
    for row, step in enumerate(steps):
        from_to = (
            f"line {clock.lines[row + 1]}: the clock goes {'ahead' if step > 0 else 'back'} from "
            f"{clock.cells[row].strip()} to {clock.cells[row + 1].strip()}"
        )
        is_repeated_hour = step == 0 and clock.has_dates and _is_night_of_change(clock, row + 1)
        if (step < 0 or is_repeated_hour) and _is_regular(clock, steps, row, step + hour):
            shift += hour
            warnings.append(
                f"{from_to}, by an hour as at the end of summer time: the spacing of the rows "
                "shows it, and an hour was added from there on"
            )
        elif step < 0:
            _refuse_backward(clock, row, from_to)
        elif row in ahead and _crosses_summer_time(clock, row):
            shift -= hour
            warnings.append(
                f"{from_to}, by an hour as at the begin of summer time: the spacing of the rows "
                "shows it, and an hour was taken off from there on"
            )
        elif row in ahead and len(ahead) <= _MOST_JUMPS:
            warnings.append(
                f"{from_to}, by just an hour more than the rows around it: it is taken for a "
                "pause; if the clock was set, take the hour off the times that follow"
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
        f"{from_to}, and the spacing of the rows does not tell why: did summer time end, or was it "
        "set? Write the times with their offset from UTC (2026-10-25 02:00:00+01:00), or as "
        "seconds"
    )


def _steps(ticks: Sequence[int]) -> list[int]:
    return [after - before for before, after in pairwise(ticks)]


def _is_regular(clock: Clock, steps: Sequence[int], row: int, step: int) -> bool:
    """Return whether `step` is like the steps around row `row`, which are regular."""
    near = [*steps[max(row - _NEIGHBOURS, 0) : row], *steps[row + 1 : row + 1 + _NEIGHBOURS]]
    longest = _LONGEST_SPACING_S * clock.per_s
    near = [other for other in near if 0 <= other <= longest]
    if len(near) < _FEWEST:
        return False
    low, high = min(near), max(near)
    shown = clock.resolution_s * clock.per_s
    margin = high - low + shown
    return high <= _REGULAR * low + 2 * shown and max(low - margin, 0) <= step <= high + margin


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
    return is_night and on.weekday() == _SUNDAY and on.month in _MONTHS
