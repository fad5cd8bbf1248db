"""Times of day in a column of times, as loggers write them: `12:00:05.2`."""

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

DAY_S = 86400.0
_CLOCK = re.compile(
    r"(?:(?P<date>\d{4}-\d\d-\d\d)[T ])?(?P<h>\d\d?):(?P<m>[0-5]\d):(?P<s>[0-5]\d(?:[.,]\d*)?)"
)


def seconds_from_first(cells: Sequence[str]) -> NDArray[np.float64] | None:
    """Return times of day in seconds from the first one; None if they are none.

    Without dates a time of day that falls by more than half a day is one of the next day.
    """
    matches = [_CLOCK.fullmatch(cell.strip()) for cell in cells]
    clocks = [match for match in matches if match is not None]
    if len(clocks) < len(cells):
        return None
    time_s = np.array(
        [
            3600 * int(clock["h"]) + 60 * int(clock["m"]) + float(clock["s"].replace(",", "."))
            for clock in clocks
        ]
    )
    dates = [clock["date"] for clock in clocks]
    if all(dates):
        days = np.array(dates, dtype="datetime64[D]").astype(np.int64)
    elif any(dates):
        return None
    else:
        days = np.concatenate([[0], np.cumsum(np.diff(time_s) < -DAY_S / 2)])
    return np.asarray(time_s - time_s[0] + DAY_S * (days - days[0]))
