"""Numbers in the cells of a table."""

import re
from decimal import Decimal, InvalidOperation

#: Decimal marks by the name that the option `--decimal` has for them.
DECIMAL_MARKS = {"point": ".", "comma": ","}
#: Characters that typesetters, word processors and East Asian input methods put for a minus.
_MINUS = str.maketrans(dict.fromkeys("\u2212\u2010\u2011\u2012\u2013\ufe63\uff0d", "-"))
#: Number whose digits are grouped by narrow or no-break blanks, or by the Swiss apostrophe.
_GROUPED = re.compile(r"[+-]?\d{1,3}(?:[\u00a0\u2007\u2009\u202f'’]\d{3})+(?:[.,]\d*)?")
_GROUPING = re.compile(r"[\u00a0\u2007\u2009\u202f'’]")
#: Exponent of double precision as Fortran writes it: `1.5D-03`.
_FORTRAN = re.compile(r"([+-]?\d*\.\d*)[dD]([+-]?\d+)")
#: Time of day or date, or what begins with one, perhaps with names of weekday and month.
_CLOCK = re.compile(
    r"\d{1,2}:\d{2}|\d{1,4}([./-])\d{1,2}\1\d{1,4}(?:\D|$)"
    r"|(?:[^\W\d_]{2,4}\.?,?\s+)?(?:[^\W\d_]{3,9}\.?\s+\d{1,2}|\d{1,2}\.?\s*[^\W\d_]{3,9}\.?"
    r"|\d{1,2}[./]\d{1,2}[./]\d{2,4}),?\s.*\d{1,2}:\d{2}"
)


def parse_number(cell: str, decimal: str) -> float | None:
    """Return the number in a cell.

    Parameters
    ----------
    cell
        Text of the cell.
    decimal
        Decimal mark, `.` or `,`.

    Returns
    -------
    float or None
        The number, which may be infinite or NaN; None if there is none.

    Examples
    --------
    >>> from labrig.text_table import parse_number
    >>> parse_number("\N{MINUS SIGN}1,5", ","), parse_number("1,5", "."), parse_number("OVER", ".")
    (-1.5, None, None)
    """
    try:
        return float(_plain(cell, decimal))
    except ValueError:
        return None


def exact_number(cell: str, decimal: str) -> Decimal | None:
    """Return the number in a cell with all its digits.

    Parameters
    ----------
    cell
        Text of the cell.
    decimal
        Decimal mark, `.` or `,`.

    Returns
    -------
    Decimal or None
        The number, which may be infinite or NaN; None if there is none.

    Examples
    --------
    >>> from labrig.text_table import exact_number
    >>> exact_number("1764288000,2500000001", ",")
    Decimal('1764288000.2500000001')
    """
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
    """Return whether a cell begins with a time of day or a date, or a weekday or month before one.

    Parameters
    ----------
    cell
        Text of the cell.

    Returns
    -------
    bool
        Whether it does.

    Examples
    --------
    >>> from labrig.text_table import is_clock
    >>> is_clock("24.10.2026 23:59:30"), is_clock("23.5")
    (True, False)
    """
    return _CLOCK.match(cell.strip()) is not None
