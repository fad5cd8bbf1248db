"""Rows that are no measurements: copies, limits of a detector, marks, times that go back.

A logger that is faster than its meter writes each value several times; a fit would take the copies
for measurements of their own, and their scatter for none. Counts that are equal by chance, such as
the zeros of faint light, are no copies: they differ from their neighbours by little more than the
last digit.

Several equal values at the top are no light that was measured, unless they differ from their
neighbours by little more than the last digit: a slow change repeats them, too.

A meter that cannot tell a value writes a word, such as `OL`, or a number that nobody measures:
SCPI has 9.9e37 for more than the range and 9.91e37 for no number. Loggers write -9999.
"""

import math
import re
from collections.abc import Callable, Sequence
from decimal import Decimal

import numpy as np
import numpy.typing as npt

from labrig.foundation.arrays import BoolArray, FloatArray

#: Differences to the neighbours, in steps of the last digit, from which equal values are no chance.
_STEPS = 10.0
#: Fraction of the rows that are copies, and length of a run of equal values, from which they are.
_FRACTION, _RUN = 0.15, 5
#: Fewest copies, and fewest rows that tell them.
_FEWEST, _MIN_ROWS = 4, 10
#: Rows before and after a run in which the last digit of its values is looked for, and how well
#: they are multiples of it.
_NEAR, _MULTIPLE = 10, 1e-3
#: Largest number of steps that neighbouring levels are apart, where all are multiples of one.
_PARTS = 6


def repeated_rows(t_s: FloatArray, values: FloatArray) -> BoolArray:
    """Return which rows are the row before once more, with its time and all its values.

    Parameters
    ----------
    t_s
        Times in seconds, shape (n,).
    values
        Values, shape (n, C).

    Returns
    -------
    ndarray of bool, shape (n,)
        All False where rows of the same time differ in their values: those are measurements that
        were repeated, or a clock too coarse for them.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.text_table.rows import repeated_rows
    >>> repeated_rows(np.array([0.0, 1, 1, 2]), np.array([[5.0], [4], [4], [3]])).tolist()
    [False, False, True, False]
    """
    same_time = np.append(False, np.diff(t_s) == 0)
    same = same_time & np.append(False, (np.diff(values, axis=0) == 0).all(axis=1))
    return same if np.array_equal(same, same_time) else np.zeros(len(t_s), dtype=np.bool_)


def held_readings(values: FloatArray) -> BoolArray:
    """Return which values are the one before once more, since the meter had no new one.

    Parameters
    ----------
    values
        Values in the order of time, shape (n,).

    Returns
    -------
    ndarray of bool, shape (n,)
        Copies; the first of each run of equal values is none, and long runs at the largest or the
        smallest value, the limits of a detector, have none.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.text_table.rows import held_readings
    >>> held = np.repeat([101.3, 87.2, 75.9, 66.4, 57.1], 3)
    >>> held_readings(held).sum()
    np.int64(10)
    """
    none = np.zeros(len(values), dtype=np.bool_)
    starts = np.flatnonzero(np.append(True, np.diff(values) != 0))
    if len(values) < _MIN_ROWS or len(starts) < _FEWEST or len(starts) == len(values):
        return none
    lengths = np.diff(np.append(starts, len(values)))
    level = values[starts]
    is_limit = (level == values.max()) | (level == values.min())
    away = np.append(np.inf, np.append(np.abs(np.diff(level)), np.inf))
    nearest = np.minimum(away[:-1], away[1:])
    # Zero is where the light is below the last digit, or no photon came.
    runs = (lengths > 1) & (level != 0)
    for run in np.flatnonzero(runs):
        near = values[max(starts[run] - _NEAR, 0) : starts[run] + lengths[run] + _NEAR]
        runs[run] = nearest[run] >= _STEPS * last_digit(near, level[run])
    below = runs & ~is_limit
    copies = int((lengths[below] - 1).sum())
    if copies < _FEWEST:
        return none
    if copies < _FRACTION * len(values):
        below &= lengths >= _RUN
    # Runs of the largest or smallest value are a detector's limits, unless they are like others.
    longest = lengths[below].max(initial=0)
    rows = np.repeat(below | (runs & is_limit & (lengths <= longest)), lengths)
    rows[starts] = False
    return rows


def last_digit(values: FloatArray, level: float) -> float:
    """Return the step by which a value may differ from those around it.

    That of some neighbours may be larger than that of a whole table: meters change their range, and
    programs write a number of significant digits.

    Parameters
    ----------
    values
        Some values, shape (n,).
    level
        One of them.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.text_table.rows import last_digit
    >>> last_digit(np.array([0.75, 1.0, 2.0]), 1.0)
    0.25
    >>> last_digit(np.array([997.0, 999.0, 1010.0]), 1010.0)
    10.0
    """
    levels = np.unique(values)
    if len(levels) > 1:
        least = float(np.diff(levels).min())
        for part in range(1, _PARTS + 1):
            multiples = levels * part / least
            if np.all(np.abs(multiples - np.round(multiples)) < _MULTIPLE):
                return max(least / part, _last_written(levels, level))
    return _last_written(levels, level)


def _last_written(levels: FloatArray, level: float) -> float:
    """Return the last digit that is written of a level, by the number of digits of all levels."""
    written = [Decimal(repr(float(value))).normalize().as_tuple() for value in levels]
    digits = max(len(number.digits) for number in written)
    last = min(int(number.exponent) for number in written)
    order = Decimal(repr(float(level))).adjusted()
    return float(10.0 ** max(last, order + 1 - digits))


#: Distance to the values beside, in steps of the last digit, from which equal values are a limit.
#: Photons that get rare go to zero from some counts at once.
_STEPS_BELOW_CEILING, _STEPS_ABOVE_FLOOR = 10.0, 50.0
#: Fewest equal values, and fraction of the values from the first to the last of them.
_MIN_AT_CEILING, _MIN_AT_FLOOR, _LIMIT_FRACTION = 3, 5, 0.5

#: Values beside those at the limit from which the last digit is found.
_LIMIT_NEAR = 20


def at_ceiling(values: FloatArray) -> BoolArray:
    """Return which values are at the ceiling of a detector.

    Parameters
    ----------
    values
        Values in the order of time, shape (n,).

    Returns
    -------
    ndarray of bool, shape (n,)
        From the first to the last of the largest values; a noisy limit interrupts them.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.text_table.rows import at_ceiling
    >>> at_ceiling(np.array([4095.0, 4095, 4094, 4095, 4095, 3702, 3333])).tolist()
    [True, True, True, True, True, False, False]
    """
    found = np.zeros(len(values), dtype=np.bool_)
    rows = np.flatnonzero(values == values.max())
    first, end = rows[0], rows[-1] + 1
    beside = np.append(values[max(first - 1, 0) : first], values[end : end + 1])
    if len(rows) < max(_MIN_AT_CEILING, _LIMIT_FRACTION * (end - first)) or not len(beside):
        return found
    step = _step(values, first, end)
    if values[first] - beside.max() >= _STEPS_BELOW_CEILING * step:
        found[first:end] = True
    return found


def at_floor(values: FloatArray) -> BoolArray:
    """Return which values are at the floor of a detector, as far as the end of the table.

    Parameters
    ----------
    values
        Values in the order of time, shape (n,).

    Returns
    -------
    ndarray of bool, shape (n,)
        The last values, if all are equal, the smallest ones, and far below those before.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.text_table.rows import at_floor
    >>> at_floor(np.array([9.31, 6.24, 4.19, 2.81, 1.88, 0, 0, 0, 0, 0])).sum()
    np.int64(5)
    >>> counts = np.array([9.0, 6, 3, 2, 1, 0, 0, 0, 0, 0])
    >>> at_floor(counts).sum()
    np.int64(0)
    """
    found = np.zeros(len(values), dtype=np.bool_)
    others = np.flatnonzero(values != values[-1])
    if not len(others) or values[-1] > values.min():
        return found
    first = int(others[-1]) + 1
    if len(values) - first < _MIN_AT_FLOOR:
        return found
    step = _step(values, first, len(values))
    if values[first - 1] - values[-1] >= _STEPS_ABOVE_FLOOR * step:
        found[first:] = True
    return found


def _step(values: FloatArray, first: int, end: int) -> float:
    """Return the last digit of the values beside those from `first` to `end`."""
    near = np.append(values[max(first - _LIMIT_NEAR, 0) : first], values[end : end + _LIMIT_NEAR])
    return last_digit(near, values[first])


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
_BEYOND_NINES, _BEYOND_POWERS, _LEAST_NINES, _MIN_POWER = 10.0, 1e4, 999, 1e6
#: Fewest other values that tell so of either.
_FEWEST_NINES, _MIN_POWERS = 3, 8


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
    >>> from labrig.text_table.rows import no_measurements
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
        elif abs(value) >= _MIN_POWER and _POWER.fullmatch(digits):
            candidates[value] = _BEYOND_POWERS, _MIN_POWERS
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


#: Fraction of the rows from which rows whose time goes back are in no order at all.
_NO_ORDER = 0.1
#: Fraction of the light's fall by which it rises again where a decay is repeated.
_RISE = 0.2
#: Values of which means are taken, and by how many of their σ the light has to have fallen.
_VALUES, _SIGMAS = 5, 10.0


def backward_rows(t_s: FloatArray) -> npt.NDArray[np.intp]:
    """Return the rows whose time is before that of the row above.

    Parameters
    ----------
    t_s
        Times in seconds, shape (n,).

    Returns
    -------
    ndarray of int
        Indices of the rows. None of a table whose last row is the earliest, or whose rows are in no
        order: their times tell it.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.text_table.rows import backward_rows
    >>> t_s = np.arange(30.0)
    >>> t_s[12:] -= 1.5
    >>> backward_rows(t_s).tolist(), backward_rows(t_s[::-1]).tolist()
    ([12], [18])
    """
    steps = np.diff(t_s)
    if (steps < 0).sum() > (steps > 0).sum():
        steps = -steps
    rows = np.flatnonzero(steps < 0) + 1
    return rows if len(rows) <= max(_NO_ORDER * len(t_s), 1) else rows[:0]


def starts_again(t_s: FloatArray, row: int) -> bool:
    """Return whether the time of a row is that of the start, as in a repeated decay."""
    return bool(t_s[row] <= t_s[0] + np.median(np.abs(np.diff(t_s))))


def light_goes_on(values: FloatArray, row: int) -> bool:
    """Return whether the light of a row goes on from the row above, though time starts again.

    So it does where a counter of the time ran over. A decay that is repeated begins at its height.
    """
    parts = values[:_VALUES], values[max(row - _VALUES, 0) : row], values[row : row + _VALUES]
    if min(map(len, parts)) < _VALUES:
        return False
    first, before, after = (float(np.mean(part)) for part in parts)
    sigma = np.hypot(*(np.std(part, ddof=1) / np.sqrt(_VALUES) for part in parts[1:]))
    fall = first - before
    return bool(fall > _SIGMAS * sigma and after - before < _RISE * fall)
