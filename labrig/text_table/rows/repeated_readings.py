"""Rows that repeat a reading: the same row twice, or one value that is logged until the next.

A logger that is faster than its meter writes each value several times; a fit would take the copies
for measurements of their own, and their scatter for none. Counts that are equal by chance, such as
the zeros of faint light, are no copies: they differ from their neighbours by little more than the
last digit.
"""

from decimal import Decimal

import numpy as np

from labrig.foundation.arrays import BoolArray, FloatArray

#: Differences to the neighbours, in steps of the last digit, from which equal values are no chance.
_STEPS = 10.0
#: Fraction of the rows that are copies, and length of a run of equal values, from which they are.
_FRACTION, _RUN = 0.15, 5
#: Fewest copies, and fewest rows that tell them.
_FEWEST, _FEWEST_ROWS = 4, 10
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
    >>> from labrig.text_table.rows.repeated_readings import repeated_rows
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
    >>> from labrig.text_table.rows.repeated_readings import held_readings
    >>> held = np.repeat([101.3, 87.2, 75.9, 66.4, 57.1], 3)
    >>> held_readings(held).sum()
    np.int64(10)
    """
    none = np.zeros(len(values), dtype=np.bool_)
    starts = np.flatnonzero(np.append(True, np.diff(values) != 0))
    if len(values) < _FEWEST_ROWS or len(starts) < _FEWEST or len(starts) == len(values):
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
    >>> from labrig.text_table.rows.repeated_readings import last_digit
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
