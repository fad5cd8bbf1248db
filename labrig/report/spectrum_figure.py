"""Figure of an emission spectrum."""

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from labrig.foundation.arrays import FloatArray
from labrig.report.figure_style import (
    BAND_OPACITY,
    INK,
    LEFT_PT,
    band_entry,
    legend_above,
    line_entry,
    new_figure,
    place,
)

HEIGHT_PT = 256.0
WAVELENGTH_LABEL = "Wavelength / nm"
COLUMNS = 4


def spectrum_figure(
    nm: FloatArray,
    value: FloatArray,
    band: tuple[FloatArray, FloatArray] | None,
    names: tuple[str, str],
) -> Figure:
    """Draw an emission spectrum.

    Parameters
    ----------
    nm
        Wavelengths in nm, shape (n,).
    value
        Spectrum with largest value 1, shape (n,).
    band
        Lower and upper limit of the spectrum, each of shape (n,); None if they are not known.
    names
        Names of the spectrum and of the band in the legend.
    """
    figure, axes = spectrum_axes(f"{names[0]} (largest value 1)")
    entries: list[Artist] = [line_entry(names[0], INK)]
    if band is not None:
        axes.fill_between(nm, *band, color=INK, alpha=BAND_OPACITY, linewidth=0)
        entries.append(band_entry(names[1], INK))
    axes.plot(nm, value, color=INK, linewidth=1.4)
    axes.set_ylim(0, 1.05 * float(np.max(value if band is None else band[1])))
    legend_above(figure, entries, COLUMNS)
    return figure


def spectrum_axes(label: str) -> tuple[Figure, Axes]:
    """Return a figure with axes over wavelength; `label` is that of the vertical axis."""
    figure = new_figure(HEIGHT_PT)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=30)
    axes.set_xlabel(WAVELENGTH_LABEL)
    axes.set_ylabel(label)
    axes.set_xlim(395, 705)
    return figure, axes
