"""Reader of series.csv and of other programs' tables of a decay.

The delimiter is a comma, a tab, a semicolon or blanks.
"""

import csv
import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from labrig.errors import DataError, LabrigError, UsageError
from labrig.input_file import read_text
from labrig.results.measured import FloatArray
from labrig.results.series import EXPOSURE, RESERVED, SIGMA_SUFFIX, TIME, Series


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


_TIME_NAMES = frozenset({TIME, "t", "time_s", "time", "t (s)", "time (s)"})
_EXPOSURE_NAMES = frozenset({EXPOSURE, "exposure"})
#: The column of uncertainties where there is one channel.
_LONE_SIGMA = "sigma"
_COMMENT = "#"
_EXPECTED = "expected a table with a column t_s (or t, time_s) and one or more of values"


@dataclass(frozen=True)
class _Table:
    """Cells of a table.

    Attributes
    ----------
    header
        Names of the columns.
    rows
        Cells of each row, as many as in the header.
    lines
        Line number of each row.
    """

    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...]


def read_series(path: str | os.PathLike[str]) -> list[Series]:
    """Read the series in a table, one for each region and unit in it.

    The delimiter is a comma, a tab, a semicolon or blanks. The header may be missing: then the
    columns are time, value and perhaps sigma. `#` begins a comment. Every column that is not
    reserved (region, unit, flag and the like) is a channel, except one that only the first row
    fills: some programs put the settings of a measurement there.

    Parameters
    ----------
    path
        Path of the table, labrig's series.csv or that of another program.

    Returns
    -------
    list of Series
        The series in order of appearance.

    Raises
    ------
    UsageError
        The file does not exist, or is not such a table.
    DataError
        A number is not finite, a value is missing, or there are no rows.

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
    return parse_series(read_text(Path(path)), str(path))


def parse_series(text: str, source: str) -> list[Series]:
    """Parse the series in the text of a table, one for each region and unit in it.

    Parameters
    ----------
    text
        Content of a table, in the form that `read_series` reads.
    source
        Name of the table in messages.

    Returns
    -------
    list of Series
        The series in order of appearance.

    Raises
    ------
    UsageError
        The text is not such a table.
    DataError
        A number is not finite, a value is missing, or there are no rows.

    Examples
    --------
    >>> from labrig.results import parse_series
    >>> table = '''time_s,value,sigma
    ... 1,100,2
    ... 2,61,1.6
    ... 4,22,1'''
    >>> series = parse_series(table, "clipboard")[0]
    >>> series.t_s.tolist(), series.values[:, 0].tolist(), series.sigma[:, 0].tolist()
    ([1.0, 2.0, 4.0], [100.0, 61.0, 22.0], [2.0, 1.6, 1.0])
    """
    try:
        return _series(_table(text))
    except LabrigError as error:
        # In one line, though a cell may hold a form feed or another of Unicode's line ends.
        raise type(error)(f"{source}: {' '.join(str(error).split())}") from None


def _table(text: str) -> _Table:
    content = [
        (number, line)
        for number, line in enumerate(text.replace("\r\n", "\n").split("\n"), start=1)
        if line.strip() and not line.lstrip().startswith(_COMMENT)
    ]
    if not content:
        raise DataError(f"{_EXPECTED}, got no rows")
    delimiter = next((mark for mark in "\t,;" if mark in content[0][1]), None)
    cells = [_cells(line, delimiter, number) for number, line in content]
    first = cells[0]
    if all(_is_number(cell) for cell in first if cell):
        if len(first) not in (2, 3):
            raise UsageError(
                f"{_EXPECTED}, got {len(first)} columns without names; name them in the first line"
            )
        header: tuple[str, ...] = (TIME, "value", _LONE_SIGMA)[: len(first)]
    else:
        header = tuple(cell.strip() for cell in first)
        content, cells = content[1:], cells[1:]
    if not cells:
        raise DataError(f"{_EXPECTED}, got a header without rows")
    numbers = tuple(number for number, _ in content)
    rows = [_padded(row, len(header), line) for row, line in zip(cells, numbers, strict=True)]
    return _Table(header, tuple(rows), numbers)


def _cells(line: str, delimiter: str | None, number: int) -> list[str]:
    if delimiter is None:
        return line.split()
    try:
        return next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
    except csv.Error as error:
        raise UsageError(f"line {number}: not a row of a table ({error})") from None


def _padded(row: list[str], columns: int, line: int) -> tuple[str, ...]:
    """Return `row` with as many cells as the header, empty ones at its end added or removed."""
    if any(cell.strip() for cell in row[columns:]):
        raise UsageError(
            f"line {line}: expected {columns} columns as in the first line, got {len(row)}"
        )
    return (*row[:columns], *[""] * (columns - len(row)))


def _series(table: _Table) -> list[Series]:
    columns = _columns(table)
    names = list(columns)
    time = _only_match(names, _TIME_NAMES)
    if time is None:
        raise UsageError(f"{_EXPECTED}, got {', '.join(names)}")
    exposure = _only_match(names, _EXPOSURE_NAMES)
    value_columns = [name for name in names if name not in (time, exposure, *RESERVED)]
    channels = [name for name in value_columns if not _is_sigma(name, value_columns)]
    if not channels:
        raise UsageError(f"{_EXPECTED}, got {', '.join(names)}; a column of values is missing")
    sigmas = [_sigma_name(channel, channels, value_columns) for channel in channels]

    def numbers(name: str | None, empty: float | None) -> FloatArray:
        if name is None:
            return np.full(len(table.rows), empty, dtype=np.float64)
        return _numbers(name, columns[name], table.lines, empty)

    def texts(name: str) -> tuple[str, ...]:
        return tuple(columns.get(name, [""] * len(table.rows)))

    table_series = Series(
        t_s=numbers(time, None),
        exposure_s=numbers(exposure, 0.0),
        values=np.stack([numbers(channel, None) for channel in channels], axis=1),
        sigma=np.stack([numbers(sigma, math.nan) for sigma in sigmas], axis=1),
        dark_sigma=np.full(len(channels), math.nan),
        channels=tuple(channels),
        iso=numbers("iso" if "iso" in columns else None, math.nan),
        f_number=numbers("f_number" if "f_number" in columns else None, math.nan),
        frame=texts("frame"),
        unit=texts("unit"),
        flag=texts("flag"),
    )
    groups: dict[tuple[str, str], list[int]] = {}
    for row, key in enumerate(zip(texts("region"), table_series.unit, strict=True)):
        groups.setdefault(key, []).append(row)
    return [table_series.take(np.array(rows), region) for (region, _), rows in groups.items()]


def _columns(table: _Table) -> dict[str, list[str]]:
    """Return the cells by column name, without the columns that hold no series."""
    columns: dict[str, list[str]] = {}
    for position, name in enumerate(table.header):
        cells = [row[position] for row in table.rows]
        blank = not any(cell.strip() for cell in cells[1:])
        setting = blank and (len(cells) > 1 or not cells[0].strip())
        if setting and name not in RESERVED and not name.endswith(SIGMA_SUFFIX):
            continue
        if not name or name in columns:
            raise UsageError(
                f"expected a name of its own for every column, got '{name}' for column "
                f"{position + 1}; rename it"
            )
        columns[name] = cells
    return columns


def _only_match(names: Sequence[str], accepted: frozenset[str]) -> str | None:
    """Return the one of `names` that is among the `accepted`; None if none is."""
    matches = [name for name in names if name.lower() in accepted]
    if len(matches) > 1:
        raise UsageError(f"expected one of the columns {', '.join(matches)}, got several; keep one")
    return matches[0] if matches else None


def _is_sigma(name: str, columns: Sequence[str]) -> bool:
    return name == _LONE_SIGMA or name.removesuffix(SIGMA_SUFFIX) in set(columns) - {name}


def _sigma_name(channel: str, channels: Sequence[str], columns: Sequence[str]) -> str | None:
    if channel + SIGMA_SUFFIX in columns:
        return channel + SIGMA_SUFFIX
    if _LONE_SIGMA not in columns:
        return None
    if len(channels) > 1:
        raise UsageError(
            f"expected a column <name>{SIGMA_SUFFIX} for each of {', '.join(channels)}, got one "
            f"'{_LONE_SIGMA}' for all; rename it"
        )
    return _LONE_SIGMA


def _numbers(
    name: str, cells: Sequence[str], lines: Sequence[int], empty: float | None
) -> FloatArray:
    """Return the cells of a column as numbers, blank ones as `empty` (None forbids them)."""
    values = np.empty(len(cells))
    for row, (cell, line) in enumerate(zip(cells, lines, strict=True)):
        if not cell.strip():
            if empty is None:
                raise DataError(f"line {line}: expected a number for '{name}', got nothing")
            values[row] = empty
            continue
        if not _is_number(cell):
            raise UsageError(
                f"line {line}: expected a number with a decimal point for '{name}', got '{cell}'"
            )
        values[row] = float(cell)
        if not math.isfinite(values[row]):
            raise DataError(
                f"line {line}: expected a finite number for '{name}', got '{cell}'; "
                "leave the row out"
            )
    return values


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return "_" not in cell  # which Python takes for a thousands separator
