"""Figures of a fluorescent sample that was measured under LEDs."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import FloatArray
from labrig.material import ReradiationMatrix
from labrig.protocols.led_fluorescence.result import LedFluorescenceResult
from labrig.report.chart import (
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
from labrig.report.figure_style import DASHED, INK, MUTED, OTHER_CHANNELS, RULE, channel_colour
from labrig.report.reradiation_figures import (
    BAND_NM,
    INCIDENT,
    RETURNING,
    heat_figure,
    largest,
    limits,
    shown_values,
)
from labrig.results import FluorescentPatch, ReradiatedSpectrum, ReradiationUnderLight

# matplotlib is slow to load.
if TYPE_CHECKING:
    from matplotlib.figure import Figure

HEIGHT_PT = 240.0
PER_LED, DIRECT = OTHER_CHANNELS[1], OTHER_CHANNELS[2]
#: Names of the methods for people.
METHODS = {
    "joint": "all LEDs together",
    "per-led": "one LED by itself",
    "direct": "spectrometer",
}
#: Their colours, which the page's legend has, too.
COLOURS = {"joint": INK, "per-led": PER_LED, "direct": DIRECT}
#: Size in points of a figure of which three are side by side.
THIRD_WIDTH_PT, THIRD_HEIGHT_PT = 286.0, 190.0
THIRD_MARGINS = Margins(top=10.0)
#: Part of the strongest re-radiation below which a light is left out, and largest σ of a number
#: that is drawn, of the strongest one under its light.
MIN_SHOWN, WORST_SHOWN = 0.03, 0.1


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


def excitation_chart(patch: FluorescentPatch) -> Chart:
    """Return the chart of the fraction that is re-radiated, of each incident wavelength."""
    joint, per_led = patch.joint.named(""), patch.per_led.named("")
    return _chart(joint.input_nm, joint.reradiated_fraction, joint.reradiated_fraction_sigma,
                  per_led.reradiated_fraction, (INCIDENT, "Fraction re-radiated"))  # fmt: skip


def reflectance_chart(patch: FluorescentPatch) -> Chart:
    """Return the chart of the reflectance."""
    joint, per_led = patch.joint, patch.per_led
    return _chart(joint.output_nm, joint.reflectance, joint.reflectance_sigma,
                  per_led.reflectance, (RETURNING, "Reflectance"))  # fmt: skip


def _chart(
    nm: FloatArray,
    value: FloatArray,
    sigma: FloatArray | None,
    per_led: FloatArray,
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
    other = Line(PER_LED, nm, per_led, style=DASHED)
    marks.append(other)
    legend = [(METHODS["joint"], line), (METHODS["per-led"], other)]
    shown.append(np.minimum(per_led, 1.2))
    panel = Panel(
        linear_axis(labels[0], left, right), linear_axis(labels[1], *limits(*shown)), tuple(marks)
    )
    return Chart((panel,), HEIGHT_PT, legend=tuple(legend))


def values_chart(patch: FluorescentPatch, result: LedFluorescenceResult) -> Chart:
    """Return the chart of the values under the LEDs whose brightness is known."""
    known = result.is_brightness_known & ~result.is_lamp
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


def methods_charts(patch: FluorescentPatch) -> dict[str, Chart]:
    """Return a chart of the re-radiation by all methods for each light, by its name.

    Lights that excite little, by all LEDs together and as a spectrometer read it, are left out.
    """
    strongest = {each.light: _strongest(each) for each in patch.under_lights}
    top = max(strongest.values(), default=0.0)
    return {
        each.light: _methods_chart(each)
        for each in patch.under_lights
        if strongest[each.light] > MIN_SHOWN * top
    }


def _methods_chart(each: ReradiationUnderLight) -> Chart:
    nm, joint = each.joint.output_nm, BAND_NM * each.joint.value
    per_led = BAND_NM * each.per_led.value
    marks: list[Mark] = [Line(RULE, nm[[0, -1]], np.zeros(2))]
    shown = [joint, per_led]
    marks += [Line(PER_LED, nm, per_led, style=DASHED), Line(INK, nm, joint)]
    if each.direct is not None:
        direct_nm, value, error = _certain(each.direct)
        marks += [ErrorBars(DIRECT, direct_nm, value, error), Points(DIRECT, direct_nm, value)]
        shown.append(value)
    panel = Panel(
        linear_axis(RETURNING, float(nm[0]), float(nm[-1]), most=5),
        linear_axis(f"Re-radiation per {BAND_NM:g} nm", *limits(*shown), most=5),
        tuple(marks),
        THIRD_MARGINS,
    )
    return Chart((panel,), THIRD_HEIGHT_PT, THIRD_WIDTH_PT)


def _certain(spectrum: ReradiatedSpectrum) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return wavelengths, re-radiation per 10 nm and σ, without numbers that are hardly known."""
    value, sigma = BAND_NM * spectrum.value, spectrum.sigma
    error = np.zeros_like(value) if sigma is None else BAND_NM * sigma
    is_known = np.isfinite(value)
    clear = is_known & (value > 5 * error)
    top = float(value[clear].max()) if clear.any() else 0.0
    is_shown = is_known & (error <= WORST_SHOWN * top)
    return spectrum.output_nm[is_shown], value[is_shown], error[is_shown]


def _strongest(each: ReradiationUnderLight) -> float:
    """Return the strongest re-radiation of a light by all LEDs together, or as it was read."""
    strongest = float(BAND_NM * each.joint.value.max())
    if each.direct is not None:
        read = _certain(each.direct)[1]
        strongest = max(strongest, float(read.max()) if len(read) else 0.0)
    return strongest
