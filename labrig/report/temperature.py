"""The course of the temperature over a run, as a figure."""

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from labrig.report.figure_style import INK, LEFT_PT, MUTED, SHADE, new_figure, place, points

FloatArray = NDArray[np.float64]

HEIGHT_PT = 180.0
#: Longer runs are shown in hours.
LONGEST_IN_MINUTES_S = 3 * 3600.0
#: No axis is shorter, in degrees: the noise of a steady room is to look like it.
LEAST_SPAN_C = 2.0


def temperature_figure(
    time_s: FloatArray, celsius: FloatArray, smooth: FloatArray, glow_s: FloatArray
) -> Figure:
    """Readings and their smoothed course; where the glow was photographed is shaded.

    Parameters
    ----------
    time_s, celsius, smooth
        (N,) of the readings, rising, after the beginning of the run.
    glow_s
        (M, 2) beginning and end of what is to be shaded.
    """
    unit_s, unit = (60.0, "min") if time_s[-1] <= LONGEST_IN_MINUTES_S else (3600.0, "h")
    figure = new_figure(HEIGHT_PT)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=14)
    for begin_s, end_s in glow_s:
        axes.axvspan(begin_s / unit_s, end_s / unit_s, color=SHADE, linewidth=0)
    points(axes, time_s / unit_s, celsius, "o", MUTED, MUTED, size=2.2)
    axes.plot(time_s / unit_s, smooth, color=INK, linewidth=1.2, zorder=4)
    middle = (float(celsius.min()) + float(celsius.max())) / 2
    reach = max(float(np.ptp(celsius)) * 1.1, LEAST_SPAN_C) / 2
    axes.set_ylim(middle - reach, middle + reach)
    axes.set_xlabel(f"Time since the run began / {unit}")
    axes.set_ylabel("Temperature / °C")
    return figure
