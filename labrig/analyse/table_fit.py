"""Fit of another program's table, as `labrig fit decay` does it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from labrig.analyse.series_fit import fit_series
from labrig.analyse.table_checks import (
    COUNTS,
    LowStart,
    VarianceOfValue,
    low_start,
    variance_of_values,
)
from labrig.fit import DecayFit
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError, UsageError
from labrig.foundation.notebook_views import NotebookViews
from labrig.foundation.quantity import FRACTION, parse
from labrig.foundation.result_warning import Disturbance, ResultWarning
from labrig.results import (
    AUTO,
    Series,
    TableLayout,
    add_flag,
    join_series,
    read_described_series,
    require_law,
)

#: Fits in which σ that follows from the values is that of the values that the last fit expects.
REWEIGHTINGS = 2
#: Part of the span of the rows within which times are the same.
ROUNDING_SPANS = 1e-9
#: How values are weighed, the last one by one σ for all.
WEIGHTS = ("given", "counts", "equal")
EQUAL = WEIGHTS[-1]
#: Flag of values at a detector's ceiling.
CLIPPED = "clipped"
#: Rise to the maximum, in σ of the scatter of neighbours and as a fraction of the maximum, from
#: which a table does not begin with its decay.
RISE_SIGMAS = 8.0
RISE_FRACTION = 0.1
#: Number of neighbours in the medians from which a rise is found, and of first values that tell
#: their noise: fewer may agree by chance, and a noisy first value would be a rise.
NEIGHBOURS = 5
TELL_NOISE = 30


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
        Uncertainties of the values: `given` in the table, those of `counts` (Poisson), or `equal`
        for all, that of the residuals.
    origin
        Time of lamp off by the table's clock, in its unit or with one such as `5.5 min`; None if it
        is not known or at 0.
    start
        Time from which points are fitted, as `origin`; None takes all.
    law
        Law that describes the decay, or `auto`.
    intervals
        Whether every rate, and every parameter of the law, has an interval by profile likelihood.
    """

    states: int | None = None
    offset: str = "zero"
    flicker: str = "auto"
    weights: str = "given"
    origin: str | None = None
    start: str | None = None
    law: str = AUTO
    intervals: bool = False

    def __post_init__(self) -> None:
        if self.weights not in WEIGHTS:
            raise UsageError(
                f"--weights: expected 'given', 'counts' or 'equal', got '{self.weights}'"
            )
        if self.weights == EQUAL and self.flicker not in ("auto", "0"):
            raise UsageError(
                f"--flicker: expected none beside '--weights equal', got '{self.flicker}'; the "
                "scatter of the residuals is all noise together"
            )
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
class FittedTable(NotebookViews):
    """Fit of one region of a table.

    Attributes
    ----------
    region
        Name of the region; empty if the table names none.
    series
        Fitted rows with the σ that the fit used, their times counted from lamp off, or from the
        first row if amplitudes are those there.
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
        _refuse_rise(path, part)
        try:
            part, fit = _fitted(part, options)
        except FitError as error:
            raise FitError(f"{path}: {error}") from None
        part, fit = _from_reference(part, fit)
        fits.append(FittedTable(part.region, part, fit, columns))
    return fits


def _fitted(series: Series, options: TableFitOptions) -> tuple[Series, DecayFit]:
    """Return the series with the σ that its fit used, and the fit."""
    variances = _variances(series, options)
    series = _with_sigma(series, _smooth(series), variances)
    fitting = partial(_fit, options=options)
    low = low_start(series, fitting)
    if low is not None and low.is_ceiling:
        series = _flagged(series, low.number)
    fit = fitting(series)
    for _ in range(REWEIGHTINGS if any(variances) else 0):
        expected = series.values.copy()
        expected[series.usable] -= fit.residuals
        series = _with_sigma(series, expected, variances)
        fit = fitting(series)
    sigma = series.sigma.copy()
    sigma[series.usable] = fit.sigma
    fit = replace(
        fit,
        sigma_origin=_origin(fit, variances, options),
        warnings=(*_low_warnings(series, low), *fit.warnings),
    )
    return replace(series, sigma=sigma), fit


def _fit(series: Series, options: TableFitOptions) -> DecayFit:
    flicker = options.flicker_fraction
    # Without σ nothing tells flicker from other noise: the scatter about the fit is both.
    if np.isnan(series.sigma).all() and options.flicker == "auto":
        flicker = 0.0
    return fit_series(
        series,
        options.states,
        options.offset_sigma,
        flicker,
        law=options.law,
        equal_weights=options.weights == EQUAL,
        intervals=options.intervals,
    )


def _variances(series: Series, options: TableFitOptions) -> list[VarianceOfValue | None]:
    """Return how the σ of each channel follow from its values, where they do."""
    if options.weights == EQUAL:
        return [None] * len(series.channels)
    if options.weights == "counts":
        return [COUNTS] * len(series.channels)
    usable = series.usable
    return [
        variance_of_values(values, sigma)
        for values, sigma in zip(series.values[usable].T, series.sigma[usable].T, strict=True)
    ]


def _with_sigma(
    series: Series, expected: FloatArray, variances: Sequence[VarianceOfValue | None]
) -> Series:
    """Return the series with the σ of the expected values (n, C), in the channels that have one."""
    sigma = series.sigma.copy()
    for channel, variance in enumerate(variances):
        if variance is not None:
            sigma[:, channel] = variance.sigma(expected[:, channel])
    return replace(series, sigma=sigma)


def _smooth(series: Series) -> FloatArray:
    """Return the median of each value and its neighbours in time (n, C)."""
    order = np.argsort(series.t_s, kind="stable")
    smooth = np.empty_like(series.values)
    smooth[order] = median_filter(series.values[order], (NEIGHBOURS, 1), mode="nearest")
    return smooth


def _origin(
    fit: DecayFit, variances: Sequence[VarianceOfValue | None], options: TableFitOptions
) -> str:
    """Return where the σ of the values came from, in words; empty if from their scatter."""
    if fit.scatter is not None:
        return ""
    parts = ["counting" if options.weights == "counts" else "the table"]
    formulas = list(dict.fromkeys(str(variance) for variance in variances if variance is not None))
    if formulas:
        parts.append(f"{', '.join(formulas)} of the fitted curve, not of the values")
    if fit.sigma_factor != 1:
        parts.append(f"times {fit.sigma_factor:.3g}, by which the values scatter more")
    return ", ".join(parts)


def _flagged(series: Series, number: int) -> Series:
    """Return the series with its first usable values by time flagged as clipped."""
    rows = _first_rows(series, number)
    flags = [
        add_flag(flag, CLIPPED) if row in rows else flag for row, flag in enumerate(series.flag)
    ]
    return replace(series, flag=tuple(flags))


def _first_rows(series: Series, number: int) -> NDArray[np.intp]:
    rows = np.flatnonzero(series.usable)
    return rows[np.argsort(series.t_s[rows], kind="stable")][:number]


def _low_warnings(series: Series, low: LowStart | None) -> list[ResultWarning]:
    """Return a warning about first values that lie below the law of the others."""
    if low is None:
        return []
    if low.is_ceiling:
        clipped = [row for row, flag in enumerate(series.flag) if CLIPPED in flag]
        rows = sorted(clipped, key=lambda row: series.t_s[row])[: low.number]
        return [
            Disturbance(
                "detector-clipped",
                "the first {values} values, until {until_s:.12g} s, are equal, {level:.6g}, and "
                "lie below the law of the others: the detector was saturated, and they were left "
                "out; measure them with less light or gain",
                values=low.number,
                until_s=_clock_s(series, max(series.t_s[rows])),
                level=series.values[rows[0], 0],
            )
        ]
    first = _first_rows(series, low.number + 1)
    last_s, next_s = series.t_s[first[-2:]]
    return [
        Disturbance(
            "first-values-low",
            "the first {values} value(s), until {until_s:.12g} s, lie below the law of the others, "
            "by {sigmas:.0f} σ: was the detector saturated, or the lamp not off yet? Leave out the "
            "wrong ones with '--from {next_time}'",
            values=low.number,
            until_s=_clock_s(series, last_s),
            sigmas=low.sigmas,
            next_time=series.clock.text(next_s),
        )
    ]


def _join_regions(parts: Sequence[Series]) -> list[Series]:
    """Join the repeats of each region's decay: they share rates and amplitudes."""
    regions: dict[str, list[Series]] = {}
    for part in parts:
        regions.setdefault(part.region, []).append(part)
    return [join_series(same) for same in regions.values()]


def _require_sigma_or_one_channel(path: Path, series: Series, options: TableFitOptions) -> None:
    """Refuse columns that cannot be weighed against each other."""
    unknown = np.isnan(series.sigma).all(axis=0)
    weighed = not unknown.any() or options.weights == "counts"
    if len(series.channels) > 1 and (options.weights == EQUAL or not weighed):
        columns = ", ".join(series.channels)
        raise UsageError(
            f"{path}: expected one column of values, or σ for each, got {columns}; choose one: "
            f"'--column {_quoted(series.channels[0])}'"
        )


def _quoted(name: str) -> str:
    return f'"{name}"' if " " in name else name


def _from_origin(path: Path, series: Series, options: TableFitOptions) -> Series:
    """Return the rows to fit, their times counted from lamp off where that is known."""
    clock = series.clock
    # Where numbers are rounded, the row at which a user begins is still the first.
    rounding_s = ROUNDING_SPANS * float(np.ptp(series.t_s))
    if options.start is not None:
        first_s = _time(path, "--from", options.start, series)
        rows = np.flatnonzero(series.t_s >= first_s - rounding_s)
        if not len(rows):
            last = clock.text(float(series.t_s.max()))
            raise UsageError(
                f"{path}: no point at {options.start} or later, the last is at {last}; give an "
                "earlier --from"
            )
        series = series.take(rows)
    if options.origin is not None:
        origin_s = _time(path, "--origin", options.origin, series)
        after_s = series.t_s - origin_s
        clock = clock.from_lamp_off(clock.seconds(options.origin))
        is_rounded = (-rounding_s <= after_s) & (after_s < 0)
        series = replace(series, t_s=np.where(is_rounded, 0.0, after_s), clock=clock)
    earliest_s, latest_s = float(series.t_s.min()), float(series.t_s.max())
    # A clock whose zero is after all rows tells nothing of lamp off.
    if earliest_s < 0 and (options.origin is not None or latest_s >= 0):
        raise UsageError(
            f"{path}: expected times after the light went off at {clock.text(0.0)}, got "
            f"{clock.text(earliest_s)}; leave the earlier rows out with '--from "
            f"{clock.text(0.0)}', or say when it went off with --origin"
        )
    return series


def _from_reference(series: Series, fit: DecayFit) -> tuple[Series, DecayFit]:
    """Return series and fit with times from lamp off, or from the first row if amplitudes are."""
    reference = fit.reference
    if reference.is_lamp_off or reference.t_s == 0:
        return series, fit
    first_s = series.clock.zero_s + Decimal(repr(reference.t_s))
    return (
        replace(
            series,
            t_s=series.t_s - reference.t_s,
            clock=replace(series.clock, zero_s=first_s, is_lamp_off=False),
        ),
        replace(
            fit,
            measured_until_s=fit.measured_until_s - reference.t_s,
            reference=replace(reference, t_s=0.0),
        ),
    )


def _time(path: Path, option: str, text: str, series: Series) -> float:
    """Return a time by the table's clock as those of the series count."""
    try:
        return series.clock.after_zero_s(text)
    except ValueError as error:
        raise UsageError(f"{path}: {option}: {error}") from None


def _refuse_rise(path: Path, series: Series) -> None:
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
    noise = _scatter_of_neighbours(values[: max(highest + NEIGHBOURS, TELL_NOISE)])
    falls = smooth[highest] - smooth[-1] > RISE_FRACTION * rise
    if falls and rise > max(RISE_SIGMAS * noise, RISE_FRACTION * float(smooth[highest])):
        peak = highest + int(np.argmax(values[highest : highest + NEIGHBOURS]))
        start, until_s = series.clock.text(t_s[peak]), _clock_s(series, t_s[peak])
        raise FitError(
            f"{path}: expected a signal that decays, got one that rises until {until_s:.12g} s; "
            f"fit the later rows with '--from {start}', and state with --origin when the light "
            "went off"
        )


def _clock_s(series: Series, t_s: float) -> float:
    """Return a time by the table's clock in seconds."""
    return float(series.clock.zero_s) + t_s


def _scatter_of_neighbours(values: FloatArray) -> float:
    """Return the standard deviation of values about a smooth course, outliers apart."""
    second = values[2:] - 2 * values[1:-1] + values[:-2]
    typical = 1.4826 * np.median(np.abs(second))
    # Few counts are equal more often than not.
    return float((typical or np.sqrt(np.mean(second**2))) / np.sqrt(6))


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
