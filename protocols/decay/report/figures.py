"""Charts of a decay: its laws beyond the measurement, residuals, and their periodogram."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from labrig.fit import Periodogram, periodogram
from labrig.foundation.arrays import FloatArray
from labrig.material import DECAY_LAWS
from labrig.report.chart import (
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
from labrig.report.decay_figures import (
    LEFT_OUT,
    channel_points,
    channel_styles,
    exposure_middles_s,
    time_axis,
    time_label,
)
from labrig.report.figure_style import (
    DASH_DOTTED,
    DASHED,
    DOTTED,
    INK,
    LONG_DASHED,
    MUTED,
    OTHER_CHANNELS,
    SHADE,
    SOLID,
    LineStyle,
)
from labrig.results import (
    EXPONENTIALS,
    FORECAST_SPANS,
    LAW_LABELS,
    RATE_SPECTRUM,
    FittedDecay,
    Series,
)

HEIGHT_PT, UPPER_PT, LOWER_PT = 340.0, 170.0, 190.0
#: Number of points of a curve.
POINTS = 160
#: End of the time axis in times of the measurement, and its first time in that of the end.
SHOWN_SPANS, FIRST = 6.0, 1e-3
#: Faintest and brightest end of the axis in that of the measured values.
BELOW, ABOVE = 1e-2, 2.0
#: Smallest and largest deviation of a law from the chosen one at the ends of the axis.
NEAREST, WIDEST = 0.02, 0.5
#: Part of the first light from which on the glow is nothing to compare with.
GONE = 1e-12
_STYLES: tuple[LineStyle, ...] = (DASHED, DASH_DOTTED, DOTTED)
_LINES: dict[str, tuple[str, LineStyle]] = {
    EXPONENTIALS: (OTHER_CHANNELS[0], SOLID),
    **{
        name: (OTHER_CHANNELS[1:][k % (len(OTHER_CHANNELS) - 1)], _STYLES[k % len(_STYLES)])
        for k, name in enumerate(DECAY_LAWS)
    },
    RATE_SPECTRUM: (MUTED, LONG_DASHED),
}
_SHORT = {law.name: law.short_label for law in DECAY_LAWS.values()} | {RATE_SPECTRUM: "spectrum"}


def law_figure(series: Series, fit: FittedDecay) -> Chart:
    """Return the brightest channel and the curve of every law, and below both over the chosen law.

    The band is between the laws that describe the data; where it alone is left, beyond three times
    the measured time, no law can be trusted by itself.
    """
    number = fit.brightest
    middle_s = series.t_s + series.exposure_s / 2
    values = series.values[:, number] - fit.offset
    shown = series.usable & (values > 0) & (middle_s > 0)
    last_s = fit.measured_until_s
    first_s = max(float(middle_s[shown].min(initial=last_s)), FIRST * last_s)
    t_s = np.geomspace(first_s, SHOWN_SPANS * last_s, POINTS)
    brightest = float(values[shown].max(initial=1e-30))
    low = BELOW * max(float(values[shown].min(initial=brightest)), 1e-4 * brightest)
    forecast = fit.forecast(t_s)
    curves = {law.name: _curve(fit, law.name, t_s) for law in fit.compared_laws}
    later = t_s >= last_s
    marks: list[Mark] = [
        Band(MUTED, t_s[later], np.maximum(forecast.low[later], low), forecast.high[later])
    ]
    legend: list[tuple[str, Mark]] = [
        ("measured", Points(INK, size_pt=3.5)),
    ]
    for law in fit.compared_laws:
        colour, style = _LINES[law.name]
        chosen = law.name == fit.law
        width_pt = 2.0 if chosen else 1.0
        marks.append(Line(colour, t_s, curves[law.name], width_pt, style))
        name = _SHORT.get(law.name, LAW_LABELS[law.name])
        legend.append((name, Line(colour, width_pt=width_pt, style=style)))
    marks.append(Points(INK, middle_s[shown], values[shown], size_pt=2.6))
    marks += _end_of_knowledge(last_s, low, ABOVE * brightest)
    unit = f" / ({series.value_unit})" if series.value_unit else ""
    axis = logarithmic_axis(f"Signal{unit}", low, ABOVE * brightest)
    time = logarithmic_axis(time_label(fit), float(t_s[0]) / 1.1, float(t_s[-1]) * 1.1)
    margins = Margins(top=46.0, bottom=UPPER_PT)
    upper = Panel(time, axis, tuple(marks), margins, has_x_labels=False)
    lower = _over_the_chosen_law(series, fit, time, t_s, curves, (forecast.low, forecast.high))
    return Chart((upper, lower), HEIGHT_PT, legend=tuple(legend), columns=3)


def _over_the_chosen_law(
    series: Series,
    fit: FittedDecay,
    time: Axis,
    t_s: FloatArray,
    curves: Mapping[str, FloatArray],
    band: tuple[FloatArray, FloatArray],
) -> Panel:
    """Return values, laws and the band over the chosen law, on a linear axis about 1."""
    chosen, last_s = curves[fit.law], fit.measured_until_s
    glows = chosen > GONE * chosen.max()
    t_s, chosen = t_s[glows], chosen[glows]
    ratios = {name: curve[glows] / chosen for name, curve in curves.items()}
    measured = t_s <= last_s
    farthest = max(float(np.abs(each - 1)[measured].max()) for each in ratios.values())
    reach = min(max(1.2 * farthest, NEAREST), WIDEST)
    later = t_s >= last_s
    low, high = (np.clip(end[glows] / chosen, 0, 2)[later] for end in band)
    marks: list[Mark] = [Band(MUTED, t_s[later], low, high)]
    for name, ratio in ratios.items():
        colour, style = _LINES[name]
        inside = np.abs(ratio - 1) < 2 * reach
        width_pt = 2.0 if name == fit.law else 1.0
        marks.append(Line(colour, t_s[inside], ratio[inside], width_pt, style))
    signal = fit.predict(series.t_s, series.exposure_s)[:, fit.brightest] - fit.offset
    usable = series.usable & (signal > GONE * chosen.max())
    values = (series.values[usable, fit.brightest] - fit.offset) / signal[usable]
    sigma = np.hypot(series.sigma[usable, fit.brightest] / signal[usable], fit.flicker)
    shown = (np.nan_to_num(sigma) < reach) & (np.abs(values - 1) < reach)
    middle_s = (series.t_s + series.exposure_s / 2)[usable][shown]
    marks += [
        ErrorBars(INK, middle_s, values[shown], np.nan_to_num(sigma)[shown]),
        Points(INK, middle_s, values[shown], size_pt=2.6),
    ]
    marks += _end_of_knowledge(last_s, 1 - reach, 1 + reach)
    axis = linear_axis("Over the chosen law", 1 - reach, 1 + reach, most=4)
    return Panel(time, axis, tuple(marks), Margins(top=LOWER_PT))


def _end_of_knowledge(last_s: float, low: float, high: float) -> list[Mark]:
    """Return the verticals at the end of the measurement, and where no value can be given."""
    ends = np.array([low, high])
    places_s = (last_s, FORECAST_SPANS * last_s)
    return [Line(MUTED, np.full(2, at_s), ends, 0.7, DOTTED) for at_s in places_s]


def _curve(fit: FittedDecay, law: str, t_s: FloatArray) -> FloatArray:
    return fit.signal(t_s, np.zeros_like(t_s), law)[0]


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


def residual_figure(series: Series, fit: FittedDecay) -> Chart:
    """Return the normalised residuals and, with several channels, the common-mode deviations."""
    deviations = residuals(series, fit)
    channels = channel_styles(series)
    several = len(channels) > 1
    time, usable = time_axis(exposure_middles_s(series), fit), series.usable
    clipped = np.clip(deviations.normalised, -FARTHEST, FARTHEST)
    marks = _shaded_zero(time, BAND)
    for number in range(len(channels)):
        marks += channel_points(series, number, clipped[:, number], size_pt=3.6)
    reach = float(np.abs(clipped[usable]).max()) if usable.any() else BAND
    reach = max(reach * 1.1, 3.2)
    upper = Panel(
        time,
        linear_axis("Residual / σ", -reach, reach, most=6),
        tuple(marks),
        Margins(bottom=136.0 if several else 38.0),
        has_x_labels=not several,
    )
    legend: list[tuple[str, Mark]] = [
        (name, Points(colour, marker=marker, size_pt=5.0)) for name, marker, colour in channels
    ]
    if several:
        legend.append(("in common", Points(INK, size_pt=2.6)))
    if not usable.all():
        legend.append(LEFT_OUT)
    panels = (upper, _common_mode(series, fit, deviations, time)) if several else (upper,)
    return Chart(panels, RESIDUALS_HEIGHT_PT if several else LOW_HEIGHT_PT, legend=tuple(legend))


def _shaded_zero(time: Axis, reach: float) -> list[Mark]:
    """Return the line at zero, and the shade of ± `reach` about it."""
    ends, ones = np.array([time.low, time.high]), np.ones(2)
    return [
        Band(SHADE, ends, -reach * ones, reach * ones, opacity=1.0),
        Line(MUTED, ends, 0 * ones, width_pt=0.8),
    ]


def _common_mode(series: Series, fit: FittedDecay, deviations: Residuals, time: Axis) -> Panel:
    """Return the common-mode deviations of the frames that are known precisely."""
    usable = series.usable
    precise = deviations.common_sigma <= max(COMMON_SIGMA, 3 * np.nanmin(deviations.common_sigma))
    drawn = precise & usable if (precise & usable).any() else precise
    t_s = exposure_middles_s(series)[drawn]
    common, sigma = 100 * deviations.common[drawn], 100 * deviations.common_sigma[drawn]
    reach = 1.1 * max(float(np.max(np.abs(common) + sigma)), 240 * fit.flicker)
    return Panel(
        time,
        linear_axis("Common-mode / %", -reach, reach, most=4),
        (
            *_shaded_zero(time, BAND * 100 * fit.flicker),
            ErrorBars(INK, t_s, common, sigma),
            Points(INK, t_s, common, size_pt=2.6),
        ),
        Margins(top=150.0),
    )


PERIODOGRAM_HEIGHT_PT = 200.0
#: Chance that noise has a line above the level that is drawn: that from which a fit warns.
LEVEL = 5e-4


def residual_periodogram(series: Series, fit: FittedDecay) -> Periodogram | None:
    """Return the periodogram of the frames after the first charge; None if they are too few."""
    deviations = residuals(series, fit)
    sigma = np.hypot(deviations.common_sigma, fit.flicker)
    usable = series.usable & np.isfinite(deviations.common) & np.isfinite(sigma) & (sigma > 0)
    rows = np.flatnonzero(usable & (np.array(series.unit) == series.unit[0]))
    rows = rows[np.argsort(series.t_s[rows], kind="stable")]
    middle_s = (series.t_s + series.exposure_s / 2)[rows]
    return periodogram(middle_s, (deviations.common / sigma)[rows], 1 / sigma[rows])


def periodogram_figure(lines: Periodogram) -> Chart:
    """Return the fraction of the scatter that a flicker of every period explains."""
    period_s, power = 1 / lines.frequency_hz[::-1], lines.power[::-1]
    period = logarithmic_axis("Period / s", float(period_s[0]), float(period_s[-1]))
    level, ends_s = lines.power_at(LEVEL), np.array([period.low, period.high])
    top = min(1.0, 1.15 * max(float(power.max()), level))
    marks = (
        Line(MUTED, ends_s, np.full(2, level), width_pt=0.8, style=DASHED),
        Line(INK, period_s, power),
    )
    panel = Panel(period, linear_axis("Fraction of scatter", 0.0, top, most=5), marks)
    return Chart((panel,), PERIODOGRAM_HEIGHT_PT)
