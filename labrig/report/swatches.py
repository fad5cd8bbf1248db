"""The glow of a patch as colour patches over time."""

from dataclasses import dataclass

import numpy as np

from labrig.reduce import Series
from labrig.report.colours import Screen, css_colour, into_gamut
from labrig.report.written_numbers import rounded

#: As many as stand side by side on a desktop with a legible time below each.
MOST_SWATCHES = 18
#: Signal-to-noise ratio below which a hue says nothing.
LEAST_FOR_HUE = 5.0
_RGB = ("R", "G", "B")


@dataclass(frozen=True)
class Swatch:
    """The colour at one time.

    Parameters
    ----------
    time
        Seconds after lamp off, written.
    glow
        CSS colour, all times on one exposure.
    hue
        CSS colour at full brightness; empty where noise hides it.
    """

    time: str
    glow: str
    hue: str


def swatches(series: Series, screen: Screen) -> tuple[Swatch, ...]:
    """Of the first unit's usable frames, evenly chosen; empty for other channels than R, G, B."""
    rows = np.flatnonzero(series.usable & (np.array(series.unit) == series.unit[0]))
    if series.channels != _RGB or not len(rows):
        return ()
    rows = rows[np.argsort(series.t_s[rows], kind="stable")]
    if len(rows) > MOST_SWATCHES:
        rows = rows[np.rint(np.linspace(0, len(rows) - 1, MOST_SWATCHES)).astype(int)]
    linear = into_gamut(series.values[rows] @ screen.glow.T)
    brightest = linear.max(axis=1)
    full = max(float(brightest.max()), 1e-12)
    signal_to_noise = np.sqrt(np.sum((series.values[rows] / series.sigma[rows]) ** 2, axis=1))
    return tuple(
        Swatch(
            time=rounded(float(series.t_s[row]), 3),
            glow=css_colour(colour / full),
            # Without a known σ there is no reason to doubt.
            hue="" if noise < LEAST_FOR_HUE or peak <= 0 else css_colour(colour / peak),
        )
        for row, colour, peak, noise in zip(rows, linear, brightest, signal_to_noise, strict=True)
    )
