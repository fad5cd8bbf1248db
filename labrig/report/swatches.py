"""The glow of a patch as colour patches over time."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from labrig.report.colours import Screen, css_colour, into_gamut
from labrig.results import Series
from labrig.written_numbers import rounded

FloatArray = NDArray[np.float64]

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
        CSS colour, all times on one exposure; black where there is nothing but noise.
    hue
        CSS colour at full brightness; empty where noise hides it.
    measured
        What was measured: `R 170, G 4200, B 7700 DN/s`.
    fills
        Whether this is the one that just fills the display.
    """

    time: str
    glow: str
    hue: str
    measured: str
    fills: bool


def swatches(series: Series, screen: Screen) -> tuple[Swatch, ...]:
    """Of the first unit's usable frames, evenly chosen; empty for other channels than R, G, B."""
    rows = np.flatnonzero(series.usable & (np.array(series.unit) == series.unit[0]))
    if series.channels != _RGB or not len(rows):
        return ()
    rows = rows[np.argsort(series.t_s[rows], kind="stable")]
    if len(rows) > MOST_SWATCHES:
        rows = rows[np.rint(np.linspace(0, len(rows) - 1, MOST_SWATCHES)).astype(int)]
    values, sigma = series.values[rows], series.sigma[rows]
    linear = into_gamut(values @ screen.glow.T)
    signal_to_noise = np.sqrt(np.sum((values / sigma) ** 2, axis=1))
    # Without a known σ there is no reason to doubt.
    seen = ~(signal_to_noise < LEAST_FOR_HUE) & (linear.max(axis=1) > 0)
    linear[~seen] = 0.0
    brightest = linear.max(axis=1)
    full = max(float(brightest.max()), 1e-12)
    return tuple(
        Swatch(
            time=rounded(float(series.t_s[row]), 3),
            glow=css_colour(colour / full),
            hue=css_colour(colour / peak) if visible else "",
            measured=_written(series.values[row]),
            fills=peak == full,
        )
        for row, colour, peak, visible in zip(rows, linear, brightest, seen, strict=True)
    )


def _written(values: FloatArray) -> str:
    pairs = zip(_RGB, values, strict=True)
    return ", ".join(f"{name} {rounded(float(value), 3)}" for name, value in pairs) + " DN/s"
