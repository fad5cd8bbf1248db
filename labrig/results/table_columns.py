"""Roles of the columns of a table: times, values, their uncertainties with units, exposures."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.results.series import EXPOSURE, RESERVED, SIGMA_SUFFIX, TIME
from labrig.results.time_axis import TableLayout, TimeAxis, find_time_axis
from labrig.text_table import EXPECTED, Block, is_axis_line
from labrig.text_table.names import (
    LogScale,
    is_absorbance,
    is_channel,
    is_row_number,
    is_sigma,
    is_time,
    log_scale,
    sigma_of,
    split_unit,
)

#: Fractions of the value by the names of units that are relative.
_RELATIVE = {"%": 1e-2, "percent": 1e-2, "pct": 1e-2, "prozent": 1e-2, "‰": 1e-3}
_PREFIXES = {
    "": 1.0, "f": 1e-15, "p": 1e-12, "n": 1e-9, "u": 1e-6, "µ": 1e-6, "μ": 1e-6, "m": 1e-3,
    "k": 1e3, "M": 1e6, "G": 1e9,
}  # fmt: skip
_TYPOGRAPHY = str.maketrans({"²": "2", "³": "3", "^": "", " ": "", "·": "*", "−": "-", "⁻": "-"})


def sigma_scale(sigma_unit: str, value_unit: str, name: str) -> tuple[float, bool]:
    """Return the factor from a column of uncertainties to σ, and whether it multiplies the value.

    Parameters
    ----------
    sigma_unit, value_unit
        Units of both columns; an empty one is the same as the other's.
    name
        Name of the column of uncertainties, for the message.

    Raises
    ------
    UsageError
        The units differ by more than a prefix such as m or k.
    """
    of, value = (unit.strip(" ()[]").translate(_TYPOGRAPHY) for unit in (sigma_unit, value_unit))
    if of == value:
        return 1.0, False
    fraction = _RELATIVE.get(of.lower())
    if fraction is not None:
        return fraction, True
    # The first letter may be a prefix, in which case matters: mV, MV.
    if not of or not value or (of[0] == value[0] and of.lower() == value.lower()):
        return 1.0, False
    for prefix, factor in _PREFIXES.items():
        for value_prefix, value_factor in _PREFIXES.items():
            base = of[len(prefix) :]
            if base and of == prefix + base and value == value_prefix + base:
                return factor / value_factor, False
    raise UsageError(
        f"expected uncertainties in the unit of the values, '{value_unit}', or in %, got "
        f"'{sigma_unit}' in '{name}'; convert them and write their unit into the header, or delete "
        "the column: σ is then taken from the scatter"
    )


_EXPOSURES = frozenset({EXPOSURE, "exposure"})


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
    scale
        Logarithm of light that the column holds; None if it holds light.
    """

    name: str
    column: int
    sigma: int | None
    sigma_scale: float = 1.0
    sigma_is_relative: bool = False
    scale: LogScale | None = None

    def light(self, values: FloatArray, sigma: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return light and its σ by the numbers of the two columns (n,)."""
        sigma = sigma * self.sigma_scale * (np.abs(values) if self.sigma_is_relative else 1.0)
        if self.scale is None:
            return values, sigma
        return self.scale.light(values), self.scale.sigma(values, sigma)


@dataclass(frozen=True)
class Columns:
    """Roles of the columns of a table, by their indices.

    Attributes
    ----------
    names
        Names of the columns; their numbers without names.
    time
        Where the times come from.
    exposure
        Column of exposures; None without one.
    channels
        Columns of values.
    reserved
        Columns of series.csv that are no channels, by name.
    value_unit
        Unit of the values; empty if unknown.
    """

    names: tuple[str, ...]
    time: TimeAxis
    exposure: int | None
    channels: tuple[Channel, ...]
    reserved: dict[str, int]
    value_unit: str

    def __str__(self) -> str:
        """Return in words which columns are times, values and σ, and the unit of the times."""

        def text(columns: Sequence[int]) -> str:
            return ", ".join(" ".join(self.names[column].split()) for column in columns)

        sigmas = [channel.sigma for channel in self.channels if channel.sigma is not None]
        values = ", ".join(
            text([channel.column])
            + (f", a logarithm: light is {channel.scale}" if channel.scale else "")
            + (", an absorbance: fitted as it stands" if is_absorbance(channel.name) else "")
            for channel in self.channels
        )
        sigma = f"σ {text(sigmas)}" if sigmas else "no σ"
        of_time = [column for column in (self.time.date, self.time.column) if column is not None]
        time = text(of_time) or "row number"
        return f"time {time} ({self.time.source}); values {values}; {sigma}"


def find_columns(table: Block, layout: TableLayout) -> Columns:
    """Return the roles of the columns by their names and the user's answers."""
    names = column_names(table)
    filled = [column for column in range(len(names)) if not _is_empty(table, names, column, layout)]
    time = find_time_axis(table, names, filled, layout)
    if time.column is None and not table.names and len(names) > 1:
        names = tuple(str(column + 1) for column in range(len(names)))
    in_use = [
        column
        for column in filled
        if column == time.column
        or names[column] == layout.column
        or not _numbers_the_rows(table, names[column], column)
    ]
    lower = {column: names[column].lower() for column in in_use}
    exposure = _only_match(names, [column for column in in_use if lower[column] in _EXPOSURES])
    reserved = {names[column]: column for column in in_use if names[column] in RESERVED}
    values = [
        column
        for column in in_use
        if column not in {time.column, time.date, exposure} | set(reserved.values())
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
    if len(signals) > 1 and (time.column is None or is_axis_line(table.names_line)):
        listed = ", ".join(names[column] for column in signals)
        raise UsageError(
            f"expected one curve, got {len(signals)} in one memory or file: {listed}; choose one "
            "with '--column NAME'"
        )
    scales = {column: log_scale(names[column], _below(table, column)) for column in signals}
    channels = tuple(
        Channel(
            _channel_name(names, column, signals, scales[column]),
            column,
            sigmas.get(column),
            *_sigma_scale(table, names, column, sigmas.get(column), scales[column]),
            scales[column],
        )
        for column in signals
    )
    value_units = {
        scale.unit if scale else _unit(table, names, column) for column, scale in scales.items()
    }
    value_unit = value_units.pop() if len(value_units) == 1 else ""
    shown = names if table.names else [f"column {number + 1}" for number in range(len(names))]
    return Columns(tuple(shown), time, exposure, channels, reserved, value_unit)


def column_names(table: Block) -> tuple[str, ...]:
    """Return the names of the columns; without any, time, value and sigma, or their numbers."""
    if table.names:
        return table.names
    width = len(table.rows[0])
    if width == 1:
        return ("value",)
    if width <= 3:
        return (TIME, "value", "sigma")[:width]
    return (TIME, *(str(number) for number in range(2, width + 1)))


def _is_empty(table: Block, names: Sequence[str], column: int, layout: TableLayout) -> bool:
    """Return whether a column has no part in a series: settings or texts."""
    name = names[column]
    if name in RESERVED or name in (layout.time, layout.column):
        return False
    cells = [row[column] for row in table.rows]
    if not any(cells[1:]) and (len(cells) > 1 or not cells[0]):
        return not name.endswith(SIGMA_SUFFIX) and not is_sigma(name)
    numbers = [table.number(cell) for cell in cells if cell]
    return all(number is None for number in numbers) and not is_time(name) and len(cells) > 1


def _numbers_the_rows(table: Block, name: str, column: int) -> bool:
    numbers = [table.number(row[column]) for row in table.rows]
    if not (is_row_number(name) or is_channel(name)) or None in numbers:
        return False
    return bool(np.all(np.diff(np.array(numbers, dtype=np.float64)) == 1))


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
    table: Block, names: Sequence[str], column: int, sigma: int | None, scale: LogScale | None
) -> tuple[float, bool]:
    """Return the factor from a column of uncertainties to σ, and whether σ is relative."""
    if sigma is None:
        return 1.0, False
    if scale is not None:
        scale.require_unit(_unit(table, names, sigma), names[sigma])
        return 1.0, False
    unit, value_unit = _unit(table, names, sigma), _unit(table, names, column)
    # The brackets of `σ (I)` hold the name of the values.
    if unit.lower() in (names[column].lower(), split_unit(names[column])[0].lower()):
        unit = ""
    return sigma_scale(unit, value_unit, names[sigma])


def _unit(table: Block, names: Sequence[str], column: int) -> str:
    """Return the unit in the name of a column, or in a line of units below the names."""
    return split_unit(names[column])[1] or _below(table, column)


def _below(table: Block, column: int) -> str:
    return table.units[column] if column < len(table.units) else ""


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


def _channel_name(
    names: Sequence[str], column: int, signals: Sequence[int], scale: LogScale | None
) -> str:
    """Return the name of a channel without its unit, if that still tells it from the others."""
    name = " ".join(names[column].split())
    if not name or [names[other] for other in signals].count(names[column]) > 1:
        raise UsageError(
            f"expected a name of its own for every column, got '{name}' for column {column + 1}; "
            "rename it"
        )
    base = scale.name if scale and scale.name else split_unit(name)[0]
    bases = [split_unit(names[other])[0] for other in signals]
    taken = bases.count(base) > 1 or base in (TIME, EXPOSURE, *RESERVED)
    return name if taken or base.endswith(SIGMA_SUFFIX) else base


def _only_match(names: Sequence[str], columns: Sequence[int]) -> int | None:
    if len(columns) > 1:
        several = ", ".join(names[column] for column in columns)
        raise UsageError(f"expected one of the columns {several}, got several; keep one")
    return columns[0] if columns else None
