"""Report of a measurement of irradiance."""

from collections.abc import Iterator
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from labrig.calibration import IrradianceFile
from labrig.foundation.number_format import plus_minus, rounded
from labrig.protocols.irradiance.result import IrradianceResult
from labrig.report.figure_style import (
    INK,
    LEFT_PT,
    MUTED,
    SHADE,
    SMALL_PT,
    error_bars,
    new_figure,
    place,
    points,
    spectral_colours,
)
from labrig.report.sections import Picture, Rendered, Section, Source, Table


def render(result: IrradianceResult, source: Source) -> Rendered:
    """Render the irradiance E of every band along the filter, and its scale from the grey card."""
    return Rendered((_section(result),), tuple(_lines(result.calibration)))


def _section(result: IrradianceResult) -> Section:
    """Return the section with the figures and the table of the irradiance."""
    file = result.calibration
    head = ("Band / nm", *(f"{low:g}" for low in file.bands_nm[:-1]))
    rows = (
        ("Direct", *(rounded(value, 3) for value in file.direct)),
        *(
            (_row_name(file, k), *(rounded(value, 2) for value in file.through[k]))
            for k in range(0, len(file.through), 1 if file.lights else 5)
        ),
    )
    if file.lights:
        parts = (
            "Of the selected lights, the rig file gives the shape and the grey card the scale, "
            f"both with their σ; common to all are {100 * file.scale_sigma:.1f} % more."
        )
        caption = "Irradiance of every band by each light at its mean wavelength, with 1 σ"
        scale = (
            "Measured over expected light of the card for each light: by the measurement alone "
            "(points, 1 σ with the camera's curves), and with the prior of the light (line, band)."
        )
    else:
        parts = (
            "Through the LVF, its calibration gives the shape and the grey card the scale at every "
            f"position, both with their σ; common to all positions are {100 * file.scale_sigma:.1f}"
            " % more."
        )
        caption = "Irradiance of every band along the strip behind the LVF, with 1 σ"
        scale = (
            "Measured light of the card over that expected from the calibration of the LVF: each "
            "position by itself (points, 1 σ with the camera's curves), and with its neighbours "
            "(line and band)."
        )
    return Section(
        "Irradiance on the sample",
        (
            "E of every band is ∫ E dλ over it, scaled so that the lamp by itself has the length "
            f"{rounded(file.vector_length)}: excitation rates belong to that. {parts}",
        ),
        (
            Picture(
                "irradiance",
                partial(_irradiance_figure, result),
                f"{caption}, labelled by the band in nm; where it is less than 2 % of its highest, "
                "it is not drawn.",
            ),
            Picture(
                "scale",
                partial(_scale_figure, result),
                scale,
            ),
        ),
        (Table(head, rows, "Columns begin at the wavelength in their head."),),
    )


def _row_name(file: IrradianceFile, row: int) -> str:
    """Return the name of a place behind the LVF, or of a light."""
    return file.lights[row] if file.lights else f"p{row:02d}"


def _irradiance_figure(result: IrradianceResult) -> Figure:
    """Draw the irradiance E of every band along the strip, or by every light."""
    file = result.calibration
    figure = new_figure(240)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=12)
    through, sigma = np.array(file.through), np.array(file.through_sigma)
    position = result.centre_nm if file.lights else np.array(file.position)
    edges_nm = np.array(file.bands_nm)
    colours = spectral_colours((edges_nm[:-1] + edges_nm[1:]) / 2)
    for band, colour in enumerate(colours):
        drawn = through[:, band] > 0.02 * through[:, band].max()
        error_bars(axes, position[drawn], through[drawn, band], sigma[drawn, band], colour)
        axes.plot(position[drawn], through[drawn, band], color=colour, linewidth=1.0)
        peak = int(np.argmax(through[:, band]))
        axes.annotate(
            f"{edges_nm[band]:.0f}–\n{edges_nm[band + 1]:.0f}",
            (position[peak], through[peak, band]),
            (0, 5),
            textcoords="offset points",
            ha="center",
            fontsize=SMALL_PT - 1,
            color=colour,
        )
    axes.set_ylim(0, 1.2 * float(through.max()))
    axes.set_xlabel(
        "Mean wavelength of the light / nm" if file.lights else "Position from blue end to red end"
    )
    axes.set_ylabel("Irradiance E")
    return figure


def _scale_figure(result: IrradianceResult) -> Figure:
    """Draw measured over expected light of the card by the wavelength of the position."""
    scale, centre_nm = result.scale, result.centre_nm
    figure = new_figure(200)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=12)
    sigma = scale.relative_sigma
    low, high = scale.value * np.exp(-sigma), scale.value * np.exp(sigma)
    axes.fill_between(centre_nm, low, high, color=SHADE, linewidth=0)
    axes.plot(centre_nm, scale.value, color=MUTED, linewidth=1.2)
    measured_sigma = scale.measured * scale.measured_sigma
    error_bars(axes, centre_nm, scale.measured, measured_sigma, INK)
    points(axes, centre_nm, scale.measured, "o", INK, INK, size=3.0)
    # Single positions in the violet may be far off: their bars may leave the figure.
    axes.set_ylim(0, 2 * float(np.median(scale.value)))
    axes.set_xlabel("Wavelength / nm")
    axes.set_ylabel("Measured / expected")
    return figure


def _lines(file: IrradianceFile) -> Iterator[str]:
    """Yield the lines for the terminal: E of the lamp, and at three positions or of all lights."""
    direct = ", ".join(rounded(value, 3) for value in file.direct)
    yield f"the lamp by itself, E per band: {direct} (length {rounded(file.vector_length)})"
    rows = len(file.through)
    for k in range(rows) if file.lights else (0, rows // 2, rows - 1):
        band = int(np.argmax(file.through[k]))
        low, high = file.bands_nm[band : band + 2]
        peak = plus_minus(file.through[k][band], file.through_sigma[k][band])
        yield (
            f"{_row_name(file, k)}: E {peak} in {low:g}-{high:g} nm; direct : through "
            f"{plus_minus(file.ratio[k], file.ratio_sigma[k])}"
        )
