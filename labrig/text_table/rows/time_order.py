"""Times that go back from one row to the next."""

import numpy as np
import numpy.typing as npt

from labrig.foundation.arrays import FloatArray

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
    >>> from labrig.text_table.rows.time_order import backward_rows
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
    """Return whether the time of a row is that of the begin, as in a repeated decay."""
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
