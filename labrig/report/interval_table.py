"""Table of intervals by profile likelihood."""

from collections.abc import Mapping

from labrig.report.sections import Table
from labrig.results import ProfileInterval, interval_rows

CAPTION = (
    "Limits by profile likelihood, all other parameters fitted anew at each value: where ± 1 σ is "
    "off by more than 20 %, or as asked for. < and >: one-sided, the data exclude nothing on the "
    "other side."
)


def interval_tables(intervals: Mapping[str, ProfileInterval]) -> tuple[Table, ...]:
    """Return the table of intervals by the name of their parameter; none without intervals."""
    if not intervals:
        return ()
    head, *rows = interval_rows(intervals)
    return (Table(("", "value", *head[2:]), tuple(tuple(row) for row in rows), CAPTION),)
