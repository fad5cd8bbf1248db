"""Chart of the periodogram of a decay's residuals, in which a periodic flicker is a line."""

import numpy as np

from labrig.fit import Periodogram, periodogram
from labrig.protocols.decay.report.residual_figures import residuals
from labrig.report.chart import Chart, Line, Panel, linear_axis, logarithmic_axis
from labrig.report.figure_style import DASHED, INK, MUTED
from labrig.results import FittedDecay, Series

HEIGHT_PT = 200.0
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
    return Chart((panel,), HEIGHT_PT)
