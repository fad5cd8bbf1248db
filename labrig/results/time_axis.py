"""Times of the rows of a table: their column and unit, a channel's width, or as a user says."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.errors import UsageError
from labrig.text_table import DECIMAL_MARKS, EXPECTED, Block, Line, is_clock
from labrig.text_table.names import (
    ABSCISSAS,
    is_channel,
    is_row_number,
    is_time,
    split_time,
    split_unit,
    time_unit_s,
)
from labrig.text_table.times import (
    ChannelWidth,
    ClockTimes,
    axis_times_s,
    axis_unit,
    channel_width,
    is_clock_form,
    parse_clock,
    parse_width,
    quoted,
    read_clock,
)


@dataclass(frozen=True)
class TableLayout:
    """Answers to what a table itself may leave open; None finds the answer in the table.

    Attributes
    ----------
    time
        Name of the column of times.
    column
        Name of the column of values.
    time_unit
        Unit of the times, such as `ms`, or the form of a clock, such as `hh:mm` or `dd/mm/yyyy`.
    decimal
        Decimal mark of the numbers, `point` or `comma`.
    time_per_channel
        Width of a channel with its unit, such as `0.4 ns`, where rows or numbers of channels stand
        for times.
    block
        Number of the table, from 1, of several in the file.
    """

    time: str | None = None
    column: str | None = None
    time_unit: str | None = None
    decimal: str | None = None
    time_per_channel: str | None = None
    block: int | None = None

    def __post_init__(self) -> None:
        unit = self.time_unit
        if unit is not None and time_unit_s(unit) is None and not is_clock_form(unit):
            raise UsageError(
                "--time-unit: expected a unit such as ns, ms, s, min or h, or the form of a clock "
                f"such as hh:mm or dd/mm/yyyy, got '{unit}'"
            )
        if self.decimal is not None and self.decimal not in DECIMAL_MARKS:
            raise UsageError(f"--decimal: expected 'point' or 'comma', got '{self.decimal}'")
        if self.time_per_channel is not None and parse_width(self.time_per_channel) is None:
            raise UsageError(
                "--time-per-channel: expected a time above 0 with its unit, such as '0.4 ns', got "
                f"'{self.time_per_channel}'"
            )


#: A time in a line about the axis belongs to another unit where it is shorter than the step of the
#: times, or longer than their span, by more than these factors.
_SHORTEST, _LONGEST = 0.1, 20.0
#: A width of a channel and the step of the times that differ by more are not of one unit.
_OTHER_UNIT = 500.0
#: Largest share of steps back in a column without a name that may be times.
_MAX_FALLS = 0.25
#: Units that are proposed.
_COMMON_UNITS = ("ps", "ns", "µs", "ms", "s", "min", "h")
#: Names of a column with the dates of a clock.
_DATES = frozenset({"date", "datum", "day", "tag", "jour", "fecha", "data"})
#: Seconds since 1970, or 1904, that no clock shows: such a number counts a smaller unit.
_NO_SECONDS = 1e11
#: Fewest rows that tell hours, minutes and seconds, written together, from seconds.
_MIN_DIGITAL = 5
_UNSTATED = "s, as no line states another unit"


@dataclass(frozen=True)
class TimeAxis:
    """Source of the times of the rows.

    Attributes
    ----------
    column
        Column of times or of numbers of channels; None where rows are channels, the first at 0.
    unit_s
        Unit of that column in seconds, or the width of a channel.
    source
        Unit or width, and what states it, in words.
    clock
        Times by the clock in that column; None of plain numbers.
    date
        Column with the dates of the clock; None without one.
    """

    column: int | None
    unit_s: float
    source: str
    clock: ClockTimes | None = None
    date: int | None = None


def find_time_axis(
    table: Block, names: Sequence[str], in_use: Sequence[int], layout: TableLayout
) -> TimeAxis:
    """Return where the times of a table come from.

    Raises
    ------
    UsageError
        The table does not say it, or says it in two ways.
    """
    said = _lines_about(table)
    width = parse_width(layout.time_per_channel) if layout.time_per_channel else channel_width(said)
    column = _time_column(table, names, in_use, layout)
    if column is None or (layout.time_unit is None and is_channel(names[column])):
        return _channels(table, names, in_use, column, width, layout)
    if table.names or layout.time is not None:
        return _in_unit(table, names, column, width, layout)
    return _without_names(table, column, width, layout)


def _lines_about(table: Block) -> tuple[Line, ...]:
    """Return the lines that may state a unit or a width: above the rows, their names, below."""
    named = () if table.names_line is None else (table.names_line,)
    return (
        *table.above,
        *(line for line in named if any(map(is_channel, table.names))),
        *table.below,
    )


def _time_column(
    table: Block, names: Sequence[str], in_use: Sequence[int], layout: TableLayout
) -> int | None:
    """Return the column of times; None without one."""
    if layout.time is not None:
        matches = [column for column in in_use if names[column] == layout.time]
        if not matches:
            raise UsageError(
                f"--time: expected one of {', '.join(names[column] for column in in_use)}, got "
                f"'{layout.time}'"
            )
    elif table.names or len(table.rows[0]) > 1:
        matches = [column for column in in_use if is_time(names[column])] or [
            column for column in in_use if split_unit(names[column])[0].lower() in ABSCISSAS
        ]
    else:
        matches = []
    matches = matches or _clocks(table)
    if len(matches) > 1:
        several = ", ".join(names[column] for column in matches)
        raise UsageError(f"expected one of the columns {several}, got several; say '--time NAME'")
    return matches[0] if matches else None


def _channels(
    table: Block,
    names: Sequence[str],
    in_use: Sequence[int],
    column: int | None,
    width: ChannelWidth | None,
    layout: TableLayout,
) -> TimeAxis:
    """Return the times of a table whose rows are channels, with their numbers or without."""
    if column is None:
        counting = [
            number
            for number in in_use
            if (is_channel(names[number]) or (table.names and is_row_number(names[number])))
            and _counts_up(_numbers(table, number))
        ]
        column = counting[0] if counting else None
    if width is None and (column is not None or len(names) == 1):
        what = (
            f"'{names[column]}' counts channels" if column is not None else "1 column without names"
        )
        raise UsageError(
            f"{EXPECTED}, got {what}, and no line says how long a channel is; say it with "
            "'--time-per-channel \"0.4 ns\"', or put a column with the time of each row before it"
        )
    if width is None:
        raise UsageError(
            f"{EXPECTED}, got {', '.join(names)}; if one of them is the time, name it: "
            "'--time NAME'"
        )
    widths_s = width.widths_s
    chosen = layout.column or ""
    if column is None and chosen in width.numbers:
        widths_s = (widths_s[width.numbers.index(chosen)],)
    width_s = widths_s[0]
    if len(set(widths_s)) > 1:
        raise UsageError(
            f"expected one width of a channel for all curves, got {width}; choose one with "
            "'--column NUMBER'"
        )
    each = f"{width_s / (time_unit_s(width.unit) or 1.0):.6g} {width.unit} a channel"
    return TimeAxis(column, width_s, f"{each}, from {width}")


def _without_names(
    table: Block, column: int, width: ChannelWidth | None, layout: TableLayout
) -> TimeAxis:
    """Return the times of a table whose columns have no names: the first, or the rows."""
    numbers = _numbers(table, column)
    if width is not None:
        unit_s = time_unit_s(width.unit) or 1.0
        step = np.median(np.diff(numbers)) if len(numbers) > 1 else 0.0
        names = [str(number + 1) for number in range(len(table.rows[0]))]
        if len(width.widths_s) == len(table.rows[0]) or len(table.rows[0]) == 1:
            return _channels(table, names, (), None, width, layout)
        if _counts_up(numbers) and not math.isclose(width.widths_s[0], unit_s):
            return _channels(table, names, (), column, width, layout)
        if math.isclose(step * unit_s, width.widths_s[0], rel_tol=1e-3):
            return TimeAxis(column, unit_s, f"{width.unit}, whose steps are those of {width}")
        raise UsageError(
            f"{EXPECTED}, got columns without names that do not fit {width}: steps of {step:g} in "
            "column 1; give the columns names, or say '--time-unit'"
        )
    if layout.time_unit is None and not is_clock(table.rows[0][column]):
        falls = np.diff(numbers) < 0
        beside = [_numbers(table, other) for other in range(1, len(table.rows[0]))]
        if _MAX_FALLS < falls.sum() / max(len(falls), 1) < 1 or (
            falls.any() and any(np.all(np.diff(other) > 0) for other in beside)
        ):
            raise UsageError(
                f"{EXPECTED}, got columns without names, of which the first does not rise as times "
                "do; give the columns names, or, if rows are channels, say how long one is: "
                "'--time-per-channel \"0.4 ns\"'"
            )
    axis = _in_unit(table, ["t"], column, None, layout)
    if axis.source == _UNSTATED and _counts_up(numbers):
        return replace(axis, source=f"{_UNSTATED}; if it numbers channels, say --time-per-channel")
    return axis


def _in_unit(
    table: Block,
    names: Sequence[str],
    column: int,
    width: ChannelWidth | None,
    layout: TableLayout,
) -> TimeAxis:
    """Return the times in a column, in the unit that the table states."""
    clock = _by_clock(table, names, column, layout)
    if clock is not None:
        return clock
    if layout.time_unit is not None:
        unit_s = time_unit_s(layout.time_unit)
        if unit_s is None:
            raise UsageError(
                f"--time-unit: expected a unit such as s or ms for '{names[column]}', which holds "
                f"no clock, got '{layout.time_unit}'"
            )
        return TimeAxis(column, unit_s, f"{layout.time_unit}, from --time-unit")
    own, line = (split_time(names[column]) or split_unit(names[column]))[1], table.names_line
    below = table.units[column] if column < len(table.units) else ""
    _require_unit(own, names[column])
    if below and own and time_unit_s(below) not in (None, time_unit_s(own)):
        raise UsageError(
            f"expected one unit of the times, got '{own}' in '{names[column]}' and '{below}' below "
            "it; say which with '--time-unit'"
        )
    if below and not own:
        own, line = below, table.units_line
        _require_unit(own, names[column])
    stated = axis_unit(_lines_about(table))
    if own and stated and time_unit_s(stated[0]) != time_unit_s(own):
        raise UsageError(
            f"expected one unit of the times, got '{own}' in '{names[column]}' and "
            f"{quoted(stated[1])}; say which with '--time-unit'"
        )
    unit_s = time_unit_s(own or (stated[0] if stated else "s")) or 1.0
    step_s, span_s = _step_and_span(_numbers(table, column) * unit_s)
    if width is not None and step_s > 0:
        ratio = width.widths_s[0] / step_s
        if (own or stated) and not 1 / _OTHER_UNIT < ratio < _OTHER_UNIT:
            raise UsageError(
                f"expected times in steps of a channel, got steps of {step_s:.3g} s in "
                f"'{names[column]}' and {width}; say the unit of the times with '--time-unit'"
            )
    if own:
        where = f"from {quoted(line)}" if line and line.number > 1 else "line 1"
        return TimeAxis(column, unit_s, f"{own.strip(' ()[]')}, {where}")
    if stated:
        return TimeAxis(column, unit_s, f"{stated[0]}, from {quoted(stated[1])}")
    for time_s, unit, about in axis_times_s(_lines_about(table)):
        if step_s > 0 and not _SHORTEST * step_s < time_s < _LONGEST * span_s:
            fitting = [
                other
                for other in _COMMON_UNITS
                if math.isclose(step_s * (time_unit_s(other) or 0), time_s, rel_tol=1e-3)
            ]
            raise UsageError(
                f"expected a unit for '{names[column]}', got none, and times of {unit} in "
                f"{quoted(about)}; say '--time-unit {(*fitting, unit)[0]}', or which it is"
            )
    _refuse_no_seconds(table, column, names[column])
    return TimeAxis(column, 1.0, _UNSTATED)


def _refuse_no_seconds(table: Block, column: int, name: str) -> None:
    """Refuse numbers without a unit that must be something else than seconds."""
    times = _numbers(table, column)
    times = times[np.isfinite(times)]
    if len(times) and np.abs(times).min() > _NO_SECONDS:
        raise UsageError(
            f"expected a unit for '{name}', got none, and {times[0]:.0f}, which as seconds is "
            "thousands of years: say '--time-unit ms', or which it is"
        )
    hours, minutes, seconds = times // 10_000, times // 100 % 100, times % 100
    if len(times) < _MIN_DIGITAL or not (
        np.all((hours < 24) & (minutes < 60) & (seconds < 60)) and np.all(times >= 0)
    ):
        return
    as_numbers = np.diff(times)
    as_clock = np.diff(3600 * hours + 60 * minutes + seconds)
    if as_clock.min() > 0 and np.ptp(as_clock) == 0 and np.ptp(as_numbers) > 0:
        raise UsageError(
            f"expected seconds in '{name}', got numbers such as {table.rows[0][column]} whose "
            "steps are equal if they are hours, minutes and seconds: write them as hh:mm:ss, or "
            "say '--time-unit s'"
        )


def _clocks(table: Block) -> list[int]:
    """Return the columns that hold clocks, or those with dates if none does."""
    readings = [parse_clock(cell) for cell in table.rows[0]]
    clocks = [column for column, reading in enumerate(readings) if reading and reading.parts]
    return clocks or [column for column, reading in enumerate(readings) if reading]


def _by_clock(
    table: Block, names: Sequence[str], column: int, layout: TableLayout
) -> TimeAxis | None:
    """Return the times by a clock, whose dates may be in a column beside it; None without one."""
    first = table.rows[0]
    clock, date = parse_clock(first[column]), None
    if clock is None:
        return None
    cells = [row[column] for row in table.rows]
    if clock.parts and not clock.date:
        dates = [
            other
            for other, name in enumerate(names)
            if split_unit(name)[0].lower() in _DATES
            and (both := parse_clock(f"{first[other]} {first[column]}")) is not None
            and both.date
        ]
        if len(dates) == 1:
            (date,) = dates
            cells = [f"{row[date]} {row[column]}" for row in table.rows]
    below = table.units[column] if column < len(table.units) else ""
    said = [names[column], below, *([names[date]] if date is not None else ())]
    times = read_clock(cells, table.lines, layout.time_unit or " ".join(said))
    return TimeAxis(column, 1.0, times.form, times, date) if times else None


def _require_unit(unit: str, name: str) -> None:
    if unit and time_unit_s(unit) is None:
        raise UsageError(
            f"expected a unit of time for '{name}', got '{unit}'; say '--time-unit s', or which it "
            "is"
        )


def _step_and_span(times: NDArray[np.float64]) -> tuple[float, float]:
    """Return the median step of times and their span; 0 where there is none."""
    finite = times[np.isfinite(times)]
    if len(finite) < 2:
        return 0.0, 0.0
    # Absurd times overflow.
    with np.errstate(over="ignore"):
        return float(np.median(np.abs(np.diff(finite)))), float(np.ptp(finite))


def _numbers(table: Block, column: int) -> NDArray[np.float64]:
    """Return the numbers in a column; NaN where there is none."""
    cells = [table.number(row[column]) for row in table.rows]
    return np.array([np.nan if cell is None else cell for cell in cells])


def _counts_up(numbers: NDArray[np.float64]) -> bool:
    return len(numbers) > 1 and bool(np.all(np.diff(numbers) == 1))
