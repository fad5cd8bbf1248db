"""Cells that stand for no measurement: overload of a meter, no reading, marks of missing data.

A meter that cannot tell a value writes a word, such as `OL`, or a number that nobody measures:
SCPI has 9.9e37 for more than the range and 9.91e37 for no number. Loggers write -9999.
"""

import math
import re
from collections.abc import Callable, Sequence

#: Magnitude from which a number is no measurement; SCPI's marks are 9.9e37, others 1e38, 3.4e38.
_OVERLOAD = 9.8e37
#: Words of meters, loggers, spreadsheets and languages, in upper case.
_WORDS = re.compile(
    r"[+\-<>]?(?:[O0]\.?\s?L\.?|OV(?:E?R)?(?:LD|L|FL)?|OVERLOAD(?:ED)?|OVERFLOW|OVER[\s\-]?RANGE|OFL"
    r"|OVR(?:NG)?|U\.?L|UND(?:E?R)?(?:[\s\-]?RANGE|FLOW)?|OOR|OUT OF RANGE|SAT(?:URATED)?|CLIPPED"
    r"|ÜBERLAUF|INF(?:INITY)?|∞)(?:\s?[MKµU]?[VAΩW])?"
    r"|[+\-]?(?:1\.#\w+|S?Q?NAN(?:\(\w*\))?)|NA|N/A|N\.A\.|NV|NULL|NONE|NIL|NO DATA|MISSING|INVALID"
    r"|BAD|ERR|ERROR|FEHLER|#[A-Z/0!?]+[!?]?|-+|\*+|#+|\?+|[.]{2,}|[=_~]+|[–—]+"
)
#: Nines, perhaps with zeros behind, that mark missing data: 9999, -999.9, 9.99999e9.
_NINES = re.compile(r"9{3,10}0*")
#: A power of ten, which some meters show for overload: 1e9.
_POWER = re.compile(r"10*")
#: How far beyond every other value a number of nines, or a power of ten from 1e6 on, is a mark.
_BEYOND_NINES, _BEYOND_POWERS, _LEAST_NINES, _LEAST_POWER = 10.0, 1e4, 999, 1e6
#: Fewest other values that tell so of either.
_FEWEST_NINES, _FEWEST_POWERS = 3, 8


def no_measurements(cells: Sequence[str], number: Callable[[str], float | None]) -> dict[int, str]:
    """Return the rows of a column that hold no measurement, and what they hold.

    Parameters
    ----------
    cells
        Cells of a column of values. Empty ones are no marks: something may be missing.
    number
        What turns a cell into a number, None where there is none.

    Returns
    -------
    dict of int to str
        Indices of the rows and their cells, in order.

    Examples
    --------
    >>> from labrig.text_table.rows.no_measurement import no_measurements
    >>> def number(cell):
    ...     try:
    ...         return float(cell)
    ...     except ValueError:
    ...         return None
    >>> no_measurements(["9.9e37", "OL", "860.2", "819.1", "nan", "0"], number)
    {0: '9.9e37', 1: 'OL', 4: 'nan'}
    >>> no_measurements(["-9999", "3", "2", "2", "-9999"], number)
    {0: '-9999', 4: '-9999'}
    """
    values = [number(cell) for cell in cells]
    marks = {
        row
        for row, (cell, value) in enumerate(zip(cells, values, strict=True))
        if _is_mark(cell, value)
    }
    measured = {
        row: value for row, value in enumerate(values) if value is not None and row not in marks
    }
    marks |= _far_marks(measured)
    return {row: cells[row].strip() for row in sorted(marks)}


def _is_mark(cell: str, value: float | None) -> bool:
    if value is None:
        return _WORDS.fullmatch(cell.strip().upper()) is not None
    return not math.isfinite(value) or abs(value) >= _OVERLOAD


def _far_marks(values: dict[int, float]) -> set[int]:
    """Return the rows whose numbers are of nines or a power of ten, and far from all others."""
    candidates: dict[float, tuple[float, int]] = {}
    for value in set(values.values()):
        digits = repr(abs(value)).split("e")[0].replace(".", "")
        if abs(value) >= _LEAST_NINES and _NINES.fullmatch(digits):
            candidates[value] = _BEYOND_NINES, _FEWEST_NINES
        elif abs(value) >= _LEAST_POWER and _POWER.fullmatch(digits):
            candidates[value] = _BEYOND_POWERS, _FEWEST_POWERS
    found: set[int] = set()
    # From the farthest on, since a mark may hide another: 9.99999e9 beside -9999.
    for value in sorted(candidates, key=abs, reverse=True):
        beyond, fewest = candidates[value]
        rows = {row for row, other in values.items() if other == value}
        others = [other for row, other in values.items() if row not in rows | found]
        # Light that decays is not negative by more than noise, which other values would show.
        near = others if value > 0 else [other for other in others if other < 0] or [0.0]
        if len(others) >= fewest and abs(value) > beyond * max(map(abs, near)):
            found |= rows
    return found
