"""Values at the ceiling or at the floor of a detector, where one number stands for all beyond.

Several equal values at the top are no light that was measured, unless they differ from their
neighbours by little more than the last digit: a slow change repeats them, too.
"""

import numpy as np

from labrig.foundation.arrays import BoolArray, FloatArray
from labrig.text_table.rows.repeated_readings import last_digit

#: Distance to the values beside, in steps of the last digit, from which equal values are a limit.
#: Photons that get rare go to zero from some counts at once.
_STEPS_BELOW_CEILING, _STEPS_ABOVE_FLOOR = 10.0, 50.0
#: Fewest equal values, and fraction of the values from the first to the last of them.
_FEWEST_AT_CEILING, _FEWEST_AT_FLOOR, _FRACTION = 3, 5, 0.5
#: Values beside those at the limit from which the last digit is found.
_NEAR = 20


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
    >>> from labrig.text_table.rows.detector_limits import at_ceiling
    >>> at_ceiling(np.array([4095.0, 4095, 4094, 4095, 4095, 3702, 3333])).tolist()
    [True, True, True, True, True, False, False]
    """
    found = np.zeros(len(values), dtype=np.bool_)
    rows = np.flatnonzero(values == values.max())
    first, end = rows[0], rows[-1] + 1
    beside = np.append(values[max(first - 1, 0) : first], values[end : end + 1])
    if len(rows) < max(_FEWEST_AT_CEILING, _FRACTION * (end - first)) or not len(beside):
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
    >>> from labrig.text_table.rows.detector_limits import at_floor
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
    if len(values) - first < _FEWEST_AT_FLOOR:
        return found
    step = _step(values, first, len(values))
    if values[first - 1] - values[-1] >= _STEPS_ABOVE_FLOOR * step:
        found[first:] = True
    return found


def _step(values: FloatArray, first: int, end: int) -> float:
    """Return the last digit of the values beside those from `first` to `end`."""
    near = np.append(values[max(first - _NEAR, 0) : first], values[end : end + _NEAR])
    return last_digit(near, values[first])
