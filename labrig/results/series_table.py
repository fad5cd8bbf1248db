"""Reader of series.csv and of other programs' tables of a decay."""

import csv
import math
import os
import re
from collections.abc import Sequence
from dataclasses import replace
from decimal import Decimal
from pathlib import Path

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError, LabrigError, UsageError
from labrig.foundation.file_kind import TABLE, require_kind
from labrig.results.series import EXPOSURE, RESERVED, SIGMA_SUFFIX, TIME, Series
from labrig.results.table_clock import TableClock, is_far
from labrig.results.table_columns import (
    Channel,
    Columns,
    find_columns,
)
from labrig.results.table_rows import independent_rows, measured_rows, with_limits
from labrig.results.time_axis import TableLayout, TimeAxis
from labrig.text_table import (
    DECIMAL_MARKS,
    EXPECTED,
    Block,
    exact_number,
    plain_text,
    read_blocks,
    read_table_text,
)
from labrig.text_table.names import is_time


def join_series(parts: Sequence[Series]) -> Series:
    """Join series one below the other.

    Parameters
    ----------
    parts
        Series of the same channels; name of the patch, dark level and correlations are taken from
        the first.

    Returns
    -------
    Series
        All rows in the given order.

    Examples
    --------
    >>> from dataclasses import replace
    >>> import labrig
    >>> from labrig.results import join_series
    >>> first = labrig.read_series("series.csv")[0]
    >>> second = replace(first, unit=("decay-2",) * len(first.unit))
    >>> both = join_series([first, second])
    >>> len(first.t_s), len(both.t_s), sorted(set(both.unit))
    (18, 36, ['decay-1', 'decay-2'])
    """
    return replace(
        parts[0],
        t_s=np.concatenate([part.t_s for part in parts]),
        exposure_s=np.concatenate([part.exposure_s for part in parts]),
        values=np.concatenate([part.values for part in parts]),
        sigma=np.concatenate([part.sigma for part in parts]),
        iso=np.concatenate([part.iso for part in parts]),
        f_number=np.concatenate([part.f_number for part in parts]),
        frame=tuple(frame for part in parts for frame in part.frame),
        unit=tuple(unit for part in parts for unit in part.unit),
        flag=tuple(flag for part in parts for flag in part.flag),
    )


_FROM_THE_TABLE = TableLayout()
#: Column of a σ in series.csv, with the unit that the values have, too.
_SIGMA_COLUMN = re.compile(rf"(?P<name>.+){SIGMA_SUFFIX}(?P<unit>| \(.+\))")
#: Remedy for a cell without a number.
_DELETE = "delete the row"


def read_series(
    path: str | os.PathLike[str], layout: TableLayout = _FROM_THE_TABLE
) -> list[Series]:
    """Read the series in a table, one for each region and unit in it.

    The columns are separated by tabs, semicolons, commas, bars or blanks; numbers have a decimal
    point or a decimal comma. `#` begins a comment; of the lines above and below the table only what
    they say of names, unit of the times and width of a channel is used. Columns are
    recognised by their names, which may have a unit: times (`t_s`, `time / min`, `Zeit [ms]`; a
    clock, such as `24.10.2026 12:00:05`, is counted from the first row), uncertainties
    (`<name>_sigma`, or `Error`, `±`, `σ`, `std`, … right of the values), exposures,
    and those of series.csv (region, unit, flag and the like). Every other column of numbers is a
    channel, except one that only the first row fills: some programs put the settings of a
    measurement there. Without names the columns are time, value and perhaps sigma. Rows that are
    channels of a stated width become times. Logarithms of light (`I/dB`, `ln(I)`) become light.
    Rows that are no measurement (`OL`, 9.9e37, copies of the row before) are left out; `warnings`
    of the series name them.

    Parameters
    ----------
    path
        Path of the table, labrig's series.csv or that of another program, in UTF-8, UTF-16 or
        Windows-1252.
    layout
        Answers to what the table leaves open.

    Returns
    -------
    list of Series
        The series in order of appearance.

    Raises
    ------
    UsageError
        The file does not exist, is not such a table, can be read in two ways, or a number is
        missing or not finite.
    DataError
        There are no rows, or a σ is not above zero.

    Examples
    --------
    >>> import labrig
    >>> series = labrig.read_series("series.csv")[0]
    >>> series.region, series.channels, series.values.shape
    ('sample', ('R', 'G', 'B'), (18, 3))
    >>> for start_s, value in zip(series.t_s[:2], series.values[:2, 1]):
    ...     print(f"{start_s:.2f} s: {value:.0f} DN/s")
    1.06 s: 8894 DN/s
    6.06 s: 4806 DN/s
    """
    return read_described_series(path, layout)[0]


def read_described_series(
    path: str | os.PathLike[str], layout: TableLayout = _FROM_THE_TABLE
) -> tuple[list[Series], str]:
    """Read the series in a table, and say in a few words which column was taken for what.

    Parameters
    ----------
    path, layout
        Those of `read_series`.

    Returns
    -------
    series : list of Series
        The series in order of appearance.
    columns : str
        Columns of times, values and σ.

    Raises
    ------
    UsageError, DataError
        Those of `read_series`.

    Examples
    --------
    >>> from labrig.results import read_described_series
    >>> read_described_series("series.csv")[1].split("; σ")[0]
    'time t_s (s, line 1); values R (DN/s), G (DN/s), B (DN/s)'
    """
    folder = Path(path)
    require_kind(folder, TABLE)
    if folder.is_dir():
        raise UsageError(
            f"{folder}: expected a table, got a folder; give the path of a table in it"
        )
    return _parse(read_table_text(folder), str(path), layout)


def parse_series(text: str, source: str, layout: TableLayout = _FROM_THE_TABLE) -> list[Series]:
    """Parse the series in the text of a table, one for each region and unit in it.

    Parameters
    ----------
    text
        Content of a table, in the form that `read_series` reads.
    source
        Name of the table in messages.
    layout
        Answers to what the table leaves open.

    Returns
    -------
    list of Series
        The series in order of appearance.

    Raises
    ------
    UsageError
        The text is not such a table, can be read in two ways, or a number is missing or not
        finite.
    DataError
        There are no rows, or a σ is not above zero.

    Examples
    --------
    >>> from labrig.results import parse_series
    >>> table = '''Zeit / min;Signal;±
    ... 0,5;100;2
    ... 1;61;1,6
    ... 2;22;1'''
    >>> series = parse_series(table, "clipboard")[0]
    >>> series.t_s.tolist(), series.values[:, 0].tolist(), series.sigma[:, 0].tolist()
    ([30.0, 60.0, 120.0], [100.0, 61.0, 22.0], [2.0, 1.6, 1.0])
    """
    return _parse(text, source, layout)[0]


def _parse(text: str, source: str, layout: TableLayout) -> tuple[list[Series], str]:
    """Return the series in a text, and the roles of its columns in words."""
    try:
        own = _own_table(text)
        if own is not None:
            columns = _own_columns(own)
            return _series(own, columns, *_times_s(own, columns)), str(columns)
        decimal = DECIMAL_MARKS[layout.decimal] if layout.decimal else None
        table = choose_block(read_blocks(text, decimal), layout.block)
        columns = find_columns(table, layout)
        return _measured_series(table, columns), str(columns)
    except LabrigError as error:
        # In one line, though a cell may hold a form feed or another of Unicode's line ends.
        raise type(error)(f"{source}: {' '.join(str(error).split())}") from None


def choose_block(blocks: Sequence[Block], number: int | None) -> Block:
    """Return the table of that number from 1, or the only one that may be a decay."""
    if number is not None and not 1 <= number <= len(blocks):
        raise UsageError(f"--block: expected a number from 1 to {len(blocks)}, got {number}")
    if number is None:
        timed = [index for index, block in enumerate(blocks) if any(map(is_time, block.names))]
        named = blocks[timed[0]] if timed else blocks[0]
        # A table without names may go on with the one above it.
        possible = [
            index
            for index, block in enumerate(blocks)
            if index in timed or not timed or _goes_on(named, block)
        ]
        if len(possible) > 1:
            listed = "; ".join(f"{k}: {block}" for k, block in enumerate(blocks, start=1))
            raise UsageError(
                f"expected one table, got {len(blocks)}, {listed}; choose one with '--block "
                f"{possible[0] + 1}'"
            )
        number = possible[0] + 1
    block, first = blocks[number - 1], blocks[0]
    if block is not first and _goes_on(first, block):
        block = replace(
            block,
            names=first.names,
            units=first.units,
            names_line=first.names_line,
            units_line=first.units_line,
        )
    # What stands at the head of a file holds for all tables in it.
    return block if block is first else replace(block, above=(*first.above, *block.above))


def _goes_on(block: Block, other: Block) -> bool:
    return not other.names and len(other.rows[0]) == len(block.rows[0])


def _own_table(text: str) -> Block | None:
    """Return the cells of a series.csv; None if the text is another program's table."""
    head, _, body = text.replace("\r\n", "\n").partition("\n")
    if not head.startswith(f"{TIME},{EXPOSURE},"):
        return None
    names = tuple(map(plain_text, _cells(head, 1)))
    if names[:2] != (TIME, EXPOSURE) or names[-len(RESERVED) :] != RESERVED:
        return None
    lines = [(number, line) for number, line in enumerate(body.split("\n"), start=2) if line]
    if not lines:
        raise DataError(f"{EXPECTED}, got a header without rows")
    rows = []
    for number, line in lines:
        row = tuple(_cells(line, number))
        if len(row) != len(names):
            raise UsageError(
                f"line {number}: expected {len(names)} columns as in the first line, got {len(row)}"
            )
        rows.append(row)
    return Block(names, (), tuple(rows), tuple(number for number, _ in lines))


def _cells(line: str, number: int) -> list[str]:
    try:
        return next(csv.reader([line]), [])
    except csv.Error as error:
        raise UsageError(f"line {number}: not a row of a table ({error})") from None


def _own_columns(table: Block) -> Columns:
    """Return the roles of the columns of a series.csv, whose names are taken literally."""
    index = {name: column for column, name in enumerate(table.names)}
    own = [_SIGMA_COLUMN.fullmatch(name) for name in table.names[3 : -len(RESERVED) : 2]]
    sigmas = [match for match in own if match]
    units = {match["unit"] for match in sigmas}
    expected = [f"{match['name']}{match['unit']}" for match in sigmas]
    if (
        len(index) != len(table.names)
        or len(units) != 1
        or expected != list(table.names[2 : -len(RESERVED) : 2])
    ):
        raise UsageError(f"{EXPECTED}, got {', '.join(table.names)}; a column was renamed")
    channels = [
        Channel(match["name"], column, column + 1)
        for column, match in zip(range(2, len(table.names), 2), sigmas, strict=False)
    ]
    return Columns(
        names=table.names,
        time=TimeAxis(0, 1.0, "s, line 1"),
        exposure=1,
        channels=tuple(channels),
        reserved={name: index[name] for name in RESERVED},
        value_unit=units.pop()[2:-1],
    )


def _measured_series(table: Block, columns: Columns) -> list[Series]:
    """Return the series of another program's table, without rows that are no measurements."""
    (t_s, table_clock), clock = _times_s(table, columns), columns.time.clock
    used = [(channel.column, channel.sigma) for channel in columns.channels]
    rows, warnings = measured_rows(
        table, [column for pair in used for column in pair if column is not None]
    )
    measured = replace(
        table,
        rows=tuple(table.rows[row] for row in rows),
        lines=tuple(table.lines[row] for row in rows),
    )
    parts = _series(measured, columns, t_s[rows], table_clock)
    warnings = [*(clock.warnings if clock else ()), *warnings]
    if len(parts) == 1:
        resolution_s = clock.resolution_s if clock else 0.0
        independent, repeats = independent_rows(parts[0], measured.lines, resolution_s)
        lines = [measured.lines[row] for row in independent]
        part, limits = with_limits(parts[0].take(independent), lines)
        parts = [part]
        warnings += [*repeats, *limits]
    return [replace(part, warnings=tuple(warnings)) for part in parts]


def _series(table: Block, columns: Columns, t_s: FloatArray, clock: TableClock) -> list[Series]:
    """Return the series of a table by region and unit."""
    n_rows = len(table.rows)

    def numbers(column: int | None, empty: float | None) -> FloatArray:
        if column is None:
            return np.full(n_rows, empty, dtype=np.float64)
        return _numbers(table, columns, column, empty)

    def texts(name: str) -> tuple[str, ...]:
        column = columns.reserved.get(name)
        return tuple("" if column is None else plain_text(row[column]) for row in table.rows)

    channels = columns.channels
    pairs = [
        channel.light(numbers(channel.column, None), numbers(channel.sigma, math.nan))
        for channel in channels
    ]
    series = Series(
        t_s=t_s,
        exposure_s=numbers(columns.exposure, 0.0),
        values=np.stack([values for values, _ in pairs], axis=1),
        sigma=np.stack([sigma for _, sigma in pairs], axis=1),
        dark_sigma=np.full(len(channels), math.nan),
        channels=tuple(channel.name for channel in channels),
        iso=numbers(columns.reserved.get("iso"), math.nan),
        f_number=numbers(columns.reserved.get("f_number"), math.nan),
        frame=texts("frame"),
        unit=texts("unit"),
        flag=texts("flag"),
        value_unit=columns.value_unit,
        clock=clock,
    )
    groups: dict[tuple[str, str], list[int]] = {}
    for row, key in enumerate(zip(texts("region"), series.unit, strict=True)):
        groups.setdefault(key, []).append(row)
    return [series.take(np.array(rows), region) for (region, _), rows in groups.items()]


def _times_s(table: Block, columns: Columns) -> tuple[FloatArray, TableClock]:
    """Return the times in seconds, and their clock; times of day from the first row.

    So are those of a clock whose zero is far from all rows, to the last digit in the table.
    """
    time = columns.time
    if time.clock is not None:
        return time.clock.t_s, TableClock()
    clock = TableClock(unit_s=Decimal(repr(time.unit_s)))
    if time.column is None:
        return np.arange(len(table.rows), dtype=np.float64) * time.unit_s, clock
    times = _numbers(table, columns, time.column, None)
    if not is_far(times):
        return times * time.unit_s, clock
    exact = [exact_number(row[time.column], table.decimal) or Decimal(0) for row in table.rows]
    first = min(exact)
    after = np.array([float(each - first) for each in exact])
    return after * time.unit_s, replace(clock, zero_s=first * clock.unit_s, is_lamp_off=False)


def _numbers(table: Block, columns: Columns, column: int, empty: float | None) -> FloatArray:
    """Return the cells of a column as numbers, blank ones as `empty` (None forbids them)."""
    name = columns.names[column]
    mark = next(word for word, mark in DECIMAL_MARKS.items() if mark == table.decimal)
    values = np.empty(len(table.rows))
    for index, (row, line) in enumerate(zip(table.rows, table.lines, strict=True)):
        cell = row[column].strip()
        if not cell:
            if empty is None:
                raise UsageError(
                    f"line {line}: expected a number for '{name}', got nothing; {_DELETE}"
                )
            values[index] = empty
            continue
        number = table.number(cell)
        if number is None:
            remedy = "write all times in one form" if ":" in cell else _DELETE
            raise UsageError(
                f"line {line}: expected a number with a decimal {mark} for '{name}', got '{cell}'; "
                f"{remedy}"
            )
        if not math.isfinite(number):
            raise UsageError(
                f"line {line}: expected a finite number for '{name}', got '{cell}'; {_DELETE}"
            )
        values[index] = number
    return values
