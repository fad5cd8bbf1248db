"""Roles of the columns of a table: times, values, their uncertainties, exposures."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from labrig.errors import UsageError
from labrig.results.series import EXPOSURE, RESERVED, SIGMA_SUFFIX, TIME
from labrig.results.sigma_unit import sigma_scale
from labrig.text_table import DECIMAL_MARKS, EXPECTED, Block
from labrig.text_table.names import (
    ABSCISSAS,
    is_row_number,
    is_sigma,
    is_time,
    sigma_of,
    split_time,
    split_unit,
    time_unit_s,
)

_EXPOSURES = frozenset({EXPOSURE, "exposure"})


@dataclass(frozen=True)
class TableLayout:
    """Answers to what a table itself may leave open; None finds the answer in the table.

    Attributes
    ----------
    time
        Name of the column of times.
    column
        Name of the column of values.
    time_unit
        Unit of the times, such as `ms`.
    decimal
        Decimal mark of the numbers, `point` or `comma`.
    """

    time: str | None = None
    column: str | None = None
    time_unit: str | None = None
    decimal: str | None = None

    def __post_init__(self) -> None:
        if self.time_unit is not None and time_unit_s(self.time_unit) is None:
            raise UsageError(
                f"--time-unit: expected a unit such as ns, ms, s, min or h, got '{self.time_unit}'"
            )
        if self.decimal is not None and self.decimal not in DECIMAL_MARKS:
            raise UsageError(f"--decimal: expected 'point' or 'comma', got '{self.decimal}'")


@dataclass(frozen=True)
class Channel:
    """Column of values and that of their uncertainty.

    Attributes
    ----------
    name, column
        Name of the values, and their column.
    sigma
        Column of uncertainties; None without one.
    sigma_scale, sigma_is_relative
        Factor from that column to σ in the unit of the values, or to σ over the value.
    """

    name: str
    column: int
    sigma: int | None
    sigma_scale: float = 1.0
    sigma_is_relative: bool = False


@dataclass(frozen=True)
class Columns:
    """Roles of the columns of a table, by their indices.

    Attributes
    ----------
    time, unit_s
        Column of times and its unit in seconds.
    exposure
        Column of exposures; None without one.
    channels
        Columns of values.
    reserved
        Columns of series.csv that are no channels, by name.
    value_unit
        Unit of the values; empty if unknown.
    """

    time: int
    unit_s: float
    exposure: int | None
    channels: tuple[Channel, ...]
    reserved: dict[str, int]
    value_unit: str

    def describe(self, names: Sequence[str]) -> str:
        """Return in words which columns are times, values and σ, by name or else by number."""

        def text(columns: Sequence[int]) -> str:
            return ", ".join(
                " ".join(names[column].split()) if names else f"column {column + 1}"
                for column in columns
            )

        sigmas = [channel.sigma for channel in self.channels if channel.sigma is not None]
        values = [channel.column for channel in self.channels]
        sigma = f"σ {text(sigmas)}" if sigmas else "no σ"
        return f"time {text([self.time])}; values {text(values)}; {sigma}"


def find_columns(table: Block, layout: TableLayout) -> Columns:
    """Return the roles of the columns by their names and the user's answers."""
    names = column_names(table)
    in_use = [column for column in range(len(names)) if not _is_idle(table, names, column, layout)]
    time, unit_s = _time(table, names, in_use, layout)
    lower = {column: names[column].lower() for column in in_use}
    exposure = _only_match(names, [column for column in in_use if lower[column] in _EXPOSURES])
    reserved = {names[column]: column for column in in_use if names[column] in RESERVED}
    values = [
        column for column in in_use if column not in {time, exposure} | set(reserved.values())
    ]
    if layout.column is not None and layout.column not in [names[column] for column in values]:
        raise UsageError(
            f"--column: expected one of {', '.join(names[column] for column in values)}, got "
            f"'{layout.column}'"
        )
    sigmas = _sigmas(names, values, layout)
    signals = [
        column
        for column in values
        if column not in sigmas.values() and layout.column in (None, names[column])
    ]
    if not signals:
        raise UsageError(f"{EXPECTED}, got {', '.join(names)}; a column of values is missing")
    channels = tuple(
        Channel(
            _channel_name(names, column, signals),
            column,
            sigmas.get(column),
            *_sigma_scale(table, names, column, sigmas.get(column)),
        )
        for column in signals
    )
    value_units = {_unit(table, names, column) for column in signals}
    value_unit = value_units.pop() if len(value_units) == 1 else ""
    return Columns(time, unit_s, exposure, channels, reserved, value_unit)


def column_names(table: Block) -> tuple[str, ...]:
    """Return the names of the columns; without any, time, value and sigma, or their numbers."""
    if table.names:
        return table.names
    width = len(table.rows[0])
    if width == 1:
        raise UsageError(
            f"{EXPECTED}, got 1 column without names; put a column with the time of each row "
            "before it"
        )
    if width <= 3:
        return (TIME, "value", "sigma")[:width]
    return (TIME, *(str(number) for number in range(2, width + 1)))


def _is_idle(table: Block, names: Sequence[str], column: int, layout: TableLayout) -> bool:
    """Return whether a column has no part in a series: settings, texts or the rows' numbers."""
    name = names[column]
    if name in RESERVED or name in (layout.time, layout.column):
        return False
    cells = [row[column] for row in table.rows]
    if not any(cells[1:]) and (len(cells) > 1 or not cells[0]):
        return not name.endswith(SIGMA_SUFFIX) and not is_sigma(name)
    numbers = [table.number(cell) for cell in cells if cell]
    if all(number is None for number in numbers):
        return not is_time(name) and len(cells) > 1
    if is_row_number(name) and None not in numbers:
        return bool(np.all(np.diff(np.array(numbers, dtype=np.float64)) == 1))
    return False


def _time(
    table: Block, names: Sequence[str], in_use: Sequence[int], layout: TableLayout
) -> tuple[int, float]:
    """Return the column of times and its unit in seconds."""
    if layout.time is not None:
        matches = [column for column in in_use if names[column] == layout.time]
        if not matches:
            raise UsageError(
                f"--time: expected one of {', '.join(names[column] for column in in_use)}, got "
                f"'{layout.time}'"
            )
    else:
        matches = [column for column in in_use if is_time(names[column])] or [
            column for column in in_use if split_unit(names[column])[0].lower() in ABSCISSAS
        ]
    if not matches:
        raise UsageError(
            f"{EXPECTED}, got {', '.join(names)}; if one of them is the time, name it: "
            "'--time NAME'"
        )
    if len(matches) > 1:
        several = ", ".join(names[column] for column in matches)
        raise UsageError(f"expected one of the columns {several}, got several; say '--time NAME'")
    (column,) = matches
    unit = (split_time(names[column]) or split_unit(names[column]))[1]
    if table.units and not unit:
        unit = table.units[column] if column < len(table.units) else ""
    unit_s = time_unit_s(layout.time_unit or unit or "s")
    if unit_s is None:
        raise UsageError(
            f"expected a unit of time for '{names[column]}', got '{unit}'; say '--time-unit s', or "
            "which it is"
        )
    return column, unit_s


def _sigmas(names: Sequence[str], values: Sequence[int], layout: TableLayout) -> dict[int, int]:
    """Return the columns of uncertainties by the columns of values whose they are."""
    sigmas: dict[int, int] = {}
    texts = {column: names[column].lower() for column in values}
    bases = {column: split_unit(text)[0] for column, text in texts.items()}
    for column in values:
        if names[column] == layout.column:
            continue
        of = sigma_of(names[column])
        owners = [
            other for other in values if other != column and of in (texts[other], bases[other])
        ]
        if not owners and is_sigma(names[column]):
            owners = _owner_left_of(names, values, column, layout)
        if len(owners) == 1:
            if owners[0] in sigmas:
                raise UsageError(
                    f"expected one column of uncertainties for '{names[owners[0]]}', got "
                    f"'{names[sigmas[owners[0]]]}' and '{names[column]}'; rename one"
                )
            sigmas[owners[0]] = column
    return sigmas


def _sigma_scale(
    table: Block, names: Sequence[str], column: int, sigma: int | None
) -> tuple[float, bool]:
    """Return the factor from a column of uncertainties to σ, and whether σ is relative."""
    if sigma is None:
        return 1.0, False
    unit, value_unit = _unit(table, names, sigma), _unit(table, names, column)
    # The brackets of `σ (I)` hold the name of the values.
    if unit.lower() in (names[column].lower(), split_unit(names[column])[0].lower()):
        unit = ""
    return sigma_scale(unit, value_unit, names[sigma])


def _unit(table: Block, names: Sequence[str], column: int) -> str:
    """Return the unit in the name of a column, or in a line of units below the names."""
    below = table.units[column] if column < len(table.units) else ""
    return split_unit(names[column])[1] or below


def _owner_left_of(
    names: Sequence[str], values: Sequence[int], column: int, layout: TableLayout
) -> list[int]:
    """Return the column whose uncertainty one with a bare name such as `±` is.

    It is the only column of values or, of several, the one to its left, if each has its own.
    """
    signals = [other for other in values if not is_sigma(names[other])]
    bare = [other for other in values if is_sigma(names[other])]
    if len(signals) == 1:
        return signals
    left = [other for other in signals if other == column - 1]
    if len(bare) < len(signals) and layout.column is None:
        raise UsageError(
            f"expected a column of uncertainties for each of "
            f"{', '.join(names[other] for other in signals)}, got {len(bare)} for all; choose one "
            "with '--column NAME', or call them <name>_sigma"
        )
    return left


def _channel_name(names: Sequence[str], column: int, signals: Sequence[int]) -> str:
    """Return the name of a channel without its unit, if that still tells it from the others."""
    name = " ".join(names[column].split())
    if not name or [names[other] for other in signals].count(names[column]) > 1:
        raise UsageError(
            f"expected a name of its own for every column, got '{name}' for column {column + 1}; "
            "rename it"
        )
    base = split_unit(name)[0]
    bases = [split_unit(names[other])[0] for other in signals]
    taken = bases.count(base) > 1 or base in (TIME, EXPOSURE, *RESERVED)
    return name if taken or base.endswith(SIGMA_SUFFIX) else base


def _only_match(names: Sequence[str], columns: Sequence[int]) -> int | None:
    if len(columns) > 1:
        several = ", ".join(names[column] for column in columns)
        raise UsageError(f"expected one of the columns {several}, got several; keep one")
    return columns[0] if columns else None
