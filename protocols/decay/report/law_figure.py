"""Chart of all laws that were fitted to a decay, during the measurement and beyond."""

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.report.chart import (
    Band,
    Chart,
    Line,
    Margins,
    Mark,
    Panel,
    Points,
    logarithmic_axis,
)
from labrig.report.decay_figures import time_label
from labrig.report.figure_style import (
    DASH_DOTTED,
    DASHED,
    DOTTED,
    INK,
    LONG_DASHED,
    MUTED,
    OTHER_CHANNELS,
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

HEIGHT_PT = 268.0
#: Number of points of a curve.
POINTS = 160
#: End of the time axis in times of the measurement, and its first time in that of the end.
SHOWN_SPANS, FIRST = 6.0, 1e-3
#: Faintest and brightest end of the axis in that of the measured values.
BELOW, ABOVE = 1e-2, 2.0
_LINES: dict[str, tuple[str, LineStyle]] = {
    EXPONENTIALS: (OTHER_CHANNELS[0], SOLID),
    "becquerel": (OTHER_CHANNELS[1], DASHED),
    "otor": (OTHER_CHANNELS[2], DASH_DOTTED),
    "stretched": (OTHER_CHANNELS[3], DOTTED),
    RATE_SPECTRUM: (MUTED, LONG_DASHED),
}
_SHORT = {
    "otor": "one trap",
    "becquerel": "Becquerel",
    "stretched": "stretched",
    RATE_SPECTRUM: "spectrum",
}


def law_figure(series: Series, fit: FittedDecay) -> Chart:
    """Return the brightest channel and the curve of every law, both axes logarithmic.

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
        marks.append(Line(colour, t_s, _curve(fit, law.name, t_s), width_pt, style))
        name = _SHORT.get(law.name, LAW_LABELS[law.name])
        legend.append((name, Line(colour, width_pt=width_pt, style=style)))
    marks.append(Points(INK, middle_s[shown], values[shown], size_pt=2.6))
    for at_s in (last_s, FORECAST_SPANS * last_s):
        ends = np.array([low, ABOVE * brightest])
        marks.append(Line(MUTED, np.full(2, at_s), ends, 0.7, DOTTED))
    unit = f" / ({series.value_unit})" if series.value_unit else ""
    axis = logarithmic_axis(f"Signal{unit}", low, ABOVE * brightest)
    time = logarithmic_axis(time_label(fit), float(t_s[0]) / 1.1, float(t_s[-1]) * 1.1)
    panel = Panel(time, axis, tuple(marks), Margins(top=46.0))
    return Chart((panel,), HEIGHT_PT, legend=tuple(legend), columns=3)


def _curve(fit: FittedDecay, law: str, t_s: FloatArray) -> FloatArray:
    return fit.signal(t_s, np.zeros_like(t_s), law)[0]
