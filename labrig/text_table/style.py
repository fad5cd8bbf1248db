"""How a table is written: what separates its columns, and its decimal mark."""

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from labrig.foundation.errors import UsageError
from labrig.text_table.numbers import DECIMAL_MARKS, is_clock, parse_number

#: Separators in the order in which they are tried; None are blanks.
SEPARATORS = ("\t", ";", ",", "|", None)
#: Number of lines, all over a text, from which separator and decimal mark are found.
_SAMPLE = 300
#: Fewest cells with a number in a row of a table: a time and a value.
FEWEST = 2
#: Number with a comma that could group thousands: `12,345`.
_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+")
_QUOTED_OR_WORD = re.compile(r'"([^"]*)"|(\S+)')


class Line(NamedTuple):
    """A line of a text, with its number from 1."""

    number: int
    text: str


@dataclass(frozen=True)
class Style:
    """Separator, None for blanks, and decimal mark of a table."""

    separator: str | None
    decimal: str

    def cells(self, line: Line) -> tuple[str, ...]:
        """Return the cells of a line, without empty ones at its end."""
        if self.separator is None:
            if '"' in line.text:
                return tuple(a or b for a, b in _QUOTED_OR_WORD.findall(line.text))
            return tuple(line.text.split())
        # Lines of a drawn table begin and end with their separator.
        text = line.text.strip(" |") if self.separator == "|" else line.text
        try:
            row = next(csv.reader([text], delimiter=self.separator, skipinitialspace=True), [])
        except csv.Error as error:
            raise UsageError(f"line {line.number}: not a row of a table ({error})") from None
        row = [cell.strip() for cell in row]
        while row and not row[-1]:
            row.pop()
        return tuple(row)

    def count_numbers(self, row: Sequence[str]) -> int:
        """Return how many cells of a row are numbers."""
        return sum(parse_number(cell, self.decimal) is not None for cell in row)

    def count_readings(self, row: Sequence[str]) -> int:
        """Return how many cells of a row are numbers, or times of day."""
        return sum(parse_number(cell, self.decimal) is not None or is_clock(cell) for cell in row)

    def is_all_readings(self, row: Sequence[str], fewest: int = FEWEST) -> bool:
        """Return whether a row has `fewest` numbers or more, and nothing but numbers."""
        readings = self.count_readings(row)
        return readings >= fewest and readings == sum(1 for cell in row if cell)


def find_style(lines: Sequence[Line], decimal: str | None) -> Style:
    """Return the separator and the decimal mark with which most lines are rows of numbers.

    Raises
    ------
    UsageError
        Its commas may be decimal commas as well as thousands separators.
    """
    sample = lines[:: -(-len(lines) // _SAMPLE)]
    marks = tuple(DECIMAL_MARKS.values()) if decimal is None else (decimal,)

    def quality(style: Style) -> tuple[int, int, int]:
        rows = [style.cells(line) for line in sample]
        readings = [style.count_readings(row) for row in rows]
        whole = sum(
            count >= FEWEST and count == sum(1 for cell in row if cell)
            for count, row in zip(readings, rows, strict=True)
        )
        # Without any row of numbers, the separator that divides the lines.
        divided = 0 if whole else sum(len(row) > 1 for row in rows)
        return whole, sum(count >= FEWEST for count in readings), divided

    best = max((Style(separator, mark) for separator in SEPARATORS for mark in marks), key=quality)
    # Programs separate columns by semicolons where the comma is the decimal mark.
    if decimal is None and best.decimal == "," and best.separator != ";":
        _refuse_thousands(sample, best)
    return best


def _refuse_thousands(sample: Sequence[Line], style: Style) -> None:
    """Refuse numbers whose commas may be decimal commas as well as thousands separators."""
    cells = [
        cell
        for line in sample
        for cell in style.cells(line)
        if "," in cell and parse_number(cell, ",") is not None
    ]
    if all(_THOUSANDS.fullmatch(cell) for cell in cells):
        raise UsageError(
            f"expected numbers that can be read in one way, got '{cells[0]}', with a decimal comma "
            "or a thousands separator: say '--decimal comma', or leave the separators out"
        )
