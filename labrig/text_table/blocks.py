"""Blocks of a text table: names of the columns, units, and rows of cells.

Instruments, spreadsheets and scripts write tables in many ways: separated by tabs, semicolons,
commas, bars or blanks, with a decimal point or, on a German or French computer, a decimal comma,
between lines about the measurement, several in one file. All of it is found from the text; what
could be read in two ways is refused.
"""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from labrig.foundation.errors import DataError, UsageError
from labrig.text_table.header import COMMENT, Header, find_header, names_in
from labrig.text_table.jcamp import jcamp_curves
from labrig.text_table.names import ABSCISSAS, is_abscissa, is_time
from labrig.text_table.numbers import is_clock, parse_number
from labrig.text_table.style import FEWEST, Line, Style, find_style

EXPECTED = "expected a table with a column of times and one of values"
#: What a line without content consists of: spreadsheets fill it with separators.
BLANKS = " \t;,|\f\v\xa0"
#: Whatever ends a line.
_LINE_END = re.compile(r"\r+\n|\n|\r")
#: Rows of numbers alone that make a block of their own above another one.
_LONG = 3
#: Marks of a line that is about the measurement, in its first cell.
_ABOUT = re.compile(r"[:=<>\[\]*{}]")
#: Comments of programs that count photons, each above a line with one number for each curve.
_PER_CURVE = re.compile(r"\b(channels?|curves?|blocks?|bins?)\b", re.IGNORECASE)
_STARTS_AS_NUMBER = re.compile(r"[+\-\u2212]?[.,]?\d")


@dataclass(frozen=True)
class Block:
    """One table in a text.

    Attributes
    ----------
    names
        Names of the columns; empty if it has none.
    units
        Units of the columns, from a line of units below the names, or from lines such as
        `Xaxis,Time(ns)` or `XUNITS`; empty without one.
    rows
        Cells of each row, as many as there are columns.
    lines
        Line number of each row.
    decimal
        Decimal mark of the numbers.
    above
        Lines above the rows, from the block before on, without those of names and units below them.
    below
        Lines below the rows, to the next block or the end of the text.
    names_line, units_line
        The lines that names and units are from.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...]
    decimal: str = "."
    above: tuple[Line, ...] = field(default=(), repr=False)
    below: tuple[Line, ...] = field(default=(), repr=False)
    names_line: Line | None = None
    units_line: Line | None = None

    def number(self, cell: str) -> float | None:
        """Return the number in a cell; None if there is none."""
        return parse_number(cell, self.decimal)

    def __str__(self) -> str:
        """Return in a few words where the block stands, and its names."""
        names = ", ".join(self.names) or f"{len(self.rows[0])} columns without names"
        return f"lines {self.lines[0]} to {self.lines[-1]} ({names})"


class _Row(NamedTuple):
    """Cells of a line, and whether a blank line is above it."""

    line: Line
    cells: tuple[str, ...]
    is_after_gap: bool


def read_blocks(text: str, decimal: str | None = None) -> tuple[Block, ...]:
    """Divide a text into the tables in it.

    Parameters
    ----------
    text
        The text; lines that begin with `#` are comments.
    decimal
        Decimal mark of the numbers; None finds it.

    Returns
    -------
    tuple of Block
        The tables, at least one, in the order of the text.

    Raises
    ------
    DataError
        There are no rows.
    UsageError
        The text is no table, or one that can be read in two ways.

    Examples
    --------
    >>> from labrig.text_table import read_blocks
    >>> (block,) = read_blocks('''Sample: A
    ... t;I
    ... ms;V
    ... 0,0;5
    ... 0,5;3
    ... *END''')
    >>> block.names, block.units, block.rows[1], block.number(block.rows[1][0])
    (('t', 'I'), ('ms', 'V'), ('0,5', '3'), 0.5)
    >>> block.above[0], block.below[0].text
    (Line(number=1, text='Sample: A'), '*END')
    """
    lines = [Line(number, line) for number, line in enumerate(_LINE_END.split(text), start=1)]
    filled = [line for line in lines if line.text.strip(BLANKS)]
    if curves := jcamp_curves(filled):
        return tuple(
            Block(
                names=(),
                units=units,
                rows=tuple(map(tuple, rows)),
                lines=(line.number,) * len(rows),
                above=tuple(other for other in filled if other.number < line.number),
                units_line=line,
            )
            for line, units, rows in curves
        )
    statements = _lines_per_curve(filled)
    content = [line for line in filled if not _is_comment(line) and line not in statements]
    if not content:
        raise DataError(f"{EXPECTED}, got no rows")
    style = find_style(content, decimal)
    gaps = {line.number + 1 for line in lines if not line.text.strip(BLANKS)}
    rows = [_Row(line, style.cells(line), line.number in gaps) for line in content]
    spans = _spans(rows, style)
    if not spans:
        # A table of clocks or of texts: the first line has its names.
        first = 0 if style.count_numbers(rows[0].cells) == len(rows[0].cells) else 1
        if first == len(rows):
            raise DataError(f"{EXPECTED}, got a header without rows")
        header = Header(rows[0].cells, rows[0].line) if first else Header()
        return (_block(rows, (first, len(rows)), header, filled, (0, len(filled)), style),)
    blocks = []
    for index, (first, end) in enumerate(spans):
        after = rows[spans[index - 1][1] - 1].line.number if index else 0
        until = rows[spans[index + 1][0]].line.number if index + 1 < len(spans) else len(lines) + 1
        above = [line for line in filled if after < line.number < rows[first].line.number]
        header = find_header(above, len(rows[first].cells), style)
        blocks.append(_block(rows, (first, end), header, filled, (after, until), style))
    return tuple(blocks)


def _block(
    rows: Sequence[_Row],
    span: tuple[int, int],
    header: Header,
    filled: Sequence[Line],
    limits: tuple[int, int],
    style: Style,
) -> Block:
    """Return the block of a span of rows, with the lines above and below it."""
    own = rows[span[0] : span[1]]
    width = len(header.names) or len(own[0].cells)
    first, last = own[0].line.number, own[-1].line.number
    named = {header.names_line, header.units_line if header.names else None}
    return Block(
        header.names,
        header.units,
        tuple(_padded(row, width, style) for row in own),
        tuple(row.line.number for row in own),
        style.decimal,
        tuple(line for line in filled if limits[0] < line.number < first and line not in named),
        tuple(line for line in filled if last < line.number < limits[1]),
        header.names_line,
        header.units_line,
    )


def _padded(row: _Row, columns: int, style: Style) -> tuple[str, ...]:
    """Return the cells of a row, as many as there are columns, empty ones added at its end."""
    if len(row.cells) > columns:
        hint = (
            "; are there decimal commas between commas? save it with ; between the columns"
            if style.separator == ","
            else ""
        )
        raise UsageError(
            f"line {row.line.number}: expected {columns} columns as in the first line, got "
            f"{len(row.cells)}{hint}"
        )
    return (*row.cells, *[""] * (columns - len(row.cells)))


def _is_comment(line: Line) -> bool:
    return line.text.lstrip().startswith(COMMENT)


def _lines_per_curve(filled: Sequence[Line]) -> frozenset[Line]:
    """Return lines of numbers that are no rows but what the comment above each of them names.

    Programs that count photons write them so: `#ns/channel`, and below it one number for each
    curve.
    """
    found: list[Line] = []
    for above, line, below in zip(filled, filled[1:], filled[2:], strict=False):
        if not _is_comment(above) or _is_comment(line) or not _is_comment(below):
            continue
        if _PER_CURVE.search(above.text):
            found.append(line)
    return frozenset(found)


def _spans(rows: Sequence[_Row], style: Style) -> list[tuple[int, int]]:
    """Return the first row of each block, and the one after its last."""
    widths = Counter(len(row.cells) for row in rows if style.count_readings(row.cells) >= FEWEST)
    if not widths:
        return _spans_of_single_columns(rows, style)
    usual = widths.most_common(1)[0][0]
    spans: list[tuple[int, int]] = []
    start = 0
    while start < len(rows):
        previous = len(rows[spans[-1][0]].cells) if spans else None
        first = next(
            (
                index
                for index in range(start, len(rows))
                if _is_first(rows, index, start, usual, previous, style)
            ),
            None,
        )
        if first is None:
            break
        first = _first_incomplete_row(rows, start, first, style)
        end = _end(rows, first, style)
        spans.append((first, end))
        start = end
    return spans


def _spans_of_single_columns(rows: Sequence[_Row], style: Style) -> list[tuple[int, int]]:
    """Return the spans of rows with one number each."""
    spans: list[tuple[int, int]] = []
    for index, row in enumerate(rows):
        if not style.is_all_readings(row.cells, 1) or not style.count_numbers(row.cells):
            continue
        if spans and spans[-1][1] == index:
            spans[-1] = (spans[-1][0], index + 1)
        else:
            spans.append((index, index + 1))
    if any(end == first + 1 for first, end in spans):
        return []
    # Some programs write the number of rows above them.
    return [
        (first + (_number_in(rows[first], style) == end - first - 1), end) for first, end in spans
    ]


def _number_in(row: _Row, style: Style) -> float | None:
    return parse_number(row.cells[0], style.decimal)


def _is_first(
    rows: Sequence[_Row], index: int, start: int, usual: int, previous: int | None, style: Style
) -> bool:
    """Return whether a row is the first one below names and lines about the measurement."""
    cells = rows[index].cells
    if style.count_readings(cells) < FEWEST:
        return False
    above = rows[index - 1].cells if index > start else ()
    if style.is_all_readings(cells):
        if len(cells) in (previous or usual, usual):
            return True
        if index > start and any(
            map(is_abscissa, names_in(rows[index - 1].line, len(cells), style))
        ):
            return True
        run = [row.cells for row in rows[index : index + _LONG]]
        return len(run) == _LONG and all(
            style.is_all_readings(row) and len(row) == len(cells) for row in run
        )
    # Some programs put the settings of a measurement, texts too, into the first row.
    return previous is None and len(above) == len(cells) and not style.count_numbers(above)


def _first_incomplete_row(rows: Sequence[_Row], start: int, first: int, style: Style) -> int:
    """Return the index of the first row above row `first` that has a time but no value.

    Such rows begin below the names: an instrument wrote `OVER`, or nothing, for its first values.
    Without any there it is `first`, and lines with numbers above are about the measurement.
    """
    width = len(rows[first].cells)
    head = first - 1
    while head >= start and style.count_readings(rows[head].cells):
        head -= 1
    between = rows[head + 1 : first]
    times = [0]
    if head >= start:
        # A line of units may stand between the names and the rows.
        times = [
            column
            for index in range(head, max(head - 2, start - 1), -1)
            for column, name in enumerate(names_in(rows[index].line, width, style))
            if is_time(name) or name.lower() in ABSCISSAS
        ]
    elif style.separator is None or any(len(row.cells) != width for row in between):
        return first
    is_row = [
        len(times) > 0
        and len(row.cells) > times[0]
        and style.count_readings([row.cells[times[0]]]) > 0
        for row in between
    ]
    return head + 1 if all(is_row) else first


def _end(rows: Sequence[_Row], first: int, style: Style) -> int:
    """Return the index of the line below the last row of the block that begins at `first`."""
    width = len(rows[first].cells)
    starts_as_number = True
    for index in range(first + 1, len(rows)):
        row, filled = rows[index], [cell for cell in rows[index].cells if cell]
        looks = [_looks_like_a_number(cell) for cell in filled]
        if not any(looks):
            return index
        # A word below a blank line that begins with a digit, as the name of a sample may.
        if row.is_after_gap and width > 1 and len(filled) == 1 and not style.count_readings(filled):
            return index
        # A text where all rows before began with a number.
        if starts_as_number and row.cells[0] and not looks[0]:
            if row.is_after_gap or _ABOUT.search(row.cells[0]) or len(row.cells) > width:
                return index
        elif row.is_after_gap and _begins_another(rows, first, index, style):
            return index
        starts_as_number &= not row.cells[0] or _looks_like_a_number(row.cells[0])
    return len(rows)


def _looks_like_a_number(cell: str) -> bool:
    return _STARTS_AS_NUMBER.match(cell) is not None or is_clock(cell)


def _begins_another(rows: Sequence[_Row], first: int, index: int, style: Style) -> bool:
    """Return whether a row below a blank line begins another table without names.

    Either its first column starts again, or the rows have another number of columns.
    """
    cells = rows[index].cells
    if not style.is_all_readings(cells):
        return False
    if len(cells) != len(rows[first].cells):
        beside = rows[index + 1].cells if index + 1 < len(rows) else ()
        return len(beside) == len(cells) and style.is_all_readings(beside)
    column = [parse_number(row.cells[0], style.decimal) for row in rows[first : index + 1]]
    numbers = [number for number in column if number is not None]
    return (
        len(numbers) == len(column) > FEWEST
        and all(np.diff(numbers[:-1]) > 0)
        and numbers[-1] <= numbers[0]
    )
