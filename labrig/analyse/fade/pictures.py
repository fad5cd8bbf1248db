"""What a lamp's fade and rise look like."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from labrig.analyse.fade.change import Change
from labrig.analyse.fade.shots import Shots
from labrig.calibration import Change as ChangeTable, FadeFile, Warming
from labrig.report.figure_style import (
    CHANNEL,
    INK,
    LEFT_PT,
    OTHER_CHANNELS,
    new_figure,
    place,
    points,
)
from labrig.report.legend import legend_above, lined
from labrig.report.sections import Picture, Section, Table
from labrig.written_numbers import plus_minus

FloatArray = NDArray[np.float64]

HEIGHT_PT = 250.0
#: Of the bands that are drawn, from blue to red.
COLOURS = (CHANNEL["B"], OTHER_CHANNELS[2], CHANNEL["G"], OTHER_CHANNELS[1], CHANNEL["R"])


def warming_sections(
    found: tuple[Warming, FloatArray, FloatArray] | None,
) -> tuple[Section, ...]:
    """The light while the housing warms, if it was watched."""
    if found is None:
        return ()
    warm, t_s, light = found
    figure = new_figure(180)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=12)
    grid = np.linspace(0, float(t_s.max()), 201)
    axes.plot(grid, 100 * (1 - warm.lacks * np.exp(-grid / warm.warms_s)), color=INK)
    points(axes, t_s, 100 * light, "o", INK, INK, size=3.0)
    axes.set_xlabel("Time after switching on / s")
    axes.set_ylabel("Light / % of warm")
    lacks = plus_minus(100 * warm.lacks, 100 * warm.lacks_sigma)
    text = (
        f"After ten minutes in the dark the lamp lacks {lacks} % of its light; that comes as its "
        f"housing warms, with a time constant of {warm.warms_s:.0f} s. Short charges are that much "
        "weaker."
    )
    caption = "Light on the card, by photograph; line: 1 − d e^(−t/τ)."
    return (Section("How the lamp warms", (text,), (Picture("warming", figure, caption),)),)


def section(file: FadeFile, changes: Mapping[str, tuple[Shots, Change]]) -> Section:
    """The shares over time, and how they were fitted."""
    tables = {"fade": file.fade, "rise": file.rise}
    figures = [
        Picture(
            name,
            _shares(file, table),
            f"The lamp's light over that of the steady lamp during its {name}, in some bands; "
            "pale: ± 1 σ.",
        )
        for name, table in tables.items()
        if table is not None
    ]
    rows = tuple(
        (
            name,
            plus_minus(*change.exponent),
            plus_minus(*(1e3 * value for value in change.lag_s)),
            f"{1e3 * change.best.jitter_s:.1f}",
            f"{change.best.reduced_chi2:.2f}",
            f"{len(shots.start_s)}",
        )
        for name, (shots, change) in changes.items()
    )
    head = ("", "exponent", "lag / ms", "jitter / ms", "χ² per dof", "photographs")
    return Section(
        "How the lamp goes dark and comes on",
        (
            "ln share = −u(t) (550 nm/λ)^p for all wavelengths, u(t) smooth; p is 1 for a glowing "
            "body. What happens before the first shutter opens follows from the share of 1 (or 0) "
            "at the switch and from what comes after.",
        ),
        tuple(figures),
        (Table(head, rows, "Lag: by how much shutters opened later than recorded."),),
    )


def _shares(file: FadeFile, table: ChangeTable) -> Figure:
    figure = new_figure(HEIGHT_PT)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=46)
    share, sigma = np.array(table.share), np.array(table.sigma)
    time_ms = 1e3 * np.array(table.t_s)
    bands = share.shape[1]
    shown = sorted(set(np.linspace(0, bands - 1, min(bands, len(COLOURS))).round().astype(int)))
    entries = []
    for band, colour in zip(shown, COLOURS, strict=False):
        low, high = file.bands_nm[band], file.bands_nm[band + 1]
        axes.fill_between(
            time_ms, share[:, band] - sigma[:, band], share[:, band] + sigma[:, band],
            color=colour, alpha=0.3, linewidth=0,
        )  # fmt: skip
        axes.plot(time_ms, share[:, band], color=colour, linewidth=1.2)
        entries.append(lined(f"{low:g}–{high:g} nm", colour))
    axes.set_xlabel("Time after the switch / ms")
    axes.set_ylabel("Share of the steady lamp")
    legend_above(figure, entries, columns=3)
    return figure
