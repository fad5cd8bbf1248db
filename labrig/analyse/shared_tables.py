"""Fit of several tables with shared rates, as `labrig fit decay --share rates` does it."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from labrig.analyse.series_fit import by_clock
from labrig.analyse.table_fit import EQUAL, FittedTable, TableFitOptions, fit_table
from labrig.fit import DecayTable, fit_shared_rates
from labrig.foundation.errors import FitError, UsageError
from labrig.results import AUTO, EXPONENTIALS, SharedDecay, TableLayout


def fit_shared_tables(
    paths: Sequence[Path], options: TableFitOptions, layout: TableLayout | None = None
) -> tuple[SharedDecay, list[FittedTable]]:
    """Fit several tables with the same rates, each with its own amplitudes and offset.

    Each table is fitted by itself first, which finds the σ of its values and what is wrong with it.

    Parameters
    ----------
    paths
        Paths of two tables or more, whose units may differ.
    options
        Options of the fit, for all tables.
    layout
        Answers to what the tables leave open; None finds all in them.

    Returns
    -------
    shared : SharedDecay
        Rates, amplitudes and offsets with one covariance.
    tables : list of FittedTable
        Each table with the σ that the fit used, and its own fit.

    Raises
    ------
    UsageError, DataError, FitError
        Those of `fit_table`; there are fewer than two tables, or an option is none of sums of
        exponentials.

    Examples
    --------
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from labrig.analyse import TableFitOptions, fit_shared_tables
    >>> t_s, rng = np.linspace(0, 50, 60), np.random.default_rng(1)
    >>> for name, level in (("dim", 100), ("bright", 400)):
    ...     values = level * np.exp(-0.1 * t_s) + rng.standard_normal(60)
    ...     table = np.transpose([t_s, values])
    ...     np.savetxt(f"{name}.csv", table, delimiter=",", header="t_s,y", comments="")
    >>> paths = [Path("dim.csv"), Path("bright.csv")]
    >>> shared, tables = fit_shared_tables(paths, TableFitOptions(weights="equal"))
    >>> len(shared.rates), abs(shared.rates[0].value - 0.1) < 4 * shared.rates[0].sigma
    (1, True)
    """
    if len(paths) < 2:
        raise UsageError(
            f"--share: expected two tables or more, got {len(paths)}; leave it out to fit one"
        )
    if options.law not in (AUTO, EXPONENTIALS):
        raise UsageError(
            f"--law: expected exponentials beside '--share rates', got '{options.law}'; other laws "
            "have a rate that belongs to the charge: fit table by table"
        )
    tables = [_only(path, fit_table(path, options, layout)) for path in paths]
    parts = [_part(name, table, options) for name, table in zip(_names(paths), tables, strict=True)]
    try:
        shared = fit_shared_rates(parts, options.states, equal_weights=options.weights == EQUAL)
    except FitError as error:
        raise FitError(f"{', '.join(map(str, paths))}: {error}") from None
    decays = tuple(
        replace(decay, reference=by_clock(decay.reference, table.series.clock))
        for decay, table in zip(shared.tables, tables, strict=True)
    )
    of_rows = (
        warning.about(name)
        for name, table in zip(_names(paths), tables, strict=True)
        for warning in table.series.warnings
    )
    return replace(shared, tables=decays, warnings=(*of_rows, *shared.warnings)), tables


def _only(path: Path, fitted: Sequence[FittedTable]) -> FittedTable:
    """Return the fit of a table with one series of one column."""
    (table, *others) = fitted
    if others or len(table.series.channels) > 1 or len(set(table.series.unit)) > 1:
        raise UsageError(
            f"{path}: expected one decay with one column of values to share its rates, got "
            f"{len(fitted)} region(s) of {', '.join(table.series.channels)}; choose a column with "
            "--column, and one region and charge a table"
        )
    return table


def _names(paths: Sequence[Path]) -> list[str]:
    """Return the names of the tables, with their folders where they are alike."""
    names = [path.stem for path in paths]
    if len(set(names)) == len(names):
        return names
    return [f"{number} {path.name}" for number, path in enumerate(paths, start=1)]


def _part(name: str, table: FittedTable, options: TableFitOptions) -> DecayTable:
    """Return the usable rows of a table, flicker in their σ."""
    series, fit = table.series, table.fit
    rows = np.flatnonzero(series.usable)
    signal = fit.predict(series.t_s[rows], series.exposure_s[rows])[:, 0] - fit.offset
    sigma = np.hypot(series.sigma[rows, 0], fit.flicker * signal)
    return DecayTable(
        name,
        series.t_s[rows],
        series.exposure_s[rows],
        series.values[rows, 0],
        sigma,
        options.offset_sigma,
    )
