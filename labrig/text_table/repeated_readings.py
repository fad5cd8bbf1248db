"""Rows that repeat a reading: the same row twice, or one value that is logged until the next.

A logger that is faster than its meter writes each value several times; a fit would take the copies
for measurements of their own, and their scatter for none. Counts that are equal by chance, such as
the zeros of faint light, are no copies: they differ from their neighbours by little more than the
last digit.
"""

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

#: Differences to the neighbours, in steps of the last digit, from which equal values are no chance.
_STEPS = 10.0
#: Fraction of the rows that are copies, and length of a run of equal values, from which they are.
_FRACTION, _RUN = 0.15, 4
#: Fewest copies, and fewest rows that tell them.
_FEWEST, _FEWEST_ROWS = 3, 10
#: Rows before and after a run in which the last digit of its values is looked for, and how well
#: they are multiples of it.
_NEAR, _MULTIPLE = 10, 1e-3


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
    >>> from labrig.text_table.repeated_readings import repeated_rows
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
        Copies; the first of each run of equal values is none, and a long run at the largest value,
        where a detector is saturated, has none.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.text_table.repeated_readings import held_readings
    >>> held = np.repeat([101.3, 87.2, 75.9, 66.4, 57.1], 3)
    >>> held_readings(held).sum()
    np.int64(10)
    """
    none = np.zeros(len(values), dtype=np.bool_)
    starts = np.flatnonzero(np.append(True, np.diff(values) != 0))
    if len(values) < _FEWEST_ROWS or len(starts) < _FEWEST or len(starts) == len(values):
        return none
    lengths = np.diff(np.append(starts, len(values)))
    level, highest = values[starts], values.max()
    step = float(np.diff(np.unique(values)).min())
    away = np.append(np.inf, np.append(np.abs(np.diff(level)), np.inf))
    nearest = np.minimum(away[:-1], away[1:])
    # Zero is where the light is below the last digit, or no photon came.
    runs = (lengths > 1) & (level != 0) & (nearest >= _STEPS * step)
    for run in np.flatnonzero(runs):
        near = values[max(starts[run] - _NEAR, 0) : starts[run] + lengths[run] + _NEAR]
        runs[run] = nearest[run] >= _STEPS * _last_digit(near, step)
    below = runs & (level < highest)
    copies = int((lengths[below] - 1).sum())
    if copies < _FEWEST:
        return none
    if copies < _FRACTION * len(values):
        below &= lengths >= _RUN
    # A run at the top is a copy, too, where it is as long as others, else a detector at its limit.
    longest = lengths[below].max(initial=0)
    rows = np.repeat(below | (runs & (level == highest) & (lengths <= longest)), lengths)
    rows[starts] = False
    return rows


def _last_digit(values: FloatArray, step: float) -> float:
    """Return the step of which all values (n,) are multiples; `step` if there is none.

    It may be larger than that of the whole table: meters change their range, counters their width.
    """
    levels = np.unique(values)
    own = float(np.diff(levels).min(initial=np.inf))
    multiples = levels / own
    return own if np.all(np.abs(multiples - np.round(multiples)) < _MULTIPLE) else step
