"""Figure of measured quantities over a key that was changed from run to run."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from labrig.report.chart import (
    Axis,
    Chart,
    ErrorBars,
    Margins,
    Mark,
    Panel,
    Points,
    linear_axis,
    logarithmic_axis,
)
from labrig.report.figure_style import CHANNEL, INK, MARKERS, OTHER_CHANNELS
from labrig.results import Measured

#: Ratio of the largest to the least value from which an axis is logarithmic.
MANY_TIMES = 8.0
#: Largest number of values that are written below the axis as they were typed.
MAX_TEXTS = 8
HEIGHT_PT = 300.0
COLOURS = (INK, OTHER_CHANNELS[1], OTHER_CHANNELS[0], OTHER_CHANNELS[2], *CHANNEL.values())


@dataclass(frozen=True)
class SweptPoint:
    """A quantity of one run.

    Attributes
    ----------
    at
        Value of the key, in its unit.
    patch, name
        Patch, and name of the quantity in it, such as `state 1`.
    measured
        The quantity.
    """

    at: float
    patch: str
    name: str
    measured: Measured


def sweep_chart(
    key: str, texts: Mapping[float, str], label: str, points: Sequence[SweptPoint]
) -> Chart | None:
    """Return a chart of a quantity over a key.

    Parameters
    ----------
    key
        Name of the key.
    texts
        Values of the key as they were typed, by their numbers.
    label
        Name of the quantity, with its unit.
    points
        Quantities of the runs.

    Returns
    -------
    Chart or None
        Points with bars of ± 1 σ, a colour for each name, a marker for each patch; None of fewer
        than two values.

    Examples
    --------
    >>> from labrig.report import SweptPoint, sweep_chart
    >>> from labrig.results import Measured
    >>> points = [SweptPoint(at, "", "state 1", Measured(0.03, 0.001)) for at in (60.0, 300.0)]
    >>> chart = sweep_chart("charge", {60.0: "1 min", 300.0: "5 min"}, "k_r / s⁻¹", points)
    >>> chart.panels[0].x.ticks
    ((60.0, '1 min'), (300.0, '5 min'))
    """
    if len(texts) < 2 or not points:
        return None
    patches = list(dict.fromkeys(point.patch for point in points))
    marks: list[Mark] = []
    legend: list[tuple[str, Mark]] = []
    names = list(dict.fromkeys(point.name for point in points))
    for patch, name in dict.fromkeys((point.patch, point.name) for point in points):
        of_name = [point for point in points if (point.patch, point.name) == (patch, name)]
        at = np.array([point.at for point in of_name])
        value = np.array([point.measured.value for point in of_name])
        sigma = np.array([point.measured.sigma for point in of_name])
        colour = COLOURS[names.index(name) % len(COLOURS)]
        dots = Points(
            colour, at, value, marker=MARKERS[patches.index(patch) % len(MARKERS)], size_pt=5.0
        )
        marks += [ErrorBars(colour, at, value, np.where(np.isfinite(sigma), sigma, 0.0)), dots]
        legend.append((f"{name}{f', {patch}' if len(patches) > 1 else ''}", dots))
    axis = _quantity_axis(label, [point.measured.value for point in points])
    panel = Panel(_key_axis(key, texts), axis, tuple(marks), Margins(top=30.0))
    return Chart((panel,), HEIGHT_PT, legend=tuple(legend), columns=min(len(legend), 4))


def _quantity_axis(label: str, values: Sequence[float]) -> Axis:
    low, high = min(values), max(values)
    if low > 0 and high > MANY_TIMES * low:
        return logarithmic_axis(label, low / 1.5, high * 1.5)
    return linear_axis(label, min(0.0, low), 1.15 * max(high, 1e-300))


def _key_axis(key: str, texts: Mapping[float, str]) -> Axis:
    low, high = min(texts), max(texts)
    is_logarithmic = low > 0 and high > MANY_TIMES * low
    if is_logarithmic:
        axis = logarithmic_axis(key, low / 1.5, high * 1.5)
    else:
        axis = linear_axis(key, low - 0.08 * (high - low), high + 0.08 * (high - low))
    if len(texts) > MAX_TEXTS:
        return axis
    return Axis(key, axis.low, axis.high, tuple(sorted(texts.items())), (), is_logarithmic)
