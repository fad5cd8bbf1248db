"""Picture of the errors of all methods against the numbers they store, with the noise floor."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from labrig.report.figure_style import (
    CHANNEL,
    DASHED,
    INK,
    MUTED,
    OTHER_CHANNELS,
    SHADE,
    figure_style,
)
from tests.acceptance.mixture_colours import LIGHTS
from tests.acceptance.mixture_judgement import Tried, quantiles

# matplotlib is slow to load.
if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: What is drawn: name, colour, marker, and the name in the legend.
DRAWN = (
    ("labrig", CHANNEL["R"], "o", "mixture, labrig"),
    ("pomegranate, 8 starts", CHANNEL["B"], "s", "mixture, pomegranate"),
    ("product on knots", OTHER_CHANNELS[1], "D", "emission × excitation on knots"),
    ("SVD", MUTED, "v", "SVD"),
    ("SVD, Stokes side", INK, "^", "SVD of the Stokes side"),
    ("NMF, Stokes side", CHANNEL["G"], "P", "NMF of the Stokes side"),
)
TICKS = (6, 12, 24, 60, 120, 240, 480)


def draw_errors(tried: Sequence[Tried], floors: Sequence[Tried], path: Path) -> None:
    """Draw medians of masked error and of ΔE2000 under daylight and under a narrow light."""
    from matplotlib.figure import Figure

    by_name = {one.name: one for one in floors}
    again, threshold = by_name["materials, another day"], by_name["threshold alone"]
    with figure_style():
        figure = Figure(figsize=(9.0, 3.9), layout="constrained")
        mse, daylight, narrow = figure.subplots(1, 3)
        for axes, light in ((daylight, "D65"), (narrow, "450nm")):
            at = LIGHTS.index(light)
            _band(axes, [row[at] for row in again.delta_e])
            level = quantiles([row[at] for row in threshold.delta_e], 0.5)[0]
            axes.axhline(level, color=INK, linestyle=DASHED, linewidth=1.0,
                         label="threshold alone")  # fmt: skip
            for name, colour, marker, label in DRAWN:
                ours = [one for one in tried if one.name == name]
                values = [quantiles([row[at] for row in one.delta_e], 0.5)[0] for one in ours]
                _line(axes, ours, values, colour, marker, label)
            axes.set_title(f"ΔE2000 under {light.replace('nm', ' nm')}, median", fontsize="medium")
        _band(mse, by_name["noise of kept entries"].mse)
        for name, colour, marker, label in DRAWN:
            ours = [one for one in tried if one.name == name]
            values = [quantiles(one.mse, 0.5)[0] for one in ours]
            _line(mse, ours, values, colour, marker, label)
        mse.set_title("masked MSE per band², median", fontsize="medium")
        for axes in (mse, daylight, narrow):
            axes.set(xscale="log", yscale="log", xlabel="stored numbers")
            axes.set_xticks(TICKS, [str(tick) for tick in TICKS])
            axes.minorticks_off()
            for side in ("top", "right"):
                axes.spines[side].set_visible(False)
        for axes in (daylight, narrow):
            _plain_ticks(axes)
        handles, labels = daylight.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False,
                      fontsize="small")  # fmt: skip
        figure.savefig(path, dpi=110)


def _band(axes: "Axes", values: Sequence[float]) -> None:
    low, high = quantiles(values, 0.1, 0.9)
    axes.axhspan(low, high, color=SHADE, label="noise floor, 10 to 90 %")


def _line(
    axes: "Axes",
    ours: Sequence[Tried],
    values: Sequence[float],
    colour: str,
    marker: str,
    label: str,
) -> None:
    numbers = [float(np.median(one.numbers)) for one in ours]
    axes.plot(numbers, values, marker=marker, markersize=4, color=colour, label=label)


def _plain_ticks(axes: "Axes") -> None:
    low, high = axes.get_ylim()
    ticks = [tick for tick in (0.1, 0.2, 0.5, 1, 2, 5, 10, 20) if low <= tick <= high]
    axes.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
