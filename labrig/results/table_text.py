"""Cells of a table as text: delimiter, decimal mark, names of the columns, rows.

Instruments, spreadsheets and scripts write tables in many ways: separated by tabs, semicolons,
commas or blanks, with a decimal point or, on a German or French computer, a decimal comma, below
lines about the measurement. All of it is found from the text; what could be read in two ways is
refused.
"""

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from labrig.errors import DataError, UsageError
from labrig.results.column_names import ABSCISSA, is_time, time_unit_s

COMMENT = "#"
EXPECTED = "expected a table with a column of times and one of values"
#: Decimal marks by the name that the option `--decimal` has for them.
DECIMAL_MARKS = {"point": ".", "comma": ","}

#: Delimiters in the order in which they are tried; None are blanks.
_DELIMITERS = ("\t", ";", ",", None)
#: Number of lines at the end of a text from which delimiter and decimal mark are found.
_SAMPLE = 100
#: Fewest cells with a number in a row of a table: a time and a value.
_FEWEST = 2
#: Largest number of lines of names, units and comments above the rows.
_HEAD_LINES = 3
#: Number with a comma that could group thousands: `12,345`.
_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+")
_BEFORE_UNIT = re.compile(r"\s+(?=[(\[])")
_SLASH = re.compile(r"\s*/\s*")

Row = Sequence[str]


@dataclass(frozen=True)
class Table:
    """Cells of a table.

    Attributes
    ----------
    names
        Names of the columns; empty if the table has none.
    units
        Cells of a line of units below the names; empty without one.
    rows
        Cells of each row, as many as there are columns.
    lines
        Line number of each row.
    decimal
        Decimal mark of the numbers.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...]
    decimal: str

    def number(self, cell: str) -> float | None:
        """Return the number in a cell; None if there is none."""
        return parse_number(cell, self.decimal)


@dataclass(frozen=True)
class _Format:
    """Delimiter, None for blanks, and decimal mark of a table."""

    delimiter: str | None
    decimal: str

    def cells(self, line: str, number: int) -> list[str]:
        """Return the cells of a line, without empty ones at its end."""
        if self.delimiter is None:
            return line.split()
        try:
            row = next(csv.reader([line], delimiter=self.delimiter, skipinitialspace=True), [])
        except csv.Error as error:
            raise UsageError(f"line {number}: not a row of a table ({error})") from None
        row = [cell.strip() for cell in row]
        while row and not row[-1]:
            row.pop()
        return row

    def count_numbers(self, row: Row) -> int:
        """Return how many cells of a row are numbers."""
        return sum(parse_number(cell, self.decimal) is not None for cell in row)

    def is_all_numbers(self, row: Row) -> bool:
        """Return whether a row has a time and a value or more, and nothing but numbers."""
        numbers = self.count_numbers(row)
        return numbers >= _FEWEST and numbers == sum(1 for cell in row if cell)


def parse_number(cell: str, decimal: str) -> float | None:
    """Return the number in a cell, whose decimal mark is `decimal`; None if there is none."""
    text = cell.strip().replace("\N{MINUS SIGN}", "-")
    if decimal == ",":
        if "." in text:
            return None
        text = text.replace(",", ".")
    try:
        # Python takes an underscore for a thousands separator.
        return None if "_" in text else float(text)
    except ValueError:
        return None


def parse_table(text: str, decimal: str | None = None) -> Table:
    """Return the cells of a table in a text of any of the forms above.

    Parameters
    ----------
    text
        The text; lines that begin with `#` are comments.
    decimal
        Decimal mark of the numbers; None finds it.

    Raises
    ------
    DataError
        There are no rows.
    UsageError
        The text is no table, or one that can be read in two ways.
    """
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    content = [
        (number, line)
        for number, line in enumerate(lines, start=1)
        if line.strip() and not line.lstrip().startswith(COMMENT)
    ]
    if not content:
        raise DataError(f"{EXPECTED}, got no rows")
    form = _find_format(content[-_SAMPLE:], decimal)
    rows = [form.cells(line, number) for number, line in content]
    first = _first_row(rows, form)
    units: tuple[str, ...] = ()
    if first is None:
        first = 0 if form.count_numbers(rows[0]) == len(rows[0]) else 1
        names: tuple[str, ...] = tuple(rows[0]) if first else ()
    else:
        first = _first_incomplete_row(rows, first, form, content)
        comments = [line for line in lines[: content[first][0] - 1] if COMMENT in line[:1]]
        names, units = _head(rows, first, form, content, comments)
    if first == len(rows):
        raise DataError(f"{EXPECTED}, got a header without rows")
    numbers = tuple(number for number, _ in content[first:])
    width = len(names) or len(rows[first])
    return Table(
        names=names,
        units=units,
        rows=tuple(
            _padded(row, width, number) for row, number in zip(rows[first:], numbers, strict=True)
        ),
        lines=numbers,
        decimal=form.decimal,
    )


def _find_format(sample: Sequence[tuple[int, str]], decimal: str | None) -> _Format:
    """Return the delimiter and the decimal mark with which most lines are rows of numbers."""
    marks = tuple(DECIMAL_MARKS.values()) if decimal is None else (decimal,)

    def quality(form: _Format) -> tuple[int, int, int]:
        rows = [form.cells(line, number) for number, line in sample]
        numbers = [form.count_numbers(row) for row in rows]
        return (
            sum(form.is_all_numbers(row) for row in rows),
            sum(count >= _FEWEST for count in numbers),
            # Without any row of numbers, the delimiter that divides the lines.
            sum(len(row) > 1 for row in rows),
        )

    best = max(
        (_Format(delimiter, mark) for delimiter in _DELIMITERS for mark in marks), key=quality
    )
    # Programs separate columns by semicolons where the comma is the decimal mark.
    if decimal is None and best.decimal == "," and best.delimiter != ";":
        _refuse_thousands(sample, best)
    return best


def _refuse_thousands(sample: Sequence[tuple[int, str]], form: _Format) -> None:
    """Refuse numbers whose commas may be decimal commas as well as thousands separators."""
    cells = [
        cell
        for number, line in sample
        for cell in form.cells(line, number)
        if "," in cell and parse_number(cell, ",") is not None
    ]
    if all(_THOUSANDS.fullmatch(cell) for cell in cells):
        raise UsageError(
            f"expected numbers that can be read in one way, got '{cells[0]}', with a decimal comma "
            "or a thousands separator: say '--decimal comma', or leave the separators out"
        )


def _first_row(rows: Sequence[Row], form: _Format) -> int | None:
    """Return the index of the first row below names and lines about the measurement."""
    widths = Counter(len(row) for row in rows if form.count_numbers(row) >= _FEWEST)
    if not widths:
        return None
    usual = widths.most_common(1)[0][0]
    for index, row in enumerate(rows):
        if form.count_numbers(row) < _FEWEST:
            continue
        if form.is_all_numbers(row) and len(row) == usual:
            return index
        above = rows[index - 1] if index else ()
        # Some programs put the settings of a measurement, texts too, into the first row.
        if len(above) == len(row) and not form.count_numbers(above):
            return index
    return None


def _first_incomplete_row(
    rows: Sequence[Row], first: int, form: _Format, content: Sequence[tuple[int, str]]
) -> int:
    """Return the index of the first row above row `first` that has a time but no value.

    Such rows begin below the names: an instrument wrote `OVER`, or nothing, for its first values.
    Without any there it is `first`, and lines with numbers above are about the measurement.
    """
    width = len(rows[first])
    head = first - 1
    while head >= 0 and form.count_numbers(rows[head]):
        head -= 1
    between = rows[head + 1 : first]
    times = [0]
    if head >= 0:
        # A line of units may stand between the names and the rows.
        times = [
            column
            for index in range(head, max(head - 2, -1), -1)
            for column, name in enumerate(_names(rows[index], content[index][1], width, form))
            if is_time(name) or name.lower() == ABSCISSA
        ]
    elif form.delimiter is None or any(len(row) != width for row in between):
        return first
    is_row = [
        len(times) > 0
        and len(row) > times[0]
        and parse_number(row[times[0]], form.decimal) is not None
        for row in between
    ]
    return head + 1 if all(is_row) else first


def _head(
    rows: Sequence[Row],
    first: int,
    form: _Format,
    content: Sequence[tuple[int, str]],
    comments: Sequence[str],
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the names of the columns above the first row, and a line of units below them."""
    width = len(rows[first])
    # From the row upwards, down to the first line that names nothing.
    above = [
        _names(rows[index], content[index][1], width, form)
        for index in range(first - 1, max(first - 1 - _HEAD_LINES, -1), -1)
    ]
    for index, names in enumerate(above):
        if any(is_time(name) for name in names):
            below = above[index - 1] if index else ()
            has_units = any(time_unit_s(cell) is not None for cell in below)
            return names, below if has_units else ()
    if above and above[0]:
        return above[0], ()
    if first:
        _refuse_other_names(rows[first - 1], width, form, content[first - 1][0])
    for comment in reversed(comments):
        line = comment.lstrip().lstrip(COMMENT)
        names = _names(form.cells(line, 0), line, width, form)
        if any(is_time(name) for name in names):
            return names, ()
    return (), ()


def _names(row: Row, line: str, width: int, form: _Format) -> tuple[str, ...]:
    """Return the names in a line above a table of `width` columns; nothing if it has none."""
    if form.count_numbers(row):
        return ()
    if form.delimiter is None:
        return _split_by_blanks(line, width)
    # More names than columns stand above columns that only the first rows fill.
    return tuple(row) if len(row) >= width else ()


def _split_by_blanks(line: str, width: int) -> tuple[str, ...]:
    """Return `width` names in a line, each perhaps with a unit, or nothing.

    A word with a colon may precede them, as in `Data:   y   x`.
    """
    glued = _SLASH.sub("/", _BEFORE_UNIT.sub("", line)).split()
    if len(glued) == width + 1 and glued[0].endswith(":"):
        glued = glued[1:]
    return tuple(glued) if len(glued) == width else ()


def _refuse_other_names(names: Row, width: int, form: _Format, number: int) -> None:
    """Refuse rows whose cells are more than the names above them."""
    if len(names) < _FEWEST or form.count_numbers(names) or not any(map(is_time, names)):
        return
    advice = "give every column a name"
    if form.delimiter == "," and width == 2 * len(names):
        advice = "are these decimal commas between commas? save it with ; between the columns"
    raise UsageError(
        f"line {number}: expected a name for each of the {width} columns below, got "
        f"{', '.join(names)}; {advice}"
    )


def _padded(row: Row, columns: int, line: int) -> tuple[str, ...]:
    """Return `row` with as many cells as there are columns, empty ones added at its end."""
    if len(row) > columns:
        raise UsageError(
            f"line {line}: expected {columns} columns as in the first line, got {len(row)}"
        )
    return (*row, *[""] * (columns - len(row)))
