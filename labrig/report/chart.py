"""Charts: axes and marks as plain values, which are drawn as SVG or by matplotlib.

A page of many patches has hundreds of figures. matplotlib takes about a tenth of a second for each,
and half a second to load; the SVG of a chart takes a hundredth of that.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.number_format import power_of_ten, rounded
from labrig.report.figure_style import (
    BAND_OPACITY,
    LEFT_PT,
    SMALL_PT,
    SOLID,
    WIDTH_PT,
    LineStyle,
    Marker,
    Ticks,
    decade_ticks,
    linear_ticks,
)

NO_VALUES = np.empty(0)


@dataclass(frozen=True, eq=False)
class Points:
    """Measured values as points.

    Attributes
    ----------
    x, y
        Coordinates, shape (n,).
    colour
        Colour of the points as `#rrggbb`.
    marker
        Shape of the points, one of `MARKERS` or `CARET_DOWN`.
    face
        Colour inside of the points; that of the paper makes them hollow. Empty for `colour`.
    size_pt
        Diameter in points.
    is_clipped
        Whether points end at the edges of the axes.
    """

    colour: str
    x: FloatArray = field(default_factory=lambda: NO_VALUES)
    y: FloatArray = field(default_factory=lambda: NO_VALUES)
    marker: Marker = "o"
    face: str = ""
    size_pt: float = 3.8
    is_clipped: bool = True


@dataclass(frozen=True, eq=False)
class ErrorBars:
    """Vertical bars of ± 1 σ.

    Attributes
    ----------
    x, y
        Coordinates of the middles, shape (n,).
    sigma
        Half lengths, shape (n,).
    colour
        Colour as `#rrggbb`.
    """

    colour: str
    x: FloatArray
    y: FloatArray
    sigma: FloatArray


@dataclass(frozen=True, eq=False)
class Line:
    """Curve through points.

    Attributes
    ----------
    x, y
        Coordinates, shape (n,).
    colour
        Colour as `#rrggbb`.
    width_pt
        Line width in points.
    style
        Line style, as matplotlib names it.
    opacity
        Opacity from 0 to 1.
    """

    colour: str
    x: FloatArray = field(default_factory=lambda: NO_VALUES)
    y: FloatArray = field(default_factory=lambda: NO_VALUES)
    width_pt: float = 1.2
    style: LineStyle = SOLID
    opacity: float = 1.0


@dataclass(frozen=True, eq=False)
class Band:
    """Area between two curves.

    Attributes
    ----------
    x, low, high
        Horizontal coordinates, and vertical ones of the lower and upper curve, shape (n,).
    colour
        Colour as `#rrggbb`.
    opacity
        Opacity from 0 to 1.
    """

    colour: str
    x: FloatArray = field(default_factory=lambda: NO_VALUES)
    low: FloatArray = field(default_factory=lambda: NO_VALUES)
    high: FloatArray = field(default_factory=lambda: NO_VALUES)
    opacity: float = BAND_OPACITY


Mark: TypeAlias = Points | ErrorBars | Line | Band


@dataclass(frozen=True)
class Axis:
    """Axis with its limits and ticks.

    Attributes
    ----------
    label
        Quantity and unit; empty for an axis without any labels.
    low, high
        Values at the ends.
    ticks
        Values and labels of the ticks.
    short_ticks
        Values of ticks without grid line and label.
    is_logarithmic
        Whether equal lengths are equal ratios.
    """

    label: str
    low: float
    high: float
    ticks: Ticks
    short_ticks: tuple[float, ...] = ()
    is_logarithmic: bool = False


def linear_axis(
    label: str, low: float, high: float, most: int = 8, text: Callable[[float], str] = rounded
) -> Axis:
    """Return an axis with at most `most + 1` evenly spaced ticks that `text` writes.

    A power of ten of its values stands once, in the label.
    """
    ticks = linear_ticks(low, high, most, text)
    if text is rounded and any("×" in written for _, written in ticks):
        exponent = math.floor(math.log10(max(abs(value) for value, _ in ticks)))
        ticks = tuple((value, text(value / 10.0**exponent)) for value, _ in ticks)
        quantity, _, unit = label.partition(" / ")
        power = power_of_ten(exponent)
        label = f"{quantity} / " + (f"({power} {unit.strip('()')})" if unit else power)
    return Axis(label, low, high, ticks)


def logarithmic_axis(label: str, low: float, high: float, most: int = 8) -> Axis:
    """Return a logarithmic axis with at most `most` labelled decades."""
    ticks, short_ticks = decade_ticks(low, high, most)
    return Axis(label, low, high, ticks, short_ticks, is_logarithmic=True)


@dataclass(frozen=True)
class Margins:
    """Distances of axes from the edges of a chart in points.

    Attributes
    ----------
    left, bottom, right, top
        Distances in points.
    """

    left: float = LEFT_PT
    bottom: float = 38.0
    right: float = 12.0
    top: float = 30.0


@dataclass(frozen=True, eq=False)
class Panel:
    """Axes of a chart with what they show.

    Attributes
    ----------
    x, y
        Horizontal and vertical axis.
    marks
        Marks from the hindmost to the foremost.
    margins
        Room for ticks, labels, legend and other panels.
    has_x_labels
        Whether the horizontal axis is labelled; it is not if another panel below it is.
    """

    x: Axis
    y: Axis
    marks: tuple[Mark, ...]
    margins: Margins = field(default_factory=Margins)
    has_x_labels: bool = True


@dataclass(frozen=True, eq=False)
class Chart:
    """Figure of one or more panels.

    Attributes
    ----------
    panels
        Axes with what they show.
    height_pt, width_pt
        Size in points.
    legend
        Labels and marks of the legend, which stands above the axes.
    columns
        Largest number of columns of the legend.
    label_pt
        Size of the axes' labels in points; that of the ticks' labels is not larger.
    """

    panels: tuple[Panel, ...]
    height_pt: float
    width_pt: float = WIDTH_PT
    legend: tuple[tuple[str, Mark], ...] = ()
    columns: int = 7
    label_pt: float = SMALL_PT + 1.0
