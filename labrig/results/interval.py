"""Interval of a parameter by the profile of its likelihood, at 68 and 95 %."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from labrig.foundation.number_format import aligned, digits_of_range, rounded
from labrig.results.text_files import finite

#: Ratio of the distances of both limits, or of the larger one to σ, from which σ misleads.
ASYMMETRIC = 1.2


@dataclass(frozen=True)
class ProfileInterval:
    """Limits of one parameter, all other parameters fitted anew at each of its values.

    Attributes
    ----------
    value
        Fitted value.
    low_68, high_68, low_95, high_95
        Limits within which the parameter is with a probability of 68.3 and 95 %. A limit equal to
        `least` or `largest` excludes nothing on that side: the interval is one-sided.
    least, largest
        Range of possible values: a rate is from 0 to infinity, a kinetic order 1 or more.
    """

    value: float
    low_68: float
    high_68: float
    low_95: float
    high_95: float
    least: float = -math.inf
    largest: float = math.inf

    @property
    def is_one_sided(self) -> bool:
        """True if the data exclude nothing below, or nothing above, at 95 %."""
        return self.low_95 == self.least or self.high_95 == self.largest

    def differs_from(self, sigma: float) -> bool:
        """Return whether the 68 % limits, or a missing one, are another thing than value ± σ.

        They are if the distance of one of them, the other and σ differ by more than 20 %.
        """
        distances = (self.value - self.low_68, self.high_68 - self.value, sigma)
        return self.is_one_sided or not max(distances) < ASYMMETRIC * min(distances)

    def mapped(self, function: Callable[[float], float]) -> "ProfileInterval":
        """Return the interval of a monotone function of the parameter."""
        value, low_68, high_68, low_95, high_95, least, largest = map(
            function,
            (
                self.value,
                self.low_68,
                self.high_68,
                self.low_95,
                self.high_95,
                self.least,
                self.largest,
            ),
        )
        if least > largest:
            return ProfileInterval(value, high_68, low_68, high_95, low_95, largest, least)
        return ProfileInterval(value, low_68, high_68, low_95, high_95, least, largest)

    def scaled(self, factor: float) -> "ProfileInterval":
        """Return the interval with all limits that factor as far from the value."""

        def moved(limit: float) -> float:
            if limit in (self.least, self.largest):
                return limit
            return min(max(self.value + factor * (limit - self.value), self.least), self.largest)

        return ProfileInterval(
            self.value,
            moved(self.low_68),
            moved(self.high_68),
            moved(self.low_95),
            moved(self.high_95),
            self.least,
            self.largest,
        )

    def widened(self, relative_sigma: float) -> "ProfileInterval":
        """Return the interval of a positive parameter times a factor of 1 with a relative σ.

        Each limit moves away from the value, the ratio of both being that of two independent errors
        of the logarithm.
        """
        if relative_sigma == 0 or not self.value > 0:
            return self

        def moved(limit: float, sigmas: float) -> float:
            if not 0 < limit < math.inf:
                return limit
            distance = math.log(limit / self.value)
            total = math.hypot(distance, sigmas * relative_sigma)
            return self.value * math.exp(math.copysign(total, distance))

        return ProfileInterval(
            self.value,
            moved(self.low_68, 1.0),
            moved(self.high_68, 1.0),
            moved(self.low_95, NORMAL_95),
            moved(self.high_95, NORMAL_95),
            self.least,
            self.largest,
        )

    def cells(self) -> tuple[str, str, str]:
        """Return the value and both intervals as texts, for a table."""
        return (
            rounded(self.value),
            self._range_text(self.low_68, self.high_68),
            self._range_text(self.low_95, self.high_95),
        )

    def _range_text(self, low: float, high: float) -> str:
        """Return the limits to the digits that their distance is worth."""
        if low == self.least and high == self.largest:
            return "not determined"
        digits = digits_of_range(low, high, self.value)
        if low == self.least:
            return f"< {rounded(high, digits)}"
        if high == self.largest:
            return f"> {rounded(low, digits)}"
        return f"{rounded(low, digits)} to {rounded(high, digits)}"

    def to_dict(self) -> dict[str, Any]:
        """Return the content for a JSON file: limits as pairs, None where there is none."""
        content: dict[str, Any] = finite(
            {
                "value": self.value,
                "interval_68": [self.low_68, self.high_68],
                "interval_95": [self.low_95, self.high_95],
                "possible": [self.least, self.largest],
            }
        )
        return content


#: Standard deviations from the mean of a normal distribution within which 95 % are.
NORMAL_95 = 1.959963984540054


def interval_rows(intervals: Mapping[str, ProfileInterval]) -> list[list[str]]:
    """Return intervals by name as the rows of a table, its head first.

    Parameters
    ----------
    intervals
        Intervals by the name of their parameter, with its unit.

    Returns
    -------
    list of list of str
        Name, value, and limits at 68 and 95 % of each.

    Examples
    --------
    >>> from labrig.results import ProfileInterval, interval_rows
    >>> interval = ProfileInterval(0.021, 0.018, 0.026, 0.015, 0.034, least=0.0)
    >>> interval_rows({"k 1 / s⁻¹": interval})[1]
    ['k 1 / s⁻¹', '0.021', '0.018 to 0.026', '0.015 to 0.034']
    """
    rows = [[name, *interval.cells()] for name, interval in intervals.items()]
    return [["by profile likelihood", "", "68 %", "95 %"], *rows]


def interval_lines(intervals: Mapping[str, ProfileInterval]) -> list[str]:
    """Return the lines of a table of intervals for people; none without intervals.

    Parameters
    ----------
    intervals
        Intervals by the name of their parameter, with its unit.

    Returns
    -------
    list of str
        Lines of the table with its head.

    Examples
    --------
    >>> from labrig.results import ProfileInterval, interval_lines
    >>> interval = ProfileInterval(1.0, 1.0, 1.2, 1.0, 1.4, least=1.0)
    >>> print(interval_lines({"b": interval})[1].split("  ")[-1])
    < 1.4
    """
    return aligned(interval_rows(intervals)) if intervals else []


def read_intervals(content: Mapping[str, Any]) -> dict[str, ProfileInterval]:
    """Return intervals by name from the content of a JSON file, in which null is infinite.

    Parameters
    ----------
    content
        Intervals as `ProfileInterval.to_dict` writes them, by name.

    Returns
    -------
    dict of str to ProfileInterval
        The intervals.

    Examples
    --------
    >>> from labrig.results import ProfileInterval, read_intervals
    >>> interval = ProfileInterval(1.0, 0.9, 1.2, 0.8, 1.4, least=0.0)
    >>> read_intervals({"b": interval.to_dict()})["b"] == interval
    True
    """
    return {name: _read(entry) for name, entry in content.items()}


def _read(entry: Mapping[str, Any]) -> ProfileInterval:
    def pair(numbers: Sequence[float | None]) -> tuple[float, float]:
        low, high = numbers
        return (-math.inf if low is None else low, math.inf if high is None else high)

    return ProfileInterval(
        math.inf if entry["value"] is None else entry["value"],
        *pair(entry["interval_68"]),
        *pair(entry["interval_95"]),
        *pair(entry["possible"]),
    )
