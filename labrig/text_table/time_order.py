"""Times that go back from one row to the next."""

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

#: Fraction of the rows from which rows whose time goes back are in no order at all.
_NO_ORDER = 0.1
#: Fraction of the light's fall by which it rises again where a decay is repeated.
_RISE = 0.1
#: Fraction of the first value by which the light has to have fallen to tell.
_FALL = 0.3


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
    >>> from labrig.text_table.time_order import backward_rows
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
    first, before, after = values[0], values[row - 1], values[row]
    return bool(first - before > _FALL * abs(first) and after - before < _RISE * (first - before))
