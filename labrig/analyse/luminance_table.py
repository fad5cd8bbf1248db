"""Luminance meter's table, as `labrig fit luminance` evaluates it."""

import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from labrig.fit import fit_luminance
from labrig.foundation.errors import FitError, UsageError
from labrig.foundation.quantity import FRACTION, parse
from labrig.results import (
    LuminanceDecay,
    LuminanceRequirement,
    Series,
    TableLayout,
    luminance_requirement,
    luminance_unit,
    read_described_series,
)

_UNIT = re.compile(r"[mµμu]?cd(\s*/\s*m(2|²|\^2)|[\s·*]*m(\^?[-−]2|⁻²))|\bnits?\b")


@dataclass(frozen=True)
class LuminanceTableOptions:
    """Options of `labrig fit luminance`, as texts of its command line.

    Attributes
    ----------
    unit
        Unit of the luminances; None takes it from the column's name, and mcd/m² without one there.
    off
        Time of lamp off by the table's clock, in its unit or with one such as `5.5 min`; None if it
        is at 0.
    scale_sigma
        Relative σ of the meter's scale, such as `4 %`.
    require
        Least luminances such as `140 mcd/m2 at 10 min`.
    colours
        Letters of the colours for the marking, such as `K-W`.
    excitation
        Excitation as the report shall state it.
    """

    unit: str | None = None
    off: str | None = None
    scale_sigma: str = "0 %"
    require: tuple[str, ...] = ()
    colours: str = ""
    excitation: str = ""

    def __post_init__(self) -> None:
        if self.unit is not None:
            _factor("--unit", self.unit)
        _ = self.scale_fraction, self.requirements

    @property
    def scale_fraction(self) -> float:
        """Relative σ of the scale as a fraction."""
        try:
            return parse(self.scale_sigma, FRACTION)
        except ValueError as error:
            raise UsageError(f"--scale-sigma: {error}") from None

    @property
    def requirements(self) -> tuple[LuminanceRequirement, ...]:
        """Least luminances in mcd/m²."""
        return tuple(_requirement(text) for text in self.require)


def evaluate_luminance_table(
    path: Path, options: LuminanceTableOptions | None = None, layout: TableLayout | None = None
) -> tuple[LuminanceDecay, str]:
    """Evaluate a luminance meter's readings of an afterglow.

    Parameters
    ----------
    path
        Path of the table, as `read_series` reads it.
    options
        Options; None takes the defaults.
    layout
        Answers to what the table leaves open; None finds all in the table.

    Returns
    -------
    decay : LuminanceDecay
        Luminances at the times of standards, and what follows from them.
    columns : str
        Columns of the table that were taken as times, values and σ, and the unit, in words.

    Raises
    ------
    UsageError, DataError
        An option or the table is malformed, or it has more than one series or column of values.
    FitError
        There are too few readings, or their times do not rise.

    Examples
    --------
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from labrig.analyse import LuminanceTableOptions, evaluate_luminance_table
    >>> t_min = np.geomspace(1, 600, 60)
    >>> table = Path("luminance.csv")
    >>> head = "time/min,luminance/(mcd/m2)"
    >>> rows = np.transpose([t_min, 290 * (1 + t_min) ** -1.1])
    >>> np.savetxt(table, rows, delimiter=",", header=head, comments="")
    >>> decay, columns = evaluate_luminance_table(table, LuminanceTableOptions(scale_sigma="4 %"))
    >>> decay.marking, str(decay.visible_s)
    ('20.7/3.15-516', '31000(1100) s')
    """
    options = options or LuminanceTableOptions()
    parts, columns = read_described_series(path, layout or TableLayout())
    series = parts[0]
    if len(parts) > 1 or len(series.channels) > 1:
        raise UsageError(
            f"{path}: expected one series with one column of luminances, got {len(parts)} series "
            f"of {', '.join(series.channels)}; choose a column with --column"
        )
    named = next(
        filter(None, map(_UNIT.search, (series.value_unit, *series.channels, columns))), None
    )
    if named is None and options.unit is None and series.value_unit:
        raise UsageError(
            f"{path}: expected luminances in mcd/m2 or cd/m2, got '{series.value_unit}' in "
            f"'{series.channels[0]}'; say '--unit mcd/m2', or which it is"
        )
    unit = options.unit or (named[0] if named else "mcd/m2")
    factor = _factor(f"{path}: unit of {series.channels[0]}", unit)
    off_s = _off_s(path, options.off, series)
    rows = np.flatnonzero(series.usable & (series.t_s > off_s))
    rows = rows[np.argsort(series.t_s[rows], kind="stable")]
    sigma = factor * series.sigma[rows, 0]
    try:
        decay = fit_luminance(
            series.t_s[rows] - off_s,
            factor * series.values[rows, 0],
            None if np.isnan(sigma).all() else sigma,
            scale_sigma=options.scale_fraction,
            required=options.requirements,
            colours=options.colours,
            excitation=options.excitation,
            origin=path.name,
        )
    except FitError as error:
        raise FitError(f"{path}: {error}") from None
    decay = replace(decay, warnings=(*series.warnings, *decay.warnings))
    return decay, f"{columns}; luminances in {unit.replace('m2', 'm²')}"


def _off_s(path: Path, text: str | None, series: Series) -> float:
    """Return the time of lamp off as those of the series count."""
    if text is None:
        first_s, last_s = float(series.t_s.min()), float(series.t_s.max())
        if not series.clock.is_lamp_off or last_s < 0:
            begin, end = (series.clock.text(t_s) for t_s in (first_s, last_s))
            raise UsageError(
                f"{path}: expected times after the light went off, got a clock from {begin} to "
                f"{end}, which does not contain that time; state it with --off"
            )
        return 0.0
    try:
        return series.clock.after_zero_s(text)
    except ValueError as error:
        raise UsageError(f"{path}: --off: {error}") from None


def _factor(place: str, unit: str) -> float:
    """Return mcd/m² in a unit."""
    try:
        return luminance_unit(unit)
    except ValueError as error:
        raise UsageError(f"{place}: {error}") from None


def _requirement(text: str) -> LuminanceRequirement:
    try:
        return luminance_requirement(text)
    except ValueError as error:
        raise UsageError(f"--require: {error}") from None
