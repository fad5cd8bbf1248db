"""Figures of a fluorescent sample that was measured under LEDs."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from labrig.material import ReradiationMatrix
from labrig.report.chart import (
    Band,
    Chart,
    ErrorBars,
    Line,
    Mark,
    Panel,
    Points,
    linear_axis,
)
from labrig.report.figure_style import INK, MUTED, OTHER_CHANNELS, RULE, channel_colour
from labrig.report.heat_map import INCIDENT, RETURNING, heat_figure, largest, shown_values
from labrig.report.reradiation_spectra import limits
from labrig.results import FloatArray, FluorescentPatch, LedFluorescenceResult

# matplotlib is slow to load.
if TYPE_CHECKING:
    from matplotlib.figure import Figure

HEIGHT_PT = 240.0
PER_LED = OTHER_CHANNELS[1]


def matrix_figure(matrix: ReradiationMatrix, is_extrapolated: NDArray[np.bool_]) -> "Figure":
    """Draw the matrix; input bands that no LED lit are hatched."""
    values = shown_values(matrix)
    figure, axes = heat_figure(matrix, values, (0.0, max(largest(values), 1e-12)))
    edges = matrix.input_edges_nm
    for band in np.flatnonzero(is_extrapolated):
        axes.axvspan(
            edges[band], edges[band + 1], facecolor="none", edgecolor=MUTED, hatch="////",
            linewidth=0.0, alpha=0.45,
        )  # fmt: skip
    return figure


def excitation_chart(patch: FluorescentPatch, matrix: ReradiationMatrix) -> Chart:
    """Return the chart of the fraction that is re-radiated, of each incident wavelength."""
    sigma = matrix.reradiated_fraction_sigma
    per_led = None if patch.per_led is None else patch.per_led.named("").reradiated_fraction
    return _chart(matrix.input_nm, matrix.reradiated_fraction, sigma, per_led,
                  (INCIDENT, "Fraction re-radiated"))  # fmt: skip


def reflectance_chart(patch: FluorescentPatch, matrix: ReradiationMatrix) -> Chart:
    """Return the chart of the reflectance."""
    per_led = None if patch.per_led is None else patch.per_led.reflectance
    return _chart(matrix.output_nm, matrix.reflectance, matrix.reflectance_sigma, per_led,
                  (RETURNING, "Reflectance"))  # fmt: skip


def _chart(
    nm: FloatArray,
    value: FloatArray,
    sigma: FloatArray | None,
    per_led: FloatArray | None,
    labels: tuple[str, str],
) -> Chart:
    left, right = float(nm[0]), float(nm[-1])
    line = Line(INK, nm, value)
    marks: list[Mark] = [Line(RULE, np.array([left, right]), np.zeros(2))]
    shown = [value]
    if sigma is not None:
        marks.append(Band(MUTED, nm, value - sigma, value + sigma))
        shown += [value + sigma]
    marks.append(line)
    legend = [("all LEDs together", line)]
    if per_led is not None:
        other = Line(PER_LED, nm, per_led)
        marks.append(other)
        legend.append(("one LED by itself", other))
        shown.append(np.minimum(per_led, 1.2))
    panel = Panel(
        linear_axis(labels[0], left, right), linear_axis(labels[1], *limits(*shown)), tuple(marks)
    )
    return Chart((panel,), HEIGHT_PT, legend=tuple(legend))


def values_chart(patch: FluorescentPatch, result: LedFluorescenceResult) -> Chart:
    """Return the chart of the values under the LEDs whose brightness is known."""
    known = result.is_brightness_known
    nm, scale = result.led_peak_nm[known], result.brightness[known]
    marks: list[Mark] = []
    legend = []
    shown = []
    for channel, name in enumerate(result.channels):
        colour = channel_colour(name, channel)
        value = patch.value[known, channel] / scale
        sigma = patch.sigma[known, channel] / scale
        points = Points(colour, nm, value)
        predicted = patch.predicted[known, channel] / scale
        marks += [ErrorBars(colour, nm, value, sigma), points, Line(colour, nm, predicted)]
        legend.append((name, points))
        shown += [value, predicted]
    panel = Panel(
        linear_axis("LED / nm", float(nm.min()) - 10, float(nm.max()) + 10),
        linear_axis("Value over brightness", *limits(*shown)),
        tuple(marks),
    )
    return Chart((panel,), HEIGHT_PT, legend=tuple(legend))
