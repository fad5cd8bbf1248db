"""Fit of a table with charge and decay, as `labrig fit charge` does it."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, cast

import numpy as np

from labrig.fit import ChargeFit, fit_charge_and_decay
from labrig.foundation.errors import FitError, UsageError
from labrig.results import Series, TableLayout, read_described_series

#: Spans of the rows from them beyond which a switching of the lamp is by another clock.
MAX_SPANS_AWAY = 10.0
ORDERS = ("auto", "first", "general")


@dataclass(frozen=True)
class ChargeTableOptions:
    """Options of `labrig fit charge`, as texts of its command line.

    Attributes
    ----------
    on, off
        When the lamp was switched on and off by the table's clock, in its unit or with one such as
        `5.5 min`.
    states
        Number of states; None chooses it.
    order
        Kinetic order: `auto`, `first` or `general`.
    stimulated
        Fraction η of the carriers that find their trap filled and recombine at once, or `free`.
    intervals
        Whether every order, rate and lifetime has an interval by profile likelihood.
    """

    on: str
    off: str
    states: int | None = None
    order: str = "auto"
    stimulated: str = "1"
    intervals: bool = False

    def __post_init__(self) -> None:
        if self.order not in ORDERS:
            raise UsageError(f"--order: expected one of {', '.join(ORDERS)}, got '{self.order}'")
        _ = self.light_stimulated

    @property
    def light_stimulated(self) -> float | None:
        """η as a number; None fits it."""
        if self.stimulated == "free":
            return None
        try:
            number = float(self.stimulated)
        except ValueError:
            number = -1.0
        if not 0 <= number <= 1:
            raise UsageError(
                f"--stimulated: expected 'free' or a number from 0 to 1, got '{self.stimulated}'"
            )
        return number


def fit_charge_table(
    path: Path, options: ChargeTableOptions, layout: TableLayout | None = None
) -> tuple[ChargeFit, str]:
    """Fit a table of times and one value, from before a charge to the end of the decay.

    Parameters
    ----------
    path
        Path of the table, as `read_series` reads it.
    options
        Options of the fit.
    layout
        Answers to what the table leaves open; None finds all in the table.

    Returns
    -------
    fit : ChargeFit
        The fit.
    columns : str
        Columns of the table that were taken as times, values and σ, in words.

    Raises
    ------
    UsageError, DataError
        The table is malformed, or has more than one series or column of values.
    FitError
        The data do not allow a fit.

    Examples
    --------
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from labrig.analyse import ChargeTableOptions, fit_charge_table
    >>> from labrig.material import concentration
    >>> t_s = np.arange(0.0, 300.0, 2.0)
    >>> charged = concentration(0.0, 0.02, 0.03, np.minimum(t_s, 99.0))
    >>> light = 1e4 * concentration(charged, 0.0, 0.03, np.maximum(t_s - 99, 0.0))
    >>> counts = np.random.default_rng(1).poisson(light)
    >>> table = Path("charge.csv")
    >>> np.savetxt(table, np.transpose([t_s, counts]), header="t_s counts", comments="")
    >>> options = ChargeTableOptions(on="0", off="99", order="first", stimulated="0")
    >>> fit, columns = fit_charge_table(table, options)
    >>> columns, abs(fit.states[0].decay_time_s.value - 1 / 0.03) < 1
    ('time t_s (s, line 1); values counts; no σ', True)
    """
    parts, columns = read_described_series(path, layout or TableLayout())
    series = parts[0]
    if len(parts) > 1 or len(series.channels) > 1:
        raise UsageError(
            f"{path}: expected one series with one column of values, got {len(parts)} series of "
            f"{', '.join(series.channels)}; choose a column with --column"
        )
    on_s, off_s = (
        _lamp_s(path, option, text, series)
        for option, text in (("--on", options.on), ("--off", options.off))
    )
    sigma = series.sigma[:, 0]
    usable = series.usable
    try:
        fit = fit_charge_and_decay(
            series.t_s[usable],
            series.values[usable, 0],
            None if np.isnan(sigma).all() else sigma[usable],
            light_on_s=on_s,
            light_off_s=off_s,
            exposure_s=series.exposure_s[usable],
            states=options.states or "auto",
            order=cast(Literal["auto", "first", "general"], options.order),
            light_stimulated=options.light_stimulated,
            intervals=options.intervals,
        )
    except FitError as error:
        raise FitError(f"{path}: {error}") from None
    return replace(fit, warnings=(*series.warnings, *fit.warnings)), columns


def _lamp_s(path: Path, option: str, text: str, series: Series) -> float:
    """Return when the lamp was switched, as the times of the series count."""
    try:
        at_s = series.clock.after_zero_s(text)
    except ValueError as error:
        raise UsageError(f"{path}: {option}: {error}") from None
    first_s, last_s = float(series.t_s.min()), float(series.t_s.max())
    span_s = last_s - first_s
    if not first_s - MAX_SPANS_AWAY * span_s <= at_s <= last_s + MAX_SPANS_AWAY * span_s:
        begin, end = (series.clock.text(t_s) for t_s in (first_s, last_s))
        raise UsageError(
            f"{path}: {option}: expected a time by the table's clock, whose rows are from {begin} "
            f"to {end}, got '{text}'"
        )
    return at_s
