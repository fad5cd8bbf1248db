"""Report of the test whether all bands excite the same glow."""

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from labrig.report.figure_style import (
    INK,
    LEFT_PT,
    MARKERS,
    MUTED,
    OTHER_CHANNELS,
    error_bars,
    legend_above,
    marker_entry,
    new_figure,
    place,
    points,
)
from labrig.report.sections import Picture
from labrig.results import BandTests

#: Height of a panel, distance of panels, and margin above them in points.
PANEL_PT, GAP_PT, TOP_PT = 84.0, 12.0, 30.0
#: Shift of one channel against the one before in nm, and largest σ in % that is drawn.
SHIFT_NM, DRAWN_PERCENT = 4.0, 50.0


def band_lines(tests: BandTests | None) -> Iterator[str]:
    """Yield the verdicts of the tests, a line each."""
    if tests is None:
        yield "one glow for all bands: not tested, one band excites all places"
        return
    quantities = {
        "glow at full charge": tests.amplitude,
        "decay": tests.rate,
        "hue": tests.hue,
    }
    verdicts = [
        f"{name} {'differs' if quantity.differs else 'the same'} (p = {quantity.p_value:.2g})"
        for name, quantity in quantities.items()
        if quantity is not None
    ]
    yield f"by exciting band: {', '.join(verdicts)}"


def band_picture(tests: BandTests, bands_nm: tuple[float, ...], channels: Sequence[str]) -> Picture:
    """Return the figure of the quantities over the exciting band, with its caption.

    Parameters
    ----------
    tests
        Tests of a fit.
    bands_nm
        Edges of all bands in nm.
    channels
        Channels whose hue is tested.
    """
    return Picture(
        "exciting-bands",
        partial(_figure, tests, bands_nm, channels),
        "Glow at full charge, rates of the decay, and channels over the brightest one, at the "
        "places that each band excites, relative to the values common to all; bars: 1 σ with all "
        "parameters free. All lie at 0 in a thin layer whose traps no light empties.",
    )


def _figure(tests: BandTests, bands_nm: tuple[float, ...], channels: Sequence[str]) -> Figure:
    edges = np.array(bands_nm)
    middle_nm = ((edges[1:] + edges[:-1]) / 2)[tests.bands]
    panels = {"Full charge / %": tests.amplitude, "Decay / %": tests.rate, "Hue / %": tests.hue}
    drawn = {label: quantity for label, quantity in panels.items() if quantity is not None}
    height_pt = TOP_PT + len(drawn) * (PANEL_PT + GAP_PT) + 38 - GAP_PT
    figure = new_figure(height_pt)
    for number, (label, quantity) in enumerate(drawn.items()):
        top = TOP_PT + number * (PANEL_PT + GAP_PT)
        axes = place(figure, left=LEFT_PT, bottom=height_pt - top - PANEL_PT, right=12, top=top)
        axes.axhline(0, color=MUTED, linewidth=1.2)
        axes.set_xlim(edges[0], edges[-1])
        axes.set_ylabel(label)
        is_last = number == len(drawn) - 1
        axes.tick_params(labelbottom=is_last)
        if is_last:
            axes.set_xlabel("Excitation wavelength / nm")
        for row, (value, sigma) in enumerate(
            zip(100 * quantity.deviation, 100 * quantity.sigma, strict=True)
        ):
            known, colour, x = sigma < DRAWN_PERCENT, _colour(row), middle_nm + SHIFT_NM * row
            error_bars(axes, x[known], value[known], sigma[known], colour)
            points(axes, x[known], value[known], MARKERS[row], colour, colour)
    entries = [
        marker_entry(f"{name} over the brightest", MARKERS[row], _colour(row))
        for row, name in enumerate(channels)
    ]
    if entries:
        legend_above(figure, entries, columns=3)
    return figure


def _colour(row: int) -> str:
    return (INK, *OTHER_CHANNELS)[row % (1 + len(OTHER_CHANNELS))]
