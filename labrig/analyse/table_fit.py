"""Fit of another program's table, as `labrig fit decay` does it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from labrig.analyse.series_fit import fit_series
from labrig.errors import FitError, UsageError
from labrig.fit import DecayFit
from labrig.quantity import FRACTION, parse
from labrig.results import (
    AUTO,
    FloatArray,
    Series,
    TableLayout,
    join_series,
    read_described_series,
    require_law,
)

#: Least counts in a Poisson weight, since fewer would weigh a point too much.
MIN_COUNTS = 5.0
#: Fits in which the weights are those of the counts that the last fit expects. Weights from the
#: counts themselves prefer the low ones: rates of dim decays came out 0.4 σ too high.
COUNT_REWEIGHTINGS = 2
#: Rise to the maximum, in σ of the scatter of neighbours and as a fraction of the maximum, from
#: which a table does not begin with its decay.
RISE_SIGMAS = 10.0
RISE_FRACTION = 0.1
#: Number of neighbours in the medians from which a rise is found.
NEIGHBOURS = 5


@dataclass(frozen=True)
class TableFitOptions:
    """Options of `labrig fit decay`, as texts of its command line.

    Attributes
    ----------
    states
        Number of states; None chooses it.
    offset
        Constant background: `zero`, `free`, or its prior standard uncertainty in the data's unit.
    flicker
        Relative scatter common to the channels of a frame: `auto`, a percentage, or a fraction.
    weights
        Uncertainties of the values: `given` in the table, or those of `counts` (Poisson).
    origin_s
        Time of lamp off in the table's seconds.
    from_s
        Time in the table's seconds from which points are fitted; None takes all.
    law
        Law that describes the decay, or `auto`.
    """

    states: int | None = None
    offset: str = "zero"
    flicker: str = "auto"
    weights: str = "given"
    origin_s: float = 0.0
    from_s: float | None = None
    law: str = AUTO

    def __post_init__(self) -> None:
        if self.weights not in ("given", "counts"):
            raise UsageError(f"--weights: expected 'given' or 'counts', got '{self.weights}'")
        require_law(self.law)

    @property
    def offset_sigma(self) -> float:
        """Prior standard uncertainty of the constant background."""
        named = {"zero": 0.0, "free": np.inf}.get(self.offset)
        return _parse_sigma(self.offset) if named is None else named

    @property
    def flicker_fraction(self) -> float | None:
        """Flicker as a fraction; None measures it."""
        return None if self.flicker == "auto" else _parse_flicker(self.flicker)


@dataclass(frozen=True, eq=False)
class FittedTable:
    """Fit of one region of a table.

    Attributes
    ----------
    region
        Name of the region; empty if the table names none.
    series
        Fitted rows, their times counted from lamp off, with the σ that the fit used.
    fit
        Fitted decay.
    columns
        Columns of the table that were taken as times, values and σ, in words.
    """

    region: str
    series: Series
    fit: DecayFit
    columns: str


def fit_table(
    path: Path,
    options: TableFitOptions | None = None,
    layout: TableLayout | None = None,
) -> list[FittedTable]:
    """Fit a sum of exponentials to every region in a table.

    Parameters
    ----------
    path
        Path of the table, as `read_series` reads it.
    options
        Options of the fit; None takes the defaults.
    layout
        Answers to what the table leaves open; None finds all in the table.

    Returns
    -------
    list of FittedTable
        Series and fit of each region in order of appearance.

    Raises
    ------
    UsageError
        An option is malformed, no point is left, or the table is malformed, has cells without a
        number, or can be read in two ways.
    DataError
        The table has no rows, or a σ that is not above zero.
    FitError
        The data do not allow a fit.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.analyse import TableFitOptions, fit_table
    >>> for table in fit_table(Path("series.csv"), TableFitOptions(states=2)):
    ...     print(table.region, [f"{rate.value:.2g} {rate.unit}" for rate in table.fit.rates])
    sample ['0.2 1/s', '0.01 1/s']
    """
    options, layout = options or TableFitOptions(), layout or TableLayout()
    fits = []
    parts, columns = read_described_series(path, layout)
    for series in _join_regions(parts):
        _require_sigma_or_one_channel(path, series, options)
        part = _from_origin(path, series, options)
        _refuse_rise(path, part, options)
        if options.weights == "counts":
            part = _with_counts_sigma(part, part.values)
        flicker = options.flicker_fraction
        # Without σ nothing tells flicker from other noise: the scatter about the fit is both.
        if np.isnan(part.sigma).all() and options.flicker == "auto":
            flicker = 0.0
        try:
            fit = fit_series(part, options.states, options.offset_sigma, flicker, law=options.law)
            for _ in range(COUNT_REWEIGHTINGS if options.weights == "counts" else 0):
                expected = part.values.copy()
                expected[part.usable] -= fit.residuals
                part = _with_counts_sigma(part, expected)
                fit = fit_series(
                    part, options.states, options.offset_sigma, flicker, law=options.law
                )
        except FitError as error:
            raise FitError(f"{path}: {error}") from None
        sigma = part.sigma.copy()
        sigma[part.usable] = fit.sigma
        fits.append(FittedTable(part.region, replace(part, sigma=sigma), fit, columns))
    return fits


def _with_counts_sigma(series: Series, counts: FloatArray) -> Series:
    """Return the series with the σ of Poisson counts (n, C)."""
    return replace(series, sigma=np.sqrt(np.maximum(counts, MIN_COUNTS)))


def _join_regions(parts: Sequence[Series]) -> list[Series]:
    """Join the repeats of each region's decay: they share rates and amplitudes."""
    regions: dict[str, list[Series]] = {}
    for part in parts:
        regions.setdefault(part.region, []).append(part)
    return [join_series(same) for same in regions.values()]


def _require_sigma_or_one_channel(path: Path, series: Series, options: TableFitOptions) -> None:
    """Refuse columns that cannot be weighed against each other."""
    unknown = np.isnan(series.sigma).all(axis=0)
    if len(series.channels) > 1 and unknown.any() and options.weights != "counts":
        columns = ", ".join(series.channels)
        raise UsageError(
            f"{path}: expected one column of values, or σ for each, got {columns}; choose one: "
            f"'--column {_quoted(series.channels[0])}'"
        )


def _quoted(name: str) -> str:
    return f'"{name}"' if " " in name else name


def _from_origin(path: Path, series: Series, options: TableFitOptions) -> Series:
    """Return the rows to fit, their times counted from lamp off."""
    first_s = -np.inf if options.from_s is None else options.from_s
    rows = np.flatnonzero(series.t_s >= first_s)
    if not len(rows):
        raise UsageError(f"{path}: no point at {first_s:g} s or later; give an earlier --from")
    part = series.take(rows)
    earliest_s = float(part.t_s.min())
    if earliest_s < options.origin_s:
        raise UsageError(
            f"{path}: expected times after the light went off at {options.origin_s:g} s, got "
            f"{earliest_s:g} s; leave the earlier rows out with '--from {options.origin_s:g}', or "
            "say when it went off with --origin"
        )
    return replace(part, t_s=part.t_s - options.origin_s)


def _refuse_rise(path: Path, series: Series, options: TableFitOptions) -> None:
    """Refuse a table that begins before its decay: with darkness, a charge, or a transient."""
    if len(series.channels) > 1 or len(set(series.unit)) > 1:
        return
    usable = series.usable
    order = np.argsort(series.t_s[usable], kind="stable")
    t_s, values = series.t_s[usable][order], series.values[usable, 0][order]
    if len(values) < 2 * NEIGHBOURS:
        return
    windows = np.lib.stride_tricks.sliding_window_view(values, NEIGHBOURS)
    smooth = np.median(windows, axis=1)
    highest = int(np.argmax(smooth))
    rise = float(smooth[highest] - smooth[: highest + 1].min())
    noise = _scatter_of_neighbours(values[: highest + NEIGHBOURS])
    falls = smooth[highest] - smooth[-1] > RISE_FRACTION * rise
    if falls and rise > max(RISE_SIGMAS * noise, RISE_FRACTION * float(smooth[highest])):
        peak = highest + int(np.argmax(values[highest : highest + NEIGHBOURS]))
        start_s = t_s[peak] + options.origin_s
        raise FitError(
            f"{path}: expected a signal that decays, got one that rises until {start_s:g} s; fit "
            f"what follows with '--from {start_s:g}', and say with --origin when the light went off"
        )


def _scatter_of_neighbours(values: FloatArray) -> float:
    """Return the standard deviation of values about a smooth course, outliers apart."""
    second = values[2:] - 2 * values[1:-1] + values[:-2]
    return float(1.4826 * np.median(np.abs(second)) / np.sqrt(6))


def _parse_sigma(text: str) -> float:
    try:
        sigma = float(text)
    except ValueError:
        sigma = -1.0
    if not sigma >= 0:
        raise UsageError(
            f"--offset: expected 'zero', 'free' or the σ of a background in the data's unit, got "
            f"'{text}'"
        )
    return sigma


def _parse_flicker(text: str) -> float:
    try:
        return parse(text, FRACTION) if "%" in text else float(text)
    except ValueError:
        raise UsageError(
            f"--flicker: expected 'auto', a percentage such as '0.7 %' or 0, got '{text}'"
        ) from None
