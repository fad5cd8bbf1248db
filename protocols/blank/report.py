"""Report of a blank: background and stray light."""

from collections.abc import Iterator
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from labrig.calibration import BlankFile
from labrig.foundation.number_format import plus_minus, rounded
from labrig.protocols.blank.result import BlankResult
from labrig.report.figure_style import (
    DASHED,
    LEFT_PT,
    MARKERS,
    MUTED,
    PAPER,
    channel_colour,
    error_bars,
    legend_above,
    line_entry,
    marker_entry,
    new_figure,
    place,
    points,
)
from labrig.report.sections import Picture, Rendered, Section, Source, Table

HEIGHT_PT = 250.0


def render(result: BlankResult, source: Source) -> Rendered:
    """Render the stray light over time and the constant background of each channel."""
    return Rendered((_section(result),), tuple(_lines(result.calibration)))


def _section(result: BlankResult) -> Section:
    """Return the section with the figure of the light and the table of its levels."""
    file, channels = result.calibration, result.calibration.channels
    rows = tuple(
        (
            name,
            plus_minus(file.constant_dn_per_s[number], file.constant_dn_per_s_sigma[number]),
            plus_minus(file.ambient_dn_per_s[number], file.ambient_dn_per_s_sigma[number]),
        )
        for number, name in enumerate(channels)
    )
    clean = file.first_clean_s
    transient_text = (
        "No frame is free of fading light within the sequence."
        if clean is None
        else f"Frames that begin {rounded(clean, 3)} s or later after lamp off are free of the "
        "lamp's turn-off transient."
    )
    return Section(
        "Background and stray light",
        (
            transient_text,
            "Background is constant light after lamp off that dark frames do not show. Stray light "
            "is in both, and dark frames subtract it as long as it is constant; its colour "
            "distinguishes it from dark current, so that its figure is a lower limit.",
        ),
        (
            Picture(
                "blank",
                partial(_figure, result),
                "Light of the blank over time; bars are ± 1 σ.",
            ),
        ),
        (Table(("Channel", "Background / (DN/s)", "Stray light / (DN/s)"), rows),),
    )


def _figure(result: BlankResult) -> Figure:
    """Draw the signal above background of each frame of the blank, in DN/s."""
    file, stray, channels = result.calibration, result.stray_light, result.calibration.channels
    figure = new_figure(HEIGHT_PT)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=46)
    axes.set_xscale("log")
    least_level = 4 * float(np.median(stray.sigma))
    axes.set_yscale("symlog", linthresh=10.0 ** np.ceil(np.log10(least_level)))
    axes.axhline(0, color=MUTED, linewidth=0.8)
    entries = []
    for number, name in enumerate(channels):
        colour, marker = channel_colour(name, number), MARKERS[number % len(MARKERS)]
        error_bars(axes, stray.start_s, stray.rate[:, number], stray.sigma[:, number], colour)
        points(axes, stray.start_s, stray.rate[:, number], marker, colour, PAPER)
        entries.append(marker_entry(name, marker, colour, PAPER))
    if file.first_clean_s is not None:
        axes.axvline(file.first_clean_s, color=MUTED, linewidth=1.0, linestyle=DASHED)
        entries.append(line_entry("end of the transient", MUTED, DASHED))
    axes.set_xlabel("Start of the exposure after lamp off / s")
    axes.set_ylabel("Signal above background / (DN/s)")
    legend_above(figure, entries, columns=4)
    return figure


def _lines(file: BlankFile) -> Iterator[str]:
    """Yield the lines for the terminal."""
    clean = file.first_clean_s
    yield (
        "never free of the turn-off transient"
        if clean is None
        else f"free of the turn-off transient from {rounded(clean, 3)} s after lamp off"
    )
    for name, level, sigma in (
        ("background", file.constant_dn_per_s, file.constant_dn_per_s_sigma),
        ("stray light", file.ambient_dn_per_s, file.ambient_dn_per_s_sigma),
    ):
        channel_levels = zip(file.channels, level, sigma, strict=True)
        yield f"{name}: {', '.join(f'{n} {plus_minus(v, s)}' for n, v, s in channel_levels)} DN/s"
