"""Clock by which a table counts its times, and times by it that a user gives."""

import re
from dataclasses import dataclass, replace
from decimal import Decimal

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.text_table.names import time_unit_s

#: Spans of the rows from which the clock's zero is so far away that it tells nothing of lamp off.
FAR_SPANS = 1000.0
#: Digits of times in messages.
DIGITS = 9
_TIME = re.compile(
    r"(?P<number>[-+−]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][-+]?\d+)?)\s*(?P<unit>[^\d\s]*)"
)


@dataclass(frozen=True)
class TableClock:
    """Clock of a table, with the time at which `Series.t_s` is 0.

    Attributes
    ----------
    zero_s
        That time in the table's seconds, exactly; 0 if the series counts as its table does.
    unit_s
        Unit of the table's times in seconds.
    is_lamp_off
        Whether the series counts from lamp off; else it counts from its first row, since the
        clock's zero, as that of Unix time, is far from all rows.
    """

    zero_s: Decimal = Decimal(0)
    unit_s: Decimal = Decimal(1)
    is_lamp_off: bool = True

    def seconds(self, text: str) -> Decimal:
        """Return a time of the table's clock in seconds, exactly.

        Parameters
        ----------
        text
            A number in the table's unit, or with a unit such as `5.5 min`.

        Raises
        ------
        ValueError
            It is no such text.
        """
        match = _TIME.fullmatch(text.strip())
        unit_s = None
        if match is not None:
            unit = match["unit"]
            unit_s = Decimal(repr(time_unit_s(unit) or 0.0)) if unit else self.unit_s
        if match is None or not unit_s:
            raise ValueError(
                f"expected a time such as '330', in the table's unit, or '5.5 min', got '{text}'"
            )
        return Decimal(match["number"].replace(",", ".").replace("−", "-")) * unit_s

    def after_zero_s(self, text: str) -> float:
        """Return a time as those of the series count; arguments and errors are as above."""
        return float(self.seconds(text) - self.zero_s)

    def text(self, t_s: float) -> str:
        """Return a time of the series by the table's clock and in its unit, as options take it."""
        time = (self.zero_s + Decimal(f"{t_s:.{DIGITS}g}")) / self.unit_s
        plain = f"{time:f}"
        return plain.rstrip("0").rstrip(".") if "." in plain else plain

    def from_lamp_off(self, origin_s: Decimal) -> "TableClock":
        """Return the clock of a series that counts from a lamp off at a time of the table."""
        return replace(self, zero_s=origin_s, is_lamp_off=True)


def is_far(t_s: FloatArray) -> bool:
    """Return whether the zero of a clock is far from all rows.

    Parameters
    ----------
    t_s
        Times of the rows, in any unit, shape (n,).

    Returns
    -------
    bool
        Whether it is more than a thousand times as far as the rows are from one another.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.results.table_clock import is_far
    >>> is_far(np.array([1.0, 60.0])), is_far(1.76e9 + np.array([1.0, 60.0]))
    (False, True)
    """
    with np.errstate(over="ignore"):
        return bool(0 < np.ptp(t_s) < np.abs(t_s).min() / FAR_SPANS)
