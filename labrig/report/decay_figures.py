"""Charts of a decay: signals, residuals, noise and timing."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.number_format import power_of_ten, rounded
from labrig.report.chart import (
    NO_VALUES,
    Axis,
    Band,
    Chart,
    ErrorBars,
    Line,
    Margins,
    Mark,
    Panel,
    Points,
    linear_axis,
    logarithmic_axis,
)
from labrig.report.figure_style import (
    BAND_OPACITY,
    CARET_DOWN,
    DASH_DOTTED,
    DASHED,
    DOTTED,
    INK,
    LONG_DASHED,
    MARKERS,
    MUTED,
    OTHER_CHANNELS,
    PAPER,
    SOLID,
    LineStyle,
    channel_colour,
)
from labrig.report.report_model import PatchReport
from labrig.report.timing import FrameTiming
from labrig.results import EXPONENTIALS, FittedDecay, NoiseBudget, Series

#: Number of points of a fitted curve.
POINTS = 160


@dataclass(frozen=True, eq=False)
class Curve:
    """Fitted decay at m times, for C channels and n states.

    Attributes
    ----------
    t_s
        Middles of exposures in seconds after lamp off, shape (m,).
    total
        Mean signal of the fit over these exposures in DN/s, shape (m, C).
    sigma
        Standard uncertainty of `total` in the brightest channel in DN/s, shape (m,); the covariance
        of a fit does not cover the other channels. Infinite where a parameter is not determined.
    states
        Signal of each state in the brightest channel without the offset in DN/s, shape (m, n);
        (m, 0) if another law describes the decay.
    brightest
        Index of the brightest channel.
    """

    t_s: FloatArray
    total: FloatArray
    sigma: FloatArray
    states: FloatArray
    brightest: int


def exposure_middles_s(series: Series) -> FloatArray:
    """Return the middle of each exposure, where figures draw its value.

    Parameters
    ----------
    series
        Signals of n frames with the start and the length of their exposures.

    Returns
    -------
    numpy.ndarray
        Middles of the exposures in seconds after lamp off, shape (n,).

    Examples
    --------
    >>> import labrig
    >>> from labrig.report import exposure_middles_s
    >>> (series,) = labrig.read_series("series.csv")
    >>> [f"{t_s:.2f}" for t_s in exposure_middles_s(series)[:4]]
    ['1.31', '6.31', '11.31', '16.31']
    """
    return series.t_s + series.exposure_s / 2


def fitted_curve(series: Series, fit: FittedDecay) -> Curve:
    """Evaluate a fit over the times of a series, with exposures interpolated between its frames."""
    order = np.argsort(series.t_s, kind="stable")
    frame_t_s, frame_exposure_s = series.t_s[order], series.exposure_s[order]
    t_s = np.linspace(frame_t_s[0], frame_t_s[-1], POINTS)
    exposure_s = np.interp(t_s, frame_t_s, frame_exposure_s)
    middle_s = t_s + exposure_s / 2
    states = [state.amplitude * np.exp(-state.k_r_per_s * middle_s) for state in fit.states]
    is_exponential = fit.law == EXPONENTIALS
    _, variance = fit.signal(t_s, exposure_s, with_offset=True)
    return Curve(
        t_s=middle_s,
        total=fit.predict(t_s, exposure_s),
        sigma=np.sqrt(variance),
        states=np.stack(states, axis=1) if is_exponential else np.empty((POINTS, 0)),
        brightest=fit.brightest,
    )


TIME_LABEL = "Time after lamp off / s"
HEIGHT_PT = 256.0
#: Lower end of a logarithmic axis as a fraction of the noise at the end of the decay.
FRACTION_OF_NOISE = 0.5
#: Largest number of decades of a logarithmic axis.
MAX_DECADES = 6.0
#: Range of the highest value within which an axis needs no power of ten, in DN/s.
PLAIN_FROM, PLAIN_TO = 0.02, 1e5
#: Values excluded from the fit are shown up to this many times the highest fitted value.
LEFT_OUT_SHOWN = 3.0
#: Entry of the legend for frames that are left out of the fit.
LEFT_OUT: tuple[str, Mark] = ("left out", Points(MUTED, face=PAPER, size_pt=5.0))


def linear_decay(series: Series, fit: FittedDecay | None) -> Chart:
    """Return the signal over time."""
    highest, lowest = max(_highest(series), 0.0), min(float(_usable_values(series).min()), 0.0)
    room = 0.06 * (highest - lowest) or 1.0
    exponent = _common_exponent(highest)
    unit = 10.0**exponent
    axis = linear_axis(
        _signal_label(f"{power_of_ten(exponent) if exponent else ''} {series.value_unit}".strip()),
        lowest - (room if lowest < 0 else 0.0),
        highest + room,
        text=lambda value: rounded(value / unit),
    )
    return _decay(axis, series, fit)


def logarithmic_decay(series: Series, fit: FittedDecay | None) -> Chart:
    """Return the signal over time on a logarithmic axis; values below it are marked at its foot."""
    low, high = log_axis_ends(series)
    axis = logarithmic_axis(_signal_label(series.value_unit), low, high)
    t_s = exposure_middles_s(series)
    carets = []
    for number, name in enumerate(series.channels):
        below_s = t_s[series.values[:, number] < low]
        if len(below_s):
            colour, foot = channel_colour(name, number), np.full(len(below_s), low)
            carets.append(Points(colour, below_s, foot, CARET_DOWN, size_pt=5.0, is_clipped=False))
    return _decay(axis, series, fit, carets)


def values_below_axis(series: Series) -> int:
    """Return the number of values below the logarithmic axis."""
    return int(np.count_nonzero(series.values < log_axis_ends(series)[0]))


def log_axis_ends(series: Series) -> tuple[float, float]:
    """Return the lower and upper end of the logarithmic axis of a series, in DN/s."""
    highest = _highest(series)
    if highest <= 0:
        return 0.1, 10.0
    positive = float(series.values[series.values > 0].min())
    late = np.argsort(series.t_s, kind="stable")[-max(1, len(series.t_s) // 4) :]
    noise = series.sigma[late][np.isfinite(series.sigma[late])]
    floor = FRACTION_OF_NOISE * float(np.median(noise)) if noise.size else 0.0
    low = max(positive * 0.7, floor, highest * 10.0**-MAX_DECADES)
    return min(low, highest / 10), highest * 1.6


def _signal_label(unit: str) -> str:
    """Return the label of an axis of signals, whose unit may not be known."""
    if not unit:
        return "Signal"
    return f"Signal / ({unit})" if "/" in unit or " " in unit else f"Signal / {unit}"


def _common_exponent(highest: float) -> int:
    """Return the power of ten in the unit of an axis, so that its tick labels are short."""
    if PLAIN_FROM <= highest < PLAIN_TO or highest <= 0:
        return 0
    return 3 * math.floor(math.log10(highest) / 3)


def _usable_values(series: Series) -> FloatArray:
    """Return the values of usable frames, shape (m, C); all values if no frame is usable."""
    return series.values[series.usable] if series.usable.any() else series.values


def _highest(series: Series) -> float:
    """Return the highest value on an axis; excluded values count up to 3 times the usable ones."""
    highest_usable = float(_usable_values(series).max())
    return (
        min(float(series.values.max()), LEFT_OUT_SHOWN * highest_usable)
        if highest_usable > 0
        else highest_usable
    )


def _decay(axis: Axis, series: Series, fit: FittedDecay | None, more: Sequence[Mark] = ()) -> Chart:
    """Return the signals with ± 1 σ over time, and the fit with its band and its states."""
    channels = channel_styles(series)
    t_s, usable = exposure_middles_s(series), series.usable
    marks: list[Mark] = [
        ErrorBars(colour, t_s, series.values[:, number], np.nan_to_num(series.sigma[:, number]))
        for number, (_, _, colour) in enumerate(channels)
    ]
    legend: list[tuple[str, Mark]] = [
        (name, Points(colour, marker=marker, size_pt=5.0)) for name, marker, colour in channels
    ]
    if fit is not None:
        curve = fitted_curve(series, fit)
        marks += [
            Line(colour, curve.t_s, curve.total[:, number])
            for number, (_, _, colour) in enumerate(channels)
        ]
        brightest, _, colour = channels[fit.brightest]
        if np.isfinite(curve.sigma).all():
            middle = curve.total[:, fit.brightest]
            marks.insert(0, Band(colour, curve.t_s, middle - curve.sigma, middle + curve.sigma))
        legend += [("fit", Line(MUTED)), ("± 1 σ", Band(colour))]
        if curve.states.shape[1] > 1:
            marks += [
                Line(INK, curve.t_s, state, width_pt=0.9, style=DASHED) for state in curve.states.T
            ]
            legend.append((f"each state, {brightest}", Line(INK, width_pt=0.9, style=DASHED)))
    for number in range(len(channels)):
        marks += channel_points(series, number, series.values[:, number])
    if not usable.all():
        legend.append(LEFT_OUT)
    panel = Panel(time_axis(t_s, fit), axis, (*marks, *more))
    return Chart((panel,), HEIGHT_PT, legend=tuple(legend))


def time_label(fit: FittedDecay) -> str:
    """Return the label of an axis of the times that a fit counts."""
    return f"Time after {fit.reference.name} / s"


def channel_styles(series: Series) -> list[tuple[str, str, str]]:
    """Return name, marker and colour of every channel."""
    return [
        (name, MARKERS[number % len(MARKERS)], channel_colour(name, number))
        for number, name in enumerate(series.channels)
    ]


def channel_points(
    series: Series, number: int, values: FloatArray, size_pt: float = 3.8
) -> list[Mark]:
    """Return a value of each frame in a channel as points, hollow if the frame is left out."""
    _, marker, colour = channel_styles(series)[number]
    t_s, usable = exposure_middles_s(series), series.usable
    return [
        Points(colour, t_s[rows], values[rows], marker, face, size_pt)
        for rows, face in ((usable, colour), (~usable, PAPER))
        if rows.any()
    ]


def time_axis(t_s: FloatArray, fit: FittedDecay | None = None) -> Axis:
    """Return the axis that shows all of some times, after lamp off or what a fit counts from."""
    last = float(t_s.max())
    label = TIME_LABEL if fit is None else time_label(fit)
    return linear_axis(label, -0.02 * last if last else -1.0, 1.03 * last or 1.0)


NOISE_HEIGHT_PT = 268.0
#: Parts of the noise that are nowhere above this fraction of the total σ are not drawn.
MIN_FRACTION = 0.03
_LINES: dict[str, tuple[str, LineStyle]] = {
    "photon noise": (OTHER_CHANNELS[1], SOLID),
    "read noise": (OTHER_CHANNELS[2], DASHED),
    "uneven light": (OTHER_CHANNELS[3], DASH_DOTTED),
    "flicker": (OTHER_CHANNELS[0], DOTTED),
    "dark level": (MUTED, LONG_DASHED),
}
#: Upper end of the axis of relative σ in per cent.
MAX_PERCENT = 300.0


def visible_parts(budget: NoiseBudget) -> dict[str, FloatArray]:
    """Return the parts of the noise that contribute noticeably to the total σ, by name.

    Each is a standard uncertainty relative to the fitted signal, shape (n,).
    """
    parts = {
        "photon noise": budget.photon,
        "read noise": budget.read,
        "uneven light": budget.uneven,
        "flicker": budget.flicker,
        "dark level": budget.dark_level,
    }
    threshold = MIN_FRACTION * budget.total
    return {name: part for name, part in parts.items() if (part > threshold).any()}


def noise_figure(budget: NoiseBudget) -> Chart:
    """Return the relative standard uncertainty of the brightest channel, and its components."""
    total = 100 * budget.total
    # Broad and pale, since the largest part is nearly as large.
    together = Line(INK, budget.t_s, total, width_pt=4.5, opacity=BAND_OPACITY)
    legend: list[tuple[str, Mark]] = [("together", together)]
    drawn_parts = [total]
    for name, part in visible_parts(budget).items():
        percent, (colour, style) = 100 * part, _LINES[name]
        legend.append((name, Line(colour, budget.t_s, percent, style=style)))
        drawn_parts.append(percent[percent > MIN_FRACTION * total])
    low, high = min(part.min() for part in drawn_parts), max(part.max() for part in drawn_parts)
    top = 1.3 * max(min(high, MAX_PERCENT), total.min())
    panel = Panel(
        time_axis(budget.t_s),
        logarithmic_axis("σ of a value / % of the signal", 0.8 * low, top),
        tuple(line for _, line in legend),
        Margins(top=46.0),
    )
    return Chart((panel,), NOISE_HEIGHT_PT, legend=tuple(legend), columns=3)


SMALL_WIDTH_PT, SMALL_HEIGHT_PT = 190.0, 140.0
SMALL_FONT_PT = 9.5
TILE_WIDTH_PT, TILE_HEIGHT_PT = 100.0, 64.0
TIMING_HEIGHT_PT = 200.0


def overview_figures(patches: Sequence[PatchReport]) -> list[Chart]:
    """Return a small logarithmic decay of each patch, all on the same axes."""
    time, signal = _overview_axes(patches)
    margins = Margins(left=50.0, bottom=32.0, right=14.0, top=6.0)
    return [
        Chart(
            (Panel(time, signal, _small_decay(patch), margins),),
            SMALL_HEIGHT_PT,
            SMALL_WIDTH_PT,
            label_pt=SMALL_FONT_PT,
        )
        for patch in patches
    ]


def overview_tiles(patches: Sequence[PatchReport]) -> tuple[list[Chart], str]:
    """Return a tiny logarithmic decay of each patch, and their common axes in words."""
    time, signal = _overview_axes(patches)
    bare_time, bare_signal = (replace(axis, label="", short_ticks=()) for axis in (time, signal))
    margins = Margins(left=1.0, bottom=1.0, right=1.0, top=1.0)
    times, signals = (
        f"{axis.ticks[0][1]} to {axis.ticks[-1][1]} {unit}".strip()
        for axis, unit in ((time, "s"), (signal, patches[0].series.value_unit))
    )
    tiles = [
        Chart(
            (Panel(bare_time, bare_signal, _small_decay(patch), margins),),
            TILE_HEIGHT_PT,
            TILE_WIDTH_PT,
        )
        for patch in patches
    ]
    return tiles, f"grid lines from {times} and from {signals}"


def _overview_axes(patches: Sequence[PatchReport]) -> tuple[Axis, Axis]:
    """Return the axes of time and signal that show all decays."""
    ends = [log_axis_ends(patch.series) for patch in patches]
    low, high = min(end[0] for end in ends), max(end[1] for end in ends)
    last_s = max(float(exposure_middles_s(patch.series).max()) for patch in patches) or 1.0
    return (
        linear_axis("Time / s", -0.03 * last_s, 1.03 * last_s, most=4),
        logarithmic_axis(patches[0].series.value_unit, low, high, most=6),
    )


def _small_decay(patch: PatchReport) -> tuple[Mark, ...]:
    """Return the marks of a small decay, its points without error bars."""
    series = patch.series
    t_s, usable = exposure_middles_s(series), series.usable
    channels = channel_styles(series)
    marks: list[Mark] = [
        Points(colour, t_s[usable], series.values[usable, number], marker, size_pt=1.3)
        for number, (_, marker, colour) in enumerate(channels)
    ]
    if isinstance(patch.fit, FittedDecay):
        curve = fitted_curve(series, patch.fit)
        marks += [
            Line(colour, curve.t_s, curve.total[:, number], width_pt=0.9)
            for number, (_, _, colour) in enumerate(channels)
        ]
    return tuple(marks)


def timing_figure(timings: Sequence[FrameTiming]) -> Chart:
    """Return the lateness of each exposure in ms, in one colour a unit."""
    units = list(dict.fromkeys(timing.unit for timing in timings))
    several = 1 < len(units) <= len(MARKERS)
    t_s = np.array([timing.t_s for timing in timings])
    late_ms = np.array([1e3 * timing.late_s for timing in timings])
    last = float(t_s.max())
    reach = max(float(np.abs(late_ms).max()), 0.1)
    time = linear_axis(TIME_LABEL, min(float(t_s.min()), -0.02 * last), 1.03 * last or 1.0)
    late = linear_axis(
        "Late by / ms", min(float(late_ms.min()) * 1.15, -0.08 * reach), 1.15 * reach, most=6
    )
    ends = np.array([time.low, time.high])
    points = {}
    for number, unit in enumerate(units):
        rows = np.array([timing.unit == unit for timing in timings])
        colour = INK if number == 0 else OTHER_CHANNELS[number % len(OTHER_CHANNELS)]
        marker = MARKERS[number % len(MARKERS)]
        points[unit] = Points(colour, t_s[rows], late_ms[rows], marker, size_pt=3.6)
    panel = Panel(
        time,
        late,
        (Line(MUTED, ends, np.zeros(2), width_pt=0.8), *points.values()),
        Margins(top=46.0 if several else 14.0),
    )
    legend = tuple((unit, replace(mark, x=NO_VALUES, y=NO_VALUES)) for unit, mark in points.items())
    return Chart((panel,), TIMING_HEIGHT_PT, legend=legend if several else (), columns=4)
