"""Charts of a re-radiation matrix: as a picture, and its emission and excitation spectra."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from labrig.foundation.arrays import BoolArray, FloatArray
from labrig.material import ReradiationMatrix
from labrig.report.chart import (
    Band,
    Chart,
    ErrorBars,
    Line,
    Margins,
    Mark,
    Panel,
    Points,
    linear_axis,
)
from labrig.report.figure_style import INK, MUTED, OTHER_CHANNELS, RULE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import QuadMesh
    from matplotlib.figure import Figure


#: Width in nm of the bands for which re-radiation is shown, as in the instruments' files.
BAND_NM = 10.0
#: Colour of entries on and beyond the diagonal, and of those that were not measured.
EMPTY = "#eceff1"
INCIDENT, RETURNING = "Incident wavelength / nm", "Returning wavelength / nm"
#: Height of a matrix in a report, room for the colour bar on its right, and the bar's width.
HEAT_HEIGHT_PT, BAR_ROOM_PT, BAR_PT = 330.0, 74.0, 11.0


def shown_values(matrix: ReradiationMatrix) -> FloatArray:
    """Return the re-radiation per 10 nm, NaN on and beyond the diagonal, shape (n, m)."""
    return np.where(matrix.is_stokes, BAND_NM * matrix.reradiation, np.nan)


def largest(values: FloatArray) -> float:
    """Return the largest value, 0 where nothing was measured."""
    return float(np.nanmax(values)) if np.isfinite(values).any() else 0.0


def draw_heat(
    axes: "Axes",
    matrix: ReradiationMatrix,
    values: FloatArray,
    limits: tuple[float, float],
    colours: str = "magma_r",
) -> "QuadMesh":
    """Draw values (n, m) on the bands of a matrix."""
    return axes.pcolormesh(
        matrix.input_edges_nm, matrix.output_edges_nm, values, cmap=colours, vmin=limits[0],
        vmax=limits[1], rasterized=True,
    )  # fmt: skip


def label_heat(axes: "Axes", title: str) -> None:
    """Name both axes of a matrix."""
    axes.set_facecolor(EMPTY)
    axes.set(xlabel="incident wavelength / nm", ylabel="returning wavelength / nm")
    axes.set_title(title, fontsize="medium", color=INK)


def heat_figure(
    matrix: ReradiationMatrix,
    values: FloatArray,
    limits: tuple[float, float],
    colours: str = "magma_r",
) -> "tuple[Figure, Axes]":
    """Draw values (n, m) on the bands of a matrix as a figure of a report, with a colour bar."""
    from labrig.report.figure_style import LEFT_PT, SHADE, new_figure, place

    figure = new_figure(HEAT_HEIGHT_PT)
    axes = place(figure, left=LEFT_PT, bottom=38, right=BAR_ROOM_PT, top=12)
    axes.grid(visible=False)
    axes.set_facecolor(SHADE)
    mesh = draw_heat(axes, matrix, values, limits, colours)
    axes.set(xlim=matrix.input_edges_nm[[0, -1]], ylim=matrix.output_edges_nm[[0, -1]])
    axes.set(xlabel=INCIDENT, ylabel=RETURNING)
    bar_left = figure.get_figwidth() * 72 - BAR_ROOM_PT + 8
    beside = place(figure, left=bar_left, bottom=38, right=BAR_ROOM_PT - 8 - BAR_PT, top=12)
    bar = figure.colorbar(mesh, cax=beside)
    bar.outline.set_visible(False)
    beside.grid(visible=False)
    return figure, axes


#: Least distance in nm of two wavelengths whose spectra are drawn.
APART_NM = 40.0
#: Part of the strongest spectrum below which none is drawn.
WEAKEST = 0.05
SPECTRA_HEIGHT_PT = 280.0
#: Room above and below the values, of their range.
ROOM = 0.05
LEGEND_COLUMNS = 4
#: Margins of axes below a legend of two rows.
LEGEND_MARGINS = Margins(top=46.0)


@dataclass(frozen=True, eq=False)
class MatrixSpectrum:
    """Re-radiation per 10 nm of output: a column of a matrix, or a row.

    Attributes
    ----------
    given_nm
        Wavelength in nm of the column or of the row.
    wavelength_nm
        The others, rising: those on the Stokes side that were measured, shape (n,).
    width_nm
        Widths of their bands in nm, shape (n,).
    value
        Measured re-radiation, shape (n,).
    sigma
        One standard deviation of `value`; None if it is not known.
    model
        Re-radiation of a mixture; None without one.
    """

    given_nm: float
    wavelength_nm: FloatArray
    width_nm: FloatArray
    value: FloatArray
    sigma: FloatArray | None
    model: FloatArray | None


def emission_spectra(
    matrix: ReradiationMatrix, model: ReradiationMatrix | None = None
) -> list[MatrixSpectrum]:
    """Return the columns of the strongest excitations, which are not neighbours."""
    stokes, grid = matrix.is_stokes, (matrix.output_nm, matrix.output_width_nm)
    return [
        _spectrum(matrix, model, np.s_[:, k], stokes[:, k], matrix.input_nm[k], grid)
        for k in _strongest(matrix.reradiated_fraction, matrix.input_nm)
    ]


def excitation_spectra(
    matrix: ReradiationMatrix, model: ReradiationMatrix | None = None
) -> list[MatrixSpectrum]:
    """Return the rows of the strongest emissions, which are not neighbours."""
    stokes, grid = matrix.is_stokes, (matrix.input_nm, matrix.input_width_nm)
    light = np.where(stokes, np.nan_to_num(matrix.reradiation), 0.0) @ matrix.input_width_nm
    return [
        _spectrum(matrix, model, np.s_[k], stokes[k], matrix.output_nm[k], grid)
        for k in _strongest(light, matrix.output_nm)
    ]


def _strongest(light: FloatArray, wavelength_nm: FloatArray) -> list[int]:
    """Return the places of much light that are not neighbours, by wavelength."""
    chosen: list[int] = []
    for index in np.argsort(-light):
        is_far = all(abs(wavelength_nm[index] - wavelength_nm[k]) >= APART_NM for k in chosen)
        if is_far and len(chosen) < len(OTHER_CHANNELS) and light[index] > WEAKEST * light.max():
            chosen.append(int(index))
    return sorted(chosen)


def _spectrum(
    matrix: ReradiationMatrix,
    model: ReradiationMatrix | None,
    place: tuple[slice, int] | int,
    shown: BoolArray,
    given_nm: float,
    grid: tuple[FloatArray, FloatArray],
) -> MatrixSpectrum:
    """Return a column or a row, with the wavelengths and widths in nm of the bands along it."""
    sigma = matrix.reradiation_sigma
    shown = shown & np.isfinite(matrix.reradiation[place])
    return MatrixSpectrum(
        float(given_nm),
        grid[0][shown],
        grid[1][shown],
        BAND_NM * matrix.reradiation[place][shown],
        None if sigma is None else BAND_NM * sigma[place][shown],
        None if model is None else BAND_NM * model.reradiation[place][shown],
    )


def spectra_marks(spectra: Sequence[MatrixSpectrum]) -> Iterator[tuple[str, Mark]]:
    """Yield label and mark of each spectrum; only what belongs into a legend has a label.

    What is measured is a line in a band of ± 1 σ; beside a mixture, which is a line itself, it is
    points with bars.
    """
    for colour, spectrum in zip(OTHER_CHANNELS, spectra, strict=False):
        nm, value, sigma = spectrum.wavelength_nm, spectrum.value, spectrum.sigma
        label = f"{spectrum.given_nm:g} nm"
        if spectrum.model is None:
            if sigma is not None:
                yield "", Band(colour, nm, value - sigma, value + sigma)
            yield label, Line(colour, nm, value)
            continue
        if sigma is not None:
            yield "", ErrorBars(colour, nm, value, sigma)
        yield "", Points(colour, nm, value, size_pt=2.6)
        yield label, Line(colour, nm, spectrum.model)


def spectra_chart(spectra: Sequence[MatrixSpectrum], x_label: str) -> Chart:
    """Return the chart of spectra, measured and of a mixture."""
    labelled = tuple(spectra_marks(spectra))
    values = [spectrum.value for spectrum in spectra]
    values += [
        spectrum.value + spectrum.sigma for spectrum in spectra if spectrum.sigma is not None
    ]
    values += [spectrum.model for spectrum in spectra if spectrum.model is not None]
    ends_nm = np.array([spectrum.wavelength_nm[[0, -1]] for spectrum in spectra])
    left, right = float(ends_nm.min()), float(ends_nm.max())
    zero = Line(RULE, np.array([left, right]), np.zeros(2))
    panel = Panel(
        linear_axis(x_label, left, right),
        linear_axis(f"Re-radiation per {BAND_NM:g} nm", *limits(*values)),
        (zero, *(mark for _, mark in labelled)),
        LEGEND_MARGINS,
    )
    legend = tuple((label, mark) for label, mark in labelled if label)
    if any(spectrum.model is not None for spectrum in spectra):
        legend = (*legend, ("measured", Points(MUTED)), ("mixture", Line(MUTED)))
    return Chart((panel,), SPECTRA_HEIGHT_PT, legend=legend, columns=LEGEND_COLUMNS)


def limits(*values: FloatArray) -> tuple[float, float]:
    """Return the ends of an axis with 0 and all values, and some room."""
    every = np.concatenate([np.zeros(1), *values])
    low, high = float(every.min()), float(every.max())
    room = ROOM * (high - low) or 1.0
    return low - room, high + room
