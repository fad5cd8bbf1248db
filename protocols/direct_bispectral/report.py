"""Report of a directly measured re-radiation matrix: lights, matrix, spectra, reflectance."""

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from labrig.foundation.arrays import BoolArray, FloatArray
from labrig.foundation.detection import DETECTION_SIGMA
from labrig.foundation.number_format import plus_minus
from labrig.material import ReradiationMatrix
from labrig.protocols.direct_bispectral.result import DirectBispectralResult
from labrig.report.chart import Band, Chart, Line, Mark, Panel, Points, linear_axis
from labrig.report.figure_style import (
    DASHED,
    INK,
    LEFT_PT,
    MUTED,
    OTHER_CHANNELS,
    RULE,
    SHADE,
    SOLID,
    LineStyle,
)
from labrig.report.reradiation_figures import (
    BAND_NM,
    LEGEND_MARGINS,
    SPECTRA_HEIGHT_PT,
    draw_heat,
    emission_spectra,
    largest,
    limits,
    shown_values,
    spectra_marks,
)
from labrig.report.sections import Picture, Rendered, Section, Source, Table
from labrig.results import DirectColumns, LightSpectrum

# matplotlib is slow to load.
if TYPE_CHECKING:
    from matplotlib.figure import Figure

HEAT_HEIGHT_PT, HEIGHT_PT = 330.0, 220.0
#: Room for the colour bar on the right, and its width.
BAR_ROOM_PT, BAR_PT = 74.0, 11.0
#: Part of a light in a band below which what comes back there counts as beyond the light.
LITTLE_SHARE = 0.02
#: Largest σ of a number in the picture, of the strongest one.
WORST_SHOWN = 0.1
INCIDENT, RETURNING = "Incident wavelength / nm", "Returning wavelength / nm"


def render(result: DirectBispectralResult, source: Source) -> Rendered:
    """Render the lights, and the matrix of every sample."""
    sections = [_lights_section(result)]
    sections += [_sample_section(name, columns) for name, columns in result.samples.items()]
    lines = [_line(name, columns) for name, columns in result.samples.items()]
    return Rendered(tuple(sections), tuple(lines))


def _line(name: str, columns: DirectColumns) -> str:
    """Return the line for the terminal on the strongest re-radiation of a sample."""
    fraction, sigma = _reradiated(columns)
    most = int(np.argmax(fraction))
    lights = f"{len(columns.lights)} lights, σ of a band {_median_sigma(columns):.1g}"
    if fraction[most] <= DETECTION_SIGMA * sigma[most]:
        return f"{name}: no re-radiation above the noise ({lights})"
    share = plus_minus(100 * fraction[most], 100 * sigma[most])
    return f"{name}: re-radiates up to {share} % of {columns.lights[most]} ({lights})"


def _median_sigma(columns: DirectColumns) -> float:
    return float(np.median(columns.column_sigma))


def _is_beyond(columns: DirectColumns) -> BoolArray:
    """Return whether entries are of longer wavelength than the light and all but free of it."""
    is_longer = columns.output_nm[:, np.newaxis] > columns.input_nm
    return np.isfinite(columns.reradiated) & is_longer & (columns.share < LITTLE_SHARE)


def _reradiated(columns: DirectColumns) -> tuple[FloatArray, FloatArray]:
    """Return the part of each light that is re-radiated beyond its band, and σ, shape (lights,)."""
    is_counted = _is_beyond(columns)
    value = np.where(is_counted, np.nan_to_num(columns.reradiated), 0.0).sum(axis=0)
    sigma = np.where(is_counted, np.nan_to_num(columns.reradiated_sigma), 0.0)
    common = columns.correlation
    variance = (1 - common) * np.square(sigma).sum(axis=0) + common * sigma.sum(axis=0) ** 2
    return value, np.sqrt(variance)


def _lights_section(result: DirectBispectralResult) -> Section:
    lights = result.lights
    rows = tuple(
        (
            light.name,
            f"{light.mean_nm:.1f}",
            f"{light.peak_nm:.1f}",
            f"{light.fwhm_nm:.1f}",
            "" if np.isnan(light.named_nm) else f"{light.named_nm:g}",
            plus_minus(100 * light.beyond, 100 * light.beyond_sigma),
        )
        for light in lights
    )
    head = ("Light", "Mean / nm", "Peak / nm", "FWHM / nm", "Rig file / nm", "Beyond its band / %")
    caption = (
        "Mean wavelength by power; the rig file's peak; light of longer wavelength than the band "
        "on the white reference, of which none should be (1 σ)."
    )
    return Section(
        "Lights",
        (
            "Their spectra are those of the white reference over its reflectance, as measured. "
            f"{_known('the reflectance of the reference', result.reference_sigma)} "
            f"{_known('the scale of the spectrometer', result.scale_sigma)}",
        ),
        (Picture("lights", _lights_chart(lights), "Spectra of the lights, 1 at the peak."),),
        (Table(head, rows, caption),),
    )


def _known(what: str, sigma: float) -> str:
    """Return the sentence on the relative σ of a curve."""
    if np.isnan(sigma):
        return f"For {what} no σ is given: it is taken as exact."
    return f"For {what} a relative σ of {100 * sigma:.2g} % is in the results."


def _lights_chart(lights: Sequence[LightSpectrum]) -> Chart:
    marks = [
        Line(_colour(number), light.wavelength_nm, light.relative, style=_style(number))
        for number, light in enumerate(lights)
    ]
    low = min(float(light.wavelength_nm[0]) for light in lights)
    high = max(float(light.wavelength_nm[-1]) for light in lights)
    panel = Panel(
        linear_axis("Wavelength / nm", low, high), linear_axis("Of the peak", 0.0, 1.05), (*marks,)
    )
    return Chart((panel,), HEIGHT_PT)


def _colour(number: int) -> str:
    return OTHER_CHANNELS[number % len(OTHER_CHANNELS)]


def _style(number: int) -> LineStyle:
    """Return the style of a light's line: dashed where its colour comes for the second time."""
    return SOLID if number // len(OTHER_CHANNELS) % 2 == 0 else DASHED


def _sample_section(name: str, columns: DirectColumns) -> Section:
    text = (
        "A column is the light that comes back over the light that falls in, read under one light "
        "after another. In the light's own band reflected and re-radiated light come together: "
        "there the re-radiation is stated only where another light determines the reflectance, "
        "and σ of the reflectance includes the possible re-radiation.",
    )
    fraction, sigma = _reradiated(columns)
    rows = tuple(_row(columns, number, fraction, sigma) for number in range(len(columns.lights)))
    head = ("Light", "Reflectance", "Re-radiated / %", "Strongest at / nm", "σ of a band")
    caption = (
        "Reflectance at the light's mean wavelength; re-radiated light beyond the light's own band "
        f"(1 σ). {int(np.isnan(columns.reradiated).sum())} of {columns.reradiated.size} numbers of "
        "the re-radiation are not known, since the light itself is there."
    )
    figures = [Picture("columns", _columns_chart(columns), _COLUMNS_CAPTION)]
    if len(columns.lights) > 1:
        matrix = columns.matrix(name)
        figures.insert(0, Picture("matrix", partial(_heat_figure, matrix), _HEAT_CAPTION))
        if emission_spectra(matrix):
            chart = _emission_chart(matrix, columns)
            figures.append(Picture("emission", chart, _EMISSION_CAPTION))
    figures.append(Picture("reflectance", _reflectance_chart(columns), _REFLECTANCE_CAPTION))
    return Section(name, text, tuple(figures), (Table(head, rows, caption),))


_HEAT_CAPTION = (
    f"Measured re-radiation per {BAND_NM:g} nm; a column for each light, as broad as to the middle "
    "between it and its neighbours. Grey: below the diagonal, or with a σ of more than "
    f"{100 * WORST_SHOWN:g} % of the strongest, since the light itself is there."
)
_COLUMNS_CAPTION = (
    "All that comes back of each light per band, as part of the light's power; the band of ± 1 σ "
    "is thinner than the line where it is not seen."
)
_EMISSION_CAPTION = f"Re-radiation per {BAND_NM:g} nm under the strongest excitations; band: ± 1 σ."
_REFLECTANCE_CAPTION = (
    "Reflectance at the wavelengths of the lights; bars: ± 1 σ, possible re-radiation included."
)


def _row(
    columns: DirectColumns, number: int, fraction: FloatArray, sigma: FloatArray
) -> tuple[str, ...]:
    band = int(np.argmin(np.abs(columns.output_nm - columns.input_nm[number])))
    is_known = bool(np.isfinite(columns.reflectance[band]))
    beyond = np.where(_is_beyond(columns)[:, number], columns.reradiated[:, number], np.nan)
    is_seen = fraction[number] > DETECTION_SIGMA * sigma[number]
    return (
        columns.lights[number],
        plus_minus(columns.reflectance[band], columns.reflectance_sigma[band]) if is_known else "",
        plus_minus(100 * fraction[number], 100 * sigma[number]),
        f"{columns.output_nm[int(np.nanargmax(beyond))]:g}" if is_seen else "",
        f"{float(np.median(columns.column_sigma[:, number])):.1g}",
    )


def _heat_figure(matrix: ReradiationMatrix) -> "Figure":
    """Draw the re-radiation on the bands of the matrix."""
    from labrig.report.figure_style import new_figure, place

    values, top = _certain_values(matrix)
    figure = new_figure(HEAT_HEIGHT_PT)
    axes = place(figure, left=LEFT_PT, bottom=38, right=BAR_ROOM_PT, top=12)
    axes.grid(visible=False)
    axes.set_facecolor(SHADE)
    mesh = draw_heat(axes, matrix, values, (0.0, max(top, 1e-12)))
    axes.set(xlim=matrix.input_edges_nm[[0, -1]], ylim=matrix.output_edges_nm[[0, -1]])
    axes.set(xlabel=INCIDENT, ylabel=RETURNING)
    bar_left = figure.get_figwidth() * 72 - BAR_ROOM_PT + 8
    beside = place(figure, left=bar_left, bottom=38, right=BAR_ROOM_PT - 8 - BAR_PT, top=12)
    figure.colorbar(mesh, cax=beside).outline.set_visible(False)
    beside.grid(visible=False)
    return figure


def _certain_values(matrix: ReradiationMatrix) -> tuple[FloatArray, float]:
    """Return the re-radiation without numbers that are hardly known, and the strongest."""
    values, sigma = shown_values(matrix), matrix.reradiation_sigma
    assert sigma is not None
    top = largest(np.where(values > DETECTION_SIGMA * BAND_NM * sigma, values, np.nan))
    is_certain = BAND_NM * sigma <= WORST_SHOWN * max(top, 1e-12)
    return np.where(is_certain, values, np.nan), top


def _columns_chart(columns: DirectColumns) -> Chart:
    """Return the chart of all columns, reflected light included."""
    nm, marks = columns.output_nm, list[Mark]()
    legend: list[tuple[str, Mark]] = []
    for number, name in enumerate(columns.lights):
        colour, style = _colour(number), _style(number)
        value, sigma = columns.column[:, number], columns.column_sigma[:, number]
        marks.append(Band(colour, nm, value - sigma, value + sigma))
        marks.append(Line(colour, nm, value, style=style))
        legend.append((name, Line(colour, style=style)))
    panel = _panel(nm, "Of the light's power per band", marks, [columns.column.ravel()])
    return Chart((panel,), SPECTRA_HEIGHT_PT, legend=tuple(legend), columns=5)


def _emission_chart(matrix: ReradiationMatrix, columns: DirectColumns) -> Chart:
    """Return the chart of the columns of the strongest excitations."""
    spectra = emission_spectra(matrix)
    labelled = tuple(spectra_marks(spectra))
    ends_nm = matrix.output_nm
    values = [spectrum.value for spectrum in spectra]
    marks = [mark for _, mark in labelled]
    panel = _panel(ends_nm, f"Re-radiation per {BAND_NM:g} nm", marks, values)
    names = dict(zip(columns.input_nm.tolist(), columns.lights, strict=True))
    lines = [mark for label, mark in labelled if label]
    legend = tuple(
        (names[spectrum.given_nm], mark) for spectrum, mark in zip(spectra, lines, strict=True)
    )
    return Chart((panel,), SPECTRA_HEIGHT_PT, legend=legend, columns=5)


def _reflectance_chart(columns: DirectColumns) -> Chart:
    """Return the chart of the reflectance, with ± 1 σ."""
    known = np.isfinite(columns.reflectance)
    nm = columns.output_nm[known]
    value, sigma = columns.reflectance[known], columns.reflectance_sigma[known]
    marks: list[Mark] = [
        Line(MUTED, np.repeat(at_nm, 2), np.array([at - one, at + one]), width_pt=0.9)
        for at_nm, at, one in zip(nm, value, sigma, strict=True)
    ]
    marks.append(Points(INK, nm, value))
    panel = _panel(columns.output_nm, "Reflectance", marks, [value - sigma, value + sigma])
    return Chart((panel,), HEIGHT_PT)


def _panel(
    wavelength_nm: FloatArray, label: str, marks: Sequence[Mark], values: Sequence[FloatArray]
) -> Panel:
    """Return axes over the returning wavelength, with a line at 0."""
    left, right = float(wavelength_nm[0]), float(wavelength_nm[-1])
    zero = Line(RULE, np.array([left, right]), np.zeros(2))
    axis = linear_axis(label, *limits(*values))
    return Panel(linear_axis(RETURNING, left, right), axis, (zero, *marks), LEGEND_MARGINS)
