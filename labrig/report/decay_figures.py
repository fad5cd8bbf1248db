"""Figures of a decay: signals, residuals, noise and timing."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator

from labrig.fit.decay import exponential_means_and_slopes
from labrig.number_format import power_of_ten, rounded
from labrig.report.figure_style import (
    BAND_OPACITY,
    DASH_DOTTED,
    DASHED,
    DOTTED,
    INK,
    LEFT_PT,
    LONG_DASHED,
    MARKERS,
    MUTED,
    OTHER_CHANNELS,
    PAPER,
    SHADE,
    LineStyle,
    band_entry,
    channel_colour,
    error_bars,
    legend_above,
    line_entry,
    mark_decades,
    marker_entry,
    new_figure,
    place,
    points,
)
from labrig.report.report_model import PatchReport
from labrig.report.timing import FrameTiming
from labrig.results import FittedDecay, FloatArray, NoiseBudget, Series

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
        Signal of each state in the brightest channel without the offset in DN/s, shape (m, n).
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
        Signals of n frames with the begin and the length of their exposures.

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
    return Curve(
        t_s=middle_s,
        total=fit.predict(t_s, exposure_s),
        sigma=_sigma(fit, t_s, exposure_s),
        states=np.stack(states, axis=1),
        brightest=fit.brightest,
    )


def _sigma(fit: FittedDecay, t_s: FloatArray, exposure_s: FloatArray) -> FloatArray:
    """Return σ = √(J Cov Jᵀ), shape (m,), with J the derivatives by k₁, a₁, k₂, a₂, …, offset."""
    if not np.isfinite(fit.covariance).all():
        return np.full_like(t_s, np.inf)
    rates = np.array([state.k_r_per_s for state in fit.states])
    amplitudes = np.array([state.amplitude for state in fit.states])
    means, slopes = exponential_means_and_slopes(rates, t_s, exposure_s)
    jacobian = np.ones((len(t_s), len(fit.covariance)))
    jacobian[:, 0:-1:2] = amplitudes * slopes / rates
    jacobian[:, 1:-1:2] = means
    variance = np.einsum("mp,pq,mq->m", jacobian, fit.covariance, jacobian)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


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


def linear_decay(series: Series, fit: FittedDecay | None) -> Figure:
    """Draw the signal over time."""
    figure, axes = _axes(series.value_unit)
    _draw(axes, series, fit)
    highest, lowest = max(_highest(series), 0.0), min(float(_usable_values(series).min()), 0.0)
    room = 0.06 * (highest - lowest) or 1.0
    axes.set_ylim(lowest - (room if lowest < 0 else 0.0), highest + room)
    exponent = _common_exponent(highest)
    unit = 10.0**exponent
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: rounded(value / unit)))
    if exponent:
        axes.set_ylabel(_signal_label(f"{power_of_ten(exponent)} {series.value_unit}".strip()))
    _legend(figure, series, fit)
    return figure


def logarithmic_decay(series: Series, fit: FittedDecay | None) -> Figure:
    """Draw the signal over time on a logarithmic axis; values below it are marked at its foot."""
    figure, axes = _axes(series.value_unit)
    axes.set_yscale("log", nonpositive="clip")
    _draw(axes, series, fit)
    low, high = log_axis_ends(series)
    axes.set_ylim(low, high)
    mark_decades(axes)
    for number, name in enumerate(series.channels):
        below = series.values[:, number] < low
        if below.any():
            axes.plot(
                exposure_middles_s(series)[below],
                np.full(np.count_nonzero(below), low),
                linestyle="none",
                marker=7,  # a caret that points down, its tip on the value
                markersize=5,
                color=channel_colour(name, number),
                clip_on=False,
                zorder=4,
            )
    _legend(figure, series, fit)
    return figure


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


def _axes(unit: str) -> tuple[Figure, Axes]:
    """Return a figure with axes of signal, in `unit`, over time."""
    figure = new_figure(HEIGHT_PT)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=30)
    axes.set_xlabel(TIME_LABEL)
    axes.set_ylabel(_signal_label(unit))
    return figure, axes


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


def _draw(axes: Axes, series: Series, fit: FittedDecay | None) -> None:
    """Draw the signals with ± 1 σ, and the fit with its band and its states."""
    t_s, usable = exposure_middles_s(series), series.usable
    for number, name in enumerate(series.channels):
        marker = MARKERS[number % len(MARKERS)]
        colour = channel_colour(name, number)
        sigma = np.nan_to_num(series.sigma[:, number])
        error_bars(axes, t_s, series.values[:, number], sigma, colour)
        for rows, face in ((usable, colour), (~usable, PAPER)):
            points(axes, t_s[rows], series.values[rows, number], marker, colour, face)
    if fit is not None:
        curve = fitted_curve(series, fit)
        for number, name in enumerate(series.channels):
            axes.plot(
                curve.t_s, curve.total[:, number], color=channel_colour(name, number), linewidth=1.2
            )
        if np.isfinite(curve.sigma).all():
            middle = curve.total[:, fit.brightest]
            axes.fill_between(
                curve.t_s,
                middle - curve.sigma,
                middle + curve.sigma,
                color=_brightest_colour(fit),
                alpha=BAND_OPACITY,
                linewidth=0,
            )
        if fit.n_states > 1:
            axes.plot(curve.t_s, curve.states, color=INK, linewidth=0.9, linestyle=DASHED)
    last = float(t_s.max())
    axes.set_xlim(-0.02 * last if last else -1.0, 1.03 * last or 1.0)


def _brightest_colour(fit: FittedDecay) -> str:
    """Return the colour of the brightest channel of a fit."""
    return channel_colour(fit.channels[fit.brightest], fit.brightest)


def _legend(figure: Figure, series: Series, fit: FittedDecay | None) -> None:
    """Add the legend of channels, fit and states."""
    entries: list[Artist] = [
        marker_entry(name, MARKERS[number % len(MARKERS)], channel_colour(name, number))
        for number, name in enumerate(series.channels)
    ]
    if fit is not None:
        brightest = series.channels[fit.brightest]
        entries += [line_entry("fit", MUTED), band_entry("± 1 σ", _brightest_colour(fit))]
        if fit.n_states > 1:
            entries.append(line_entry(f"each state, {brightest}", INK, DASHED, width=0.9))
    if not series.usable.all():
        entries.append(marker_entry("left out", "o", MUTED, PAPER))
    legend_above(figure, entries, columns=7)


RESIDUALS_HEIGHT_PT = 268.0
LOW_HEIGHT_PT = 200.0
#: Half width of the shaded band of residuals in σ.
BAND = 2.0
#: Residuals beyond this many σ are drawn at the edge of the figure.
FARTHEST = 8.0
#: The common-mode deviation of a frame is shown if its σ is at most this, or at most three times
#: the smallest σ of all frames.
COMMON_SIGMA = 0.02


@dataclass(frozen=True, eq=False)
class Residuals:
    """Deviations of the values of n frames and C channels from the fit.

    Attributes
    ----------
    normalised
        Residuals over the expected standard deviation of a value, flicker included, shape (n, C).
    common, common_sigma
        Common-mode deviation: the relative deviation that fits all channels of a frame best, and
        its σ from photon and read noise, shape (n,).
    """

    normalised: FloatArray
    common: FloatArray
    common_sigma: FloatArray


def residuals(series: Series, fit: FittedDecay) -> Residuals:
    """Return the residuals of all rows of a series, with those excluded from the fit."""
    model = fit.predict(series.t_s, series.exposure_s)
    signal = model - fit.offsets
    deviation = series.values - model
    # Without σ (a table from elsewhere) the scatter of the residuals has to do.
    scatter = np.full_like(deviation, np.sqrt(np.mean(deviation**2)) or 1.0)
    sigma = np.where(np.isfinite(series.sigma), series.sigma, scatter)
    information = np.sum((signal / sigma) ** 2, axis=1)
    information = np.where(information > 0, information, np.nan)
    return Residuals(
        normalised=deviation / np.hypot(sigma, fit.flicker * signal),
        common=np.sum(deviation * signal / sigma**2, axis=1) / information,
        common_sigma=1 / np.sqrt(information),
    )


def residual_figure(series: Series, fit: FittedDecay) -> Figure:
    """Draw the normalised residuals and, with several channels, the common-mode deviations."""
    deviations = residuals(series, fit)
    several = len(series.channels) > 1
    figure = new_figure(RESIDUALS_HEIGHT_PT if several else LOW_HEIGHT_PT)
    upper = place(figure, left=LEFT_PT, bottom=136 if several else 38, right=12, top=30)
    t_s, usable = exposure_middles_s(series), series.usable
    last = float(t_s.max())
    upper.axhspan(-BAND, BAND, color=SHADE, linewidth=0)
    upper.axhline(0, color=MUTED, linewidth=0.8)
    clipped = np.clip(deviations.normalised, -FARTHEST, FARTHEST)
    for number, name in enumerate(series.channels):
        marker = MARKERS[number % len(MARKERS)]
        colour = channel_colour(name, number)
        for rows, face in ((usable, colour), (~usable, PAPER)):
            points(upper, t_s[rows], clipped[rows, number], marker, colour, face, size=3.6)
    _residual_legend(figure, series)
    reach = float(np.abs(clipped[usable]).max()) if usable.any() else BAND
    upper.set_ylim(-max(reach * 1.1, 3.2), max(reach * 1.1, 3.2))
    upper.set_xlim(-0.02 * last if last else -1.0, 1.03 * last or 1.0)
    upper.set_ylabel("Residual / σ")
    if not several:
        upper.set_xlabel(TIME_LABEL)
        return figure
    upper.tick_params(labelbottom=False)
    lower = place(figure, left=LEFT_PT, bottom=38, right=12, top=150, share_x=upper)
    lower.axhspan(-200 * fit.flicker, 200 * fit.flicker, color=SHADE, linewidth=0)
    lower.axhline(0, color=MUTED, linewidth=0.8)
    precise = deviations.common_sigma <= max(COMMON_SIGMA, 3 * np.nanmin(deviations.common_sigma))
    drawn = precise & usable if (precise & usable).any() else precise
    common, common_sigma = 100 * deviations.common[drawn], 100 * deviations.common_sigma[drawn]
    error_bars(lower, t_s[drawn], common, common_sigma, INK)
    points(lower, t_s[drawn], common, "o", INK, INK, size=2.6)
    reach = max(
        float(np.max(np.abs(deviations.common[drawn]) + deviations.common_sigma[drawn])),
        2.4 * fit.flicker,
    )
    lower.set_ylim(-110 * reach, 110 * reach)
    lower.yaxis.set_major_formatter(FuncFormatter(lambda value, _: rounded(value)))
    lower.set_ylabel("Common-mode / %")
    lower.set_xlabel(TIME_LABEL)
    return figure


def _residual_legend(figure: Figure, series: Series) -> None:
    """Add the legend of channels and common-mode deviations."""
    entries = [
        marker_entry(name, MARKERS[number % len(MARKERS)], channel_colour(name, number))
        for number, name in enumerate(series.channels)
    ]
    if len(series.channels) > 1:
        entries.append(marker_entry("in common", ".", INK))
    if not series.usable.all():
        entries.append(marker_entry("left out", "o", MUTED, PAPER))
    legend_above(figure, entries, columns=7)


NOISE_HEIGHT_PT = 268.0
#: Parts of the noise that are nowhere above this fraction of the total σ are not drawn.
MIN_FRACTION = 0.03
_LINES: dict[str, tuple[str, LineStyle]] = {
    "photon noise": (OTHER_CHANNELS[1], "-"),
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


def noise_figure(budget: NoiseBudget) -> Figure:
    """Draw the relative standard uncertainty of the brightest channel, and its components."""
    figure = new_figure(NOISE_HEIGHT_PT)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=46)
    total = 100 * budget.total
    axes.set_yscale("log")
    # Broad and pale, since the largest part is nearly as large.
    entries: list[Artist] = [line_entry("together", INK, width=4.5, opacity=BAND_OPACITY)]
    drawn_parts = [total]
    axes.plot(budget.t_s, total, color=INK, linewidth=4.5, alpha=BAND_OPACITY)
    for name, part in visible_parts(budget).items():
        percent, (colour, style) = 100 * part, _LINES[name]
        axes.plot(budget.t_s, percent, color=colour, linewidth=1.2, linestyle=style)
        entries.append(line_entry(name, colour, style))
        drawn_parts.append(percent[percent > MIN_FRACTION * total])
    low, high = min(part.min() for part in drawn_parts), max(part.max() for part in drawn_parts)
    axes.set_ylim(0.8 * low, 1.3 * max(min(high, MAX_PERCENT), total.min()))
    mark_decades(axes)
    last = float(budget.t_s.max())
    axes.set_xlim(-0.02 * last if last else -1.0, 1.03 * last or 1.0)
    axes.set_xlabel(TIME_LABEL)
    axes.set_ylabel("σ of a value / % of the signal")
    legend_above(figure, entries, columns=3)
    return figure


SMALL_WIDTH_PT, SMALL_HEIGHT_PT = 190.0, 140.0
SMALL_FONT_PT = 9.5
TIMING_HEIGHT_PT = 200.0


def overview_figures(patches: Sequence[PatchReport]) -> list[Callable[[], Figure]]:
    """Return functions that draw a small logarithmic decay of each patch, all on the same axes."""
    ends = [log_axis_ends(patch.series) for patch in patches]
    low, high = min(end[0] for end in ends), max(end[1] for end in ends)
    last_s = max(float(exposure_middles_s(patch.series).max()) for patch in patches) or 1.0
    return [partial(_small_decay, patch, low, high, last_s) for patch in patches]


def _small_decay(patch: PatchReport, low: float, high: float, last_s: float) -> Figure:
    """Draw a small logarithmic decay from `low` to `high` in DN/s and up to `last_s`."""
    figure = new_figure(SMALL_HEIGHT_PT, SMALL_WIDTH_PT)
    axes = place(figure, left=50, bottom=32, right=14, top=6)
    axes.set_yscale("log", nonpositive="clip")
    axes.set_ylim(low, high)
    axes.set_xlim(-0.03 * last_s, 1.03 * last_s)
    axes.xaxis.set_major_locator(MaxNLocator(4))
    mark_decades(axes, most=6)
    axes.tick_params(labelsize=SMALL_FONT_PT, pad=2)
    axes.set_xlabel("Time / s", fontsize=SMALL_FONT_PT)
    axes.set_ylabel("DN/s", fontsize=SMALL_FONT_PT)
    series = patch.series
    curve = fitted_curve(series, patch.fit) if isinstance(patch.fit, FittedDecay) else None
    for number, name in enumerate(series.channels):
        colour = channel_colour(name, number)
        axes.plot(
            exposure_middles_s(series)[series.usable],
            series.values[series.usable, number],
            linestyle="none",
            marker=MARKERS[number % len(MARKERS)],
            markersize=2.2,
            markeredgewidth=0,
            color=colour,
        )
        if curve is not None:
            axes.plot(curve.t_s, curve.total[:, number], color=colour, linewidth=0.9)
    return figure


def timing_figure(timings: Sequence[FrameTiming]) -> Figure:
    """Draw the lateness of each exposure in ms, in one colour a unit."""
    units = list(dict.fromkeys(timing.unit for timing in timings))
    several = 1 < len(units) <= len(MARKERS)
    figure = new_figure(TIMING_HEIGHT_PT)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=46 if several else 14)
    axes.axhline(0, color=MUTED, linewidth=0.8)
    entries = []
    for number, unit in enumerate(units):
        unit_timings = [timing for timing in timings if timing.unit == unit]
        marker = MARKERS[number % len(MARKERS)]
        colour = INK if number == 0 else OTHER_CHANNELS[number % len(OTHER_CHANNELS)]
        entries.append(marker_entry(unit, marker, colour))
        axes.plot(
            [timing.t_s for timing in unit_timings],
            [1e3 * timing.late_s for timing in unit_timings],
            linestyle="none",
            marker=marker,
            markersize=3.6,
            color=colour,
        )
    late_ms = np.array([1e3 * timing.late_s for timing in timings])
    reach = max(float(np.abs(late_ms).max()), 0.1)
    axes.set_ylim(min(float(late_ms.min()) * 1.15, -0.08 * reach), 1.15 * reach)
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: rounded(value)))
    axes.set_xlabel(TIME_LABEL)
    axes.set_ylabel("Late by / ms")
    if several:
        legend_above(figure, entries, columns=4)
    return figure
