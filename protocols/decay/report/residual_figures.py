"""Deviations of measured signals from the fitted decay, and their chart."""

from dataclasses import dataclass

import numpy as np

from labrig.foundation.arrays import FloatArray
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
)
from labrig.report.decay_figures import (
    LEFT_OUT,
    channel_points,
    channel_styles,
    exposure_middles_s,
    time_axis,
)
from labrig.report.figure_style import INK, MUTED, SHADE
from labrig.results import FittedDecay, Series

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
