"""Report of estimated camera curves."""

from collections.abc import Iterator
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from labrig.foundation.number_format import rounded
from labrig.protocols.camera_curves.result import CameraCurvesResult
from labrig.report.figure_style import (
    DASHED,
    INK,
    LEFT_PT,
    MUTED,
    channel_colour,
    legend_above,
    line_entry,
    new_figure,
    place,
    points,
)
from labrig.report.sections import Picture, Rendered, Section, Source, Table

#: Step of the table in rows of the file.
_STEP = 8


def render(result: CameraCurvesResult, source: Source) -> Rendered:
    """Render the curves, and how they explain the chart."""
    return Rendered((_curves(result), _patches(result)), tuple(_lines(result)))


def _lines(result: CameraCurvesResult) -> Iterator[str]:
    peaks = ", ".join(
        f"{name} {result.wavelength_nm[column.argmax()]:g} nm"
        for name, column in zip(result.channels, result.sensitivity.T, strict=True)
    )
    yield f"{result.camera}: peaks {peaks}; σ {result.mean_sigma:.1%} of the peaks"
    yield (
        f"by {result.family_count} shipped cameras"
        f"{' and the filter' if result.through_filter else ''}; misfit {result.misfit:.2f}, "
        f"{result.unusualness:.1f} times a usual difference from their mean"
    )


def _curves(result: CameraCurvesResult) -> Section:
    head = ("Wavelength / nm", *(f"{name}{s}" for name in result.channels for s in ("", " σ")))
    rows = tuple(
        (
            f"{result.wavelength_nm[row]:g}",
            *(
                f"{number:.4f}"
                for pair in zip(result.sensitivity[row], result.sigma[row], strict=True)
                for number in pair
            ),
        )
        for row in range(0, len(result.wavelength_nm), _STEP)
    )
    used = f"{result.family_count} shipped cameras"
    if result.left_out:
        used += f" (without {', '.join(result.left_out)})"
    more = "a grey card through the variable filter, " if result.through_filter else ""
    return Section(
        "Spectral sensitivity",
        (
            f"Estimated from a ColorChecker under {result.lamp}, {more}and the common properties "
            "of "
            f"{used}. σ includes noise, the difference of the chart from its published means, the "
            "lamp's spectrum, and the remaining differences among cameras. It does not include a "
            "factor common to all values; errors of neighbouring wavelengths go together.",
        ),
        (
            Picture(
                "curves",
                partial(_curves_figure, result),
                "Sensitivity of the channels with 1 σ; dashed: mean of the shipped cameras.",
            ),
        ),
        (Table(head, rows, "Some of the wavelengths; all are in curves.csv."),),
    )


def _patches(result: CameraCurvesResult) -> Section:
    evenness = (
        ""
        if result.evenness is None
        else f" The darkest place of the chart has {result.evenness:.0%} of the light of the "
        "brightest; the grey card corrects that."
    )
    return Section(
        "The chart",
        (f"Its patches err {rounded(result.misfit, 2)} times as much as expected.{evenness}",),
        (
            Picture(
                "patches",
                partial(_pulls_figure, result),
                "Measured less fitted value of every patch over its σ, row by row from the brown "
                "patch.",
            ),
        ),
    )


def _curves_figure(result: CameraCurvesResult) -> Figure:
    figure = new_figure(240)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=30)
    entries = []
    for number, name in enumerate(result.channels):
        colour = channel_colour(name, number)
        value, sigma = result.sensitivity[:, number], result.sigma[:, number]
        axes.fill_between(
            result.wavelength_nm, value - sigma, value + sigma, color=colour, alpha=0.2, linewidth=0
        )
        axes.plot(result.wavelength_nm, value, color=colour, linewidth=1.2)
        axes.plot(
            result.wavelength_nm,
            result.family_mean[:, number],
            color=colour,
            linewidth=0.8,
            linestyle=DASHED,
        )
        entries.append(line_entry(name, colour))
    axes.set_xlim(380, 780)
    axes.set_ylim(0, None)
    axes.set_xlabel("Wavelength / nm")
    axes.set_ylabel("Sensitivity")
    legend_above(figure, entries, columns=4)
    return figure


def _pulls_figure(result: CameraCurvesResult) -> Figure:
    figure = new_figure(170)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=30)
    axes.axhline(0, color=MUTED, linewidth=0.8)
    pulls = (result.patch_value - result.patch_fitted) / result.patch_sigma
    entries = []
    for number, name in enumerate(result.channels):
        colour = channel_colour(name, number)
        x = np.arange(1.0, len(pulls) + 1.0) + 0.2 * (number - 1)
        points(axes, x, pulls[:, number], "o", colour, colour, size=3.0)
        entries.append(line_entry(name, colour))
    axes.set_xlabel("Patch")
    axes.set_ylabel("Difference / σ")
    axes.tick_params(colors=INK)
    legend_above(figure, entries, columns=4)
    return figure
