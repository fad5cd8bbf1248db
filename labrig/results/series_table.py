"""Reader of series.csv and of other programs' tables of a decay."""

import csv
import math
import os
from collections.abc import Sequence
from dataclasses import replace
from decimal import Decimal, InvalidOperation
from pathlib import Path

import numpy as np

from labrig.errors import DataError, LabrigError, UsageError
from labrig.input_file import read_table_text
from labrig.results.clock_times import seconds_from_first
from labrig.results.measured import FloatArray
from labrig.results.series import EXPOSURE, RESERVED, SIGMA_SUFFIX, TIME, Series
from labrig.results.table_clock import TableClock, is_far
from labrig.results.table_columns import (
    Channel,
    Columns,
    TableLayout,
    column_names,
    find_columns,
)
from labrig.results.table_text import DECIMAL_MARKS, EXPECTED, Table, parse_table


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
#: Remedy for a cell without a number.
_DELETE = "delete the row"


def read_series(
    path: str | os.PathLike[str], layout: TableLayout = _FROM_THE_TABLE
) -> list[Series]:
    """Read the series in a table, one for each region and unit in it.

    The columns are separated by tabs, semicolons, commas or blanks; numbers have a decimal point or
    a decimal comma. `#` begins a comment, and lines above the table are skipped. Columns are
    recognised by their names, which may have a unit: times (`t_s`, `time / min`, `Zeit [ms]`; times
    of day, `12:00:05`, are counted from the first row),
    uncertainties (`<name>_sigma`, or `Error`, `±`, `σ`, `std`, … right of the values), exposures,
    and those of series.csv (region, unit, flag and the like). Every other column of numbers is a
    channel, except one that only the first row fills: some programs put the settings of a
    measurement there. Without names the columns are time, value and perhaps sigma.

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
    >>> read_described_series("series.csv")[1]
    'time t_s; values R, G, B; σ R_sigma, G_sigma, B_sigma'
    """
    folder = Path(path)
    if folder.is_dir():
        table = folder / "result" / "series.csv"
        advice = f"fit '{table}'" if table.is_file() else "give the path of a table in it"
        raise UsageError(f"{folder}: expected a table, got a folder; {advice}")
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
        table = _own_table(text)
        if table is not None:
            columns = _own_columns(table)
        else:
            decimal = DECIMAL_MARKS[layout.decimal] if layout.decimal else None
            table = parse_table(text, decimal)
            columns = find_columns(table, layout)
        return _series(table, columns), columns.describe(table.names)
    except LabrigError as error:
        # In one line, though a cell may hold a form feed or another of Unicode's line ends.
        raise type(error)(f"{source}: {' '.join(str(error).split())}") from None


def _own_table(text: str) -> Table | None:
    """Return the cells of a series.csv; None if the text is another program's table."""
    head, _, body = text.replace("\r\n", "\n").partition("\n")
    if not head.startswith(f"{TIME},{EXPOSURE},"):
        return None
    names = tuple(_cells(head, 1))
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
    return Table(names, (), tuple(rows), tuple(number for number, _ in lines), ".")


def _cells(line: str, number: int) -> list[str]:
    try:
        return next(csv.reader([line]), [])
    except csv.Error as error:
        raise UsageError(f"line {number}: not a row of a table ({error})") from None


def _own_columns(table: Table) -> Columns:
    """Return the roles of the columns of a series.csv, whose names are taken literally."""
    index = {name: column for column, name in enumerate(table.names)}
    channels = table.names[2 : -len(RESERVED) : 2]
    if len(index) != len(table.names) or any(name + SIGMA_SUFFIX not in index for name in channels):
        raise UsageError(f"{EXPECTED}, got {', '.join(table.names)}; a column was renamed")
    return Columns(
        time=0,
        unit_s=1.0,
        exposure=1,
        channels=tuple(Channel(name, index[name], index[name + SIGMA_SUFFIX]) for name in channels),
        reserved={name: index[name] for name in RESERVED},
        value_unit="DN/s",
    )


def _series(table: Table, columns: Columns) -> list[Series]:
    """Return the series of a table by region and unit."""
    n_rows = len(table.rows)

    def numbers(column: int | None, empty: float | None) -> FloatArray:
        if column is None:
            return np.full(n_rows, empty, dtype=np.float64)
        return _numbers(table, column, empty)

    def texts(name: str) -> tuple[str, ...]:
        column = columns.reserved.get(name)
        return tuple("" if column is None else row[column] for row in table.rows)

    channels = columns.channels
    values = np.stack([numbers(channel.column, None) for channel in channels], axis=1)
    given = np.stack([numbers(channel.sigma, math.nan) for channel in channels], axis=1)
    relative = np.array([channel.sigma_is_relative for channel in channels])
    scale = np.array([channel.sigma_scale for channel in channels])
    t_s, clock = _times_s(table, columns)
    series = Series(
        t_s=t_s,
        exposure_s=numbers(columns.exposure, 0.0),
        values=values,
        sigma=given * scale * np.where(relative, np.abs(values), 1.0),
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


def _times_s(table: Table, columns: Columns) -> tuple[FloatArray, TableClock]:
    """Return the times in seconds, and their clock; times of day from the first row.

    So are those of a clock whose zero is far from all rows, to the last digit in the table.
    """
    clock_s = seconds_from_first([row[columns.time] for row in table.rows])
    if clock_s is not None:
        return clock_s, TableClock()
    times = _numbers(table, columns.time, None)
    clock = TableClock(unit_s=Decimal(repr(columns.unit_s)))
    if not is_far(times):
        return times * columns.unit_s, clock
    exact = [_exact(table, row[columns.time]) for row in table.rows]
    first = min(exact)
    after = np.array([float(time - first) for time in exact])
    return after * columns.unit_s, replace(clock, zero_s=first * clock.unit_s, is_lamp_off=False)


def _exact(table: Table, cell: str) -> Decimal:
    """Return the number in a cell with all its digits."""
    try:
        return Decimal(cell.strip().replace(table.decimal, "."))
    except InvalidOperation:
        return Decimal(repr(table.number(cell)))


def _numbers(table: Table, column: int, empty: float | None) -> FloatArray:
    """Return the cells of a column as numbers, blank ones as `empty` (None forbids them)."""
    name = column_names(table)[column]
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
            remedy = "write all times as numbers, or all as hh:mm:ss" if ":" in cell else _DELETE
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
