"""What a measurement of irradiance looks like."""

import numpy as np
from matplotlib.figure import Figure

from labrig.analyse.irradiance.scales import FloatArray, Scales
from labrig.calibration import IrradianceFile
from labrig.report.figure_style import (
    INK,
    LEFT_PT,
    MUTED,
    OTHER_CHANNELS,
    SHADE,
    error_bars,
    new_figure,
    place,
    points,
)
from labrig.report.legend import legend_above, lined

_WAVELENGTH = "Wavelength / nm"


def irradiance_figure(file: IrradianceFile) -> Figure:
    """E of every band along the strip, and of the lamp by itself in the same scale."""
    figure = new_figure(240)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=46)
    through, sigma = np.array(file.through), np.array(file.through_sigma)
    position = np.array(file.position)
    entries = []
    for band, (low, high) in enumerate(zip(file.bands_nm[:-1], file.bands_nm[1:], strict=True)):
        colour = OTHER_CHANNELS[band % len(OTHER_CHANNELS)]
        seen = through[:, band] > 0.02 * through[:, band].max()
        error_bars(axes, position[seen], through[seen, band], sigma[seen, band], colour)
        axes.plot(position[seen], through[seen, band], color=colour, linewidth=1.0)
        entries.append(lined(f"{low:.0f}–{high:.0f} nm", colour))
    axes.set_ylim(0, None)
    axes.set_xlabel("Position from blue end to red end")
    axes.set_ylabel("Irradiance E")
    legend_above(figure, entries, columns=4)
    return figure


def scale_figure(file: IrradianceFile, found: Scales, centre_nm: FloatArray) -> Figure:
    """Measured over expected, by the wavelength of the position."""
    figure = new_figure(200)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=12)
    sigma = np.sqrt(np.diag(found.covariance))
    low, high = found.value * np.exp(-sigma), found.value * np.exp(sigma)
    axes.fill_between(centre_nm, low, high, color=SHADE, linewidth=0)
    axes.plot(centre_nm, found.value, color=MUTED, linewidth=1.2)
    unsure = found.measured * found.measured_sigma
    error_bars(axes, centre_nm, found.measured, unsure, INK)
    points(axes, centre_nm, found.measured, "o", INK, INK, size=3.0)
    # Single positions in the violet may be far off: their bars may leave the figure.
    axes.set_ylim(0, 2 * float(np.median(found.value)))
    axes.set_xlabel(_WAVELENGTH)
    axes.set_ylabel("Measured / expected")
    return figure
