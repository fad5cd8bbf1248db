"""Rows of another program's table that are measurements, and warnings about the others."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from labrig.foundation.errors import UsageError
from labrig.foundation.result_warning import Disturbance, ResultWarning, Undetermined, Unmeasured
from labrig.results.series import Series, add_flag
from labrig.text_table import Block
from labrig.text_table.rows import (
    at_ceiling,
    at_floor,
    backward_rows,
    held_readings,
    light_goes_on,
    no_measurements,
    repeated_rows,
    starts_again,
)

Rows = npt.NDArray[np.intp]
#: Flag of values at a detector's ceiling or floor.
CLIPPED = "clipped"
#: Lines that a message names.
_NAMED = 4
#: Ratio of long and short row spacings up to which rows are regular.
_REGULAR = 1.5
#: Fraction of the rows that share their time with the row before from which a clock is too coarse.
_SHARED = 0.2


def measured_rows(table: Block, columns: Sequence[int]) -> tuple[Rows, list[ResultWarning]]:
    """Return the rows of a table where no column holds a mark for no measurement.

    Parameters
    ----------
    table
        The table.
    columns
        Columns of values and of their uncertainties.

    Returns
    -------
    rows : ndarray of int
        Indices of the rows that are measurements.
    warnings : list of ResultWarning
        Marks in the other rows.
    """
    marks: dict[int, str] = {}
    for column in columns:
        cells = [row[column] for row in table.rows]
        for row, cell in no_measurements(cells, table.number).items():
            marks.setdefault(row, cell)
    rows = np.array([row for row in range(len(table.rows)) if row not in marks], dtype=np.intp)
    by_cell: dict[str, list[int]] = {}
    for row, cell in sorted(marks.items()):
        by_cell.setdefault(cell, []).append(table.lines[row])
    if not len(rows):
        raise UsageError(
            f"expected measurements, got only '{next(iter(by_cell))}'; was the detector overloaded?"
        )
    return rows, [
        Unmeasured(
            "row-without-value",
            "'{cell}' is no measurement; rows left out: {left_out}",
            _lines(lines),
            cell=cell,
            left_out=len(lines),
        )
        for cell, lines in by_cell.items()
    ]


def independent_rows(
    series: Series, lines: Sequence[int], resolution_s: float
) -> tuple[Rows, list[ResultWarning]]:
    """Return the rows of one series that are measurements of their own.

    Parameters
    ----------
    series
        The series of a table with one region and unit, in the order of its rows.
    lines
        Line number of each row.
    resolution_s
        Last digit of the clock that the times are from, in seconds; 0 if they are numbers.

    Returns
    -------
    rows : ndarray of int
        Indices of the rows that repeat no other row.
    warnings : list of ResultWarning
        Rows that were left out, and times that are uncertain.

    Raises
    ------
    UsageError
        The time starts again while the light goes on to fall.
    """
    warnings = _of_order(series, lines)
    repeated = repeated_rows(series.t_s, series.values)
    if repeated.any():
        which = [lines[row] for row in np.flatnonzero(repeated).tolist()]
        warnings.append(
            Disturbance(
                "row-repeated",
                "the row before once more, with its time and value; rows left out: {left_out}",
                _lines(which),
                left_out=len(which),
            )
        )
    shared = float(np.mean(np.append(False, np.diff(series.t_s) == 0) & ~repeated))
    if resolution_s and shared > _SHARED:
        warnings.append(
            Undetermined(
                "clock-too-coarse",
                "rows share their time, since the clock shows steps of {resolution_s:g} s: times "
                "are uncertain by as much; export them with more digits",
                resolution_s=resolution_s,
            )
        )
    held = _held(series, ~repeated)
    if held.any():
        which = [lines[row] for row in np.flatnonzero(held).tolist()]
        warnings.append(
            Disturbance(
                "reading-held",
                "equal to the row before though neighbours differ, as a logger writes that is "
                "faster than its meter; rows left out: {left_out}",
                _lines(which),
                left_out=len(which),
            )
        )
    return np.flatnonzero(~(repeated | held)), warnings


def with_limits(series: Series, lines: Sequence[int]) -> tuple[Series, list[ResultWarning]]:
    """Return the series of one channel with values at the limits of its detector flagged.

    Parameters
    ----------
    series
        The series of a table with one region and unit.
    lines
        Line number of each row.
    """
    order = np.argsort(series.t_s, kind="stable")
    if len(series.channels) > 1 or len(set(series.exposure_s)) > 1 or not _is_course(series.t_s):
        return series, []
    warnings: list[ResultWarning] = []
    flags = list(series.flag)
    for limit, name in ((at_ceiling, "ceiling"), (at_floor, "floor")):
        if name == "floor" and not _is_regular(series.t_s):
            continue
        rows = order[limit(series.values[order, 0])]
        if not len(rows):
            continue
        warnings.append(
            Disturbance(
                "detector-clipped",
                "equal, {level:.6g}, and far from the values beside: the detector was {state}; "
                "rows left out: {left_out}",
                _lines([lines[row] for row in np.sort(rows).tolist()]),
                level=series.values[rows[0], 0],
                state="saturated" if name == "ceiling" else "at its lowest value",
                left_out=len(rows),
            )
        )
        for row in rows.tolist():
            flags[row] = add_flag(flags[row], CLIPPED)
    return replace(series, flag=tuple(flags)), warnings


def _is_course(t_s: npt.NDArray[np.float64]) -> bool:
    steps = np.diff(t_s)
    return bool(np.all(steps > 0) or np.all(steps < 0))


def _is_regular(t_s: npt.NDArray[np.float64]) -> bool:
    """Return whether rows follow each other in equal steps, but for a few.

    Counts that were divided by widths of bins that grow are multiples of no step.
    """
    low, high = np.quantile(np.abs(np.diff(t_s)), (0.1, 0.9)) if len(t_s) > 1 else (0.0, 0.0)
    return _is_course(t_s) and bool(high <= _REGULAR * low)


def _of_order(series: Series, lines: Sequence[int]) -> list[ResultWarning]:
    """Return warnings about times that go back."""
    warnings: list[ResultWarning] = []
    for row in backward_rows(series.t_s).tolist():
        before_s, after_s = series.t_s[row - 1], series.t_s[row]
        if not starts_again(series.t_s, row):
            warnings.append(
                Disturbance(
                    "time-goes-back",
                    "the time goes back from {before_s:.6g} s to {after_s:.6g} s, and rows are "
                    "taken by their times: was the clock set?",
                    _lines([lines[row]]),
                    before_s=before_s,
                    after_s=after_s,
                )
            )
        elif light_goes_on(series.values[:, 0], row):
            raise UsageError(
                f"line {lines[row]}: expected times that go on, got {after_s:.6g} s after "
                f"{before_s:.6g} s while the light goes on to fall: did a counter run over? Add "
                "the missing time to those that follow"
            )
    return warnings


def _held(series: Series, own: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """Return which rows, of those that are no repeated ones, hold the values of the row before."""
    held = np.zeros(len(own), dtype=np.bool_)
    if _is_regular(series.t_s[own]) and len(set(series.exposure_s)) == 1:
        held[own] = np.all([held_readings(values) for values in series.values[own].T], axis=0)
    return held


def _lines(lines: Sequence[int]) -> str:
    """Return the numbers of lines in words."""
    if len(lines) == 1:
        return f"line {lines[0]}"
    if lines[-1] - lines[0] == len(lines) - 1:
        return f"lines {lines[0]} to {lines[-1]}"
    named = ", ".join(map(str, lines[:_NAMED]))
    return f"lines {named}{', …' if len(lines) > _NAMED else ''}"
