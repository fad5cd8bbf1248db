"""Numbers in the cells of a table."""

import re
from decimal import Decimal, InvalidOperation

from labrig.text_table.clock_reading import parse_clock

#: Decimal marks by the name that the option `--decimal` has for them.
DECIMAL_MARKS = {"point": ".", "comma": ","}
#: Characters that typesetters, word processors and East Asian input methods put for a minus.
_MINUS = str.maketrans(dict.fromkeys("\u2212\u2010\u2011\u2012\u2013\ufe63\uff0d", "-"))
#: Number whose digits are grouped by narrow or no-break blanks, or by the Swiss apostrophe.
_GROUPED = re.compile(r"[+-]?\d{1,3}(?:[\u00a0\u2007\u2009\u202f'’]\d{3})+(?:[.,]\d*)?")
_GROUPING = re.compile(r"[\u00a0\u2007\u2009\u202f'’]")
#: Exponent of double precision as Fortran writes it: `1.5D-03`.
_FORTRAN = re.compile(r"([+-]?\d*\.\d*)[dD]([+-]?\d+)")
#: Time of day or date, or what begins with one.
_CLOCK = re.compile(r"\d{1,2}:\d{2}|\d{1,4}([./-])\d{1,2}\1\d{1,4}(?:\D|$)")


def parse_number(cell: str, decimal: str) -> float | None:
    """Return the number in a cell, whose decimal mark is `decimal`; None if there is none."""
    try:
        return float(_plain(cell, decimal))
    except ValueError:
        return None


def exact_number(cell: str, decimal: str) -> Decimal | None:
    """Return the number in a cell with all its digits; None if there is none."""
    try:
        return Decimal(_plain(cell, decimal))
    except InvalidOperation:
        return None


def _plain(cell: str, decimal: str) -> str:
    """Return a cell in the form that Python reads, or as one that it does not."""
    text = cell.strip()
    if not text.isascii():
        text = text.translate(_MINUS)
    if _GROUPED.fullmatch(text):
        text = _GROUPING.sub("", text)
    if decimal == ",":
        if "." in text:
            return ""
        text = text.replace(",", ".")
    if fortran := _FORTRAN.fullmatch(text):
        text = f"{fortran[1]}e{fortran[2]}"
    # Python takes an underscore for a thousands separator.
    return "" if "_" in text else text


def is_clock(cell: str) -> bool:
    """Return whether a cell begins with a time of day or a date, or with a weekday or month."""
    text = cell.strip()
    return _CLOCK.match(text) is not None or (":" in text and parse_clock(text) is not None)
