"""Figures of a mixture beside the re-radiation matrix for which it stands."""

import math
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from labrig.fit import MixtureFit
from labrig.foundation.arrays import FloatArray
from labrig.foundation.number_format import power_of_ten
from labrig.material import ConditionalDensity, ReradiationMatrix
from labrig.report.chart import (
    Axis,
    Chart,
    ErrorBars,
    Line,
    Mark,
    Panel,
    Points,
    linear_axis,
    logarithmic_axis,
)
from labrig.report.figure_style import (
    DASHED,
    INK,
    MUTED,
    OTHER_CHANNELS,
    PAPER,
    RULE,
)
from labrig.report.mixture import FittedMatrix
from labrig.report.reradiation_figures import (
    BAND_NM,
    HEAT_HEIGHT_PT,
    INCIDENT,
    LEGEND_MARGINS,
    SPECTRA_HEIGHT_PT,
    MatrixSpectrum,
    emission_spectra,
    excitation_spectra,
    heat_figure,
    largest,
    limits,
    shown_values,
    spectra_chart,
)
from labrig.report.sections import Picture

# matplotlib is slow to load.
if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

HEIGHT_PT = 256.0
#: End of the scale of differences, of the strongest re-radiation.
APART = 0.25
#: Least error on a logarithmic axis.
MIN_MSE = 1e-15
ELLIPSE_POINTS = 73
#: Points of a curve of a density.
CURVE_POINTS = 401


def matrix_pictures(fitted: FittedMatrix) -> tuple[Picture, ...]:
    """Return the pictures of the matrix, the mixture, their difference and their columns' sums."""
    matrix = fitted.matrix
    measured, mixed = shown_values(matrix), shown_values(fitted.model)
    top = max(largest(measured), largest(mixed), 1e-12)
    apart = APART * top
    draw = partial(_heat_figure, matrix)
    return (
        Picture(
            "measured",
            partial(draw, measured, (0.0, top), "magma_r", None),
            f"Measured re-radiation per {BAND_NM:g} nm.",
        ),
        Picture(
            "mixture",
            partial(draw, mixed, (0.0, top), "magma_r", fitted.fit),
            f"The mixture, per {BAND_NM:g} nm. Ellipses: 1 σ of each component.",
        ),
        Picture(
            "difference",
            partial(draw, measured - mixed, (-apart, apart), "RdBu_r", fitted.fit),
            f"Measured less mixture; the scale ends at {100 * APART:g} % of the strongest "
            "re-radiation. A stripe along the diagonal is light that spills past both "
            "monochromators, unless that was corrected.",
        ),
        Picture(
            "fraction",
            _fraction_chart(fitted),
            f"{_fraction_text(matrix)} by incident wavelength"
            + ("" if matrix.reradiation_sigma is None else "; bars: 1 σ")
            + ".",
        ),
    )


def spectra_pictures(fitted: FittedMatrix) -> tuple[Picture, ...]:
    """Return the pictures of emission and excitation spectra, and of a density of each."""
    matrix, model, mixture = fitted.matrix, fitted.model, fitted.fit.mixture
    directions = (
        _Direction(
            "emission",
            ("incident", "returning"),
            tuple(emission_spectra(matrix, model)),
            matrix.output_edges_nm,
            mixture.output_given_input,
        ),
        _Direction(
            "excitation",
            ("returning", "incident"),
            tuple(excitation_spectra(matrix, model)),
            matrix.input_edges_nm,
            mixture.input_given_output,
        ),
    )
    return tuple(
        picture
        for direction in directions
        if direction.spectra
        for picture in (_spectra_picture(direction), _density_picture(direction))
    )


@dataclass(frozen=True, eq=False)
class _Direction:
    """Spectra over one wavelength, given the other.

    Attributes
    ----------
    name
        Of the spectra.
    wavelengths
        Names of the given wavelength and of the other.
    spectra
        Columns or rows of the matrix.
    edges_nm
        Edges of the bands of the other wavelength.
    conditional
        Density of the other wavelength.
    """

    name: str
    wavelengths: tuple[str, str]
    spectra: tuple[MatrixSpectrum, ...]
    edges_nm: FloatArray
    conditional: ConditionalDensity

    @property
    def label(self) -> str:
        """Label of the axis of the other wavelength."""
        return f"{self.wavelengths[1].capitalize()} wavelength / nm"


def error_pictures(fitted: FittedMatrix) -> tuple[Picture, ...]:
    """Return the pictures of error and criterion against the number of components."""
    fit, candidates = fitted.fit, fitted.candidates
    numbers = np.array([tried.components for tried in candidates], dtype=np.float64)
    if len(numbers) < 2:
        return ()
    bic = np.array([tried.bic for tried in candidates])
    return (
        _error_picture(fitted, numbers),
        Picture(
            "bic",
            _number_chart(numbers, bic, fit.components, "Bayesian information criterion"),
            "Bayesian information criterion: the least is best.",
        ),
    )


def _error_picture(fitted: FittedMatrix, numbers: FloatArray) -> Picture:
    """Return the picture of χ² where σ weighs the numbers, else of the mean squared error."""
    fit, candidates = fitted.fit, fitted.candidates
    chi2 = [tried.reduced_chi2 for tried in candidates if tried.reduced_chi2 is not None]
    if len(chi2) == len(candidates):
        return Picture(
            "error",
            _number_chart(numbers, np.array(chi2), fit.components, "Reduced χ²"),
            "Reduced χ² by the number of components, its scale that of least error: 1 if nothing "
            "but noise is left.",
        )
    noise = noise_floor(fitted.matrix)
    about_noise = (
        ""
        if noise is None
        else " Dashed: mean σ² of the measured numbers, of which those below the threshold are "
        "taken as 0."
    )
    mse = np.array([tried.masked_mse for tried in candidates])
    return Picture(
        "error",
        _error_chart(numbers, mse, fit, noise),
        "Mean squared error per band² by the number of components, its scale that of least error."
        + about_noise,
    )


def noise_floor(matrix: ReradiationMatrix) -> float | None:
    """Return the mean σ² per band of the entries on the Stokes side; None if it is not known."""
    if matrix.reradiation_sigma is None:
        return None
    sigma = (matrix.reradiation_sigma * matrix.output_width_nm[:, np.newaxis])[matrix.is_stokes]
    known = sigma[np.isfinite(sigma)]
    return float(np.mean(known**2)) if known.any() else None


def _heat_figure(
    matrix: ReradiationMatrix,
    values: FloatArray,
    ends: tuple[float, float],
    colours: str,
    fit: MixtureFit | None,
) -> "Figure":
    """Draw values (n, m) on the bands of a matrix, with ellipses of a fit's components."""
    figure, axes = heat_figure(matrix, values, ends, colours)
    if fit is not None:
        _draw_ellipses(axes, fit)
    return figure


def _draw_ellipses(axes: "Axes", fit: MixtureFit) -> None:
    """Draw the ellipse of 1 σ of each component."""
    angle = np.linspace(0, 2 * np.pi, ELLIPSE_POINTS)
    circle = np.stack([np.cos(angle), np.sin(angle)])
    for mean, covariance in zip(fit.mixture.mean_nm, fit.mixture.covariance_nm2, strict=True):
        ellipse = mean[:, np.newaxis] + np.linalg.cholesky(covariance) @ circle
        # A dark line in a light one is seen on any colour.
        axes.plot(*ellipse, color=PAPER, linewidth=2.4)
        axes.plot(*ellipse, color=INK, linewidth=1.0)


def _fraction_chart(fitted: FittedMatrix) -> Chart:
    """Return the chart of the fraction that is re-radiated, of each incident wavelength."""
    matrix, nm = fitted.matrix, fitted.matrix.input_nm
    fraction, sigma = matrix.reradiated_fraction, matrix.reradiated_fraction_sigma
    modelled = fitted.model.reradiated_fraction
    left, right = matrix.input_edges_nm[[0, -1]].tolist()
    marks: list[Mark] = [Line(RULE, np.array([left, right]), np.zeros(2))]
    if sigma is not None:
        marks.append(ErrorBars(INK, nm, fraction, sigma))
    points, line = Points(INK, nm, fraction, size_pt=2.8), Line(OTHER_CHANNELS[3], nm, modelled)
    panel = Panel(
        linear_axis(INCIDENT, left, right),
        linear_axis(_fraction_text(matrix), *limits(fraction, modelled)),
        (*marks, points, line),
    )
    legend = (("measured", points), ("mixture", line))
    return Chart((panel,), HEAT_HEIGHT_PT, legend=legend)


def _fraction_text(matrix: ReradiationMatrix) -> str:
    return "Fraction re-radiated" if matrix.unit == "1/nm" else "Re-radiated light, relative"


def _spectra_picture(direction: _Direction) -> Picture:
    """Return the picture of several spectra, measured and of the mixture."""
    bars = "" if direction.spectra[0].sigma is None else "; bars: 1 σ"
    return Picture(
        direction.name,
        spectra_chart(direction.spectra, direction.label),
        f"{direction.name.capitalize()} spectra at the {direction.wavelengths[0]} wavelengths in "
        f"the legend: measured (points{bars}), and of the mixture (lines).",
    )


def _density_picture(direction: _Direction) -> Picture:
    """Return the picture of the density of one wavelength, given the other."""
    given, other = direction.wavelengths
    strongest = max(direction.spectra, key=lambda spectrum: float(spectrum.value.sum()))
    nm, light = strongest.wavelength_nm, float(strongest.value @ strongest.width_nm)
    density = strongest.value / light
    left, right = direction.edges_nm[[0, -1]].tolist()
    curve_nm = np.linspace(left, right, CURVE_POINTS)
    curve = direction.conditional.pdf(curve_nm, strongest.given_nm)
    marks: list[Mark] = [Line(RULE, np.array([left, right]), np.zeros(2))]
    if strongest.sigma is not None:
        marks.append(ErrorBars(INK, nm, density, strongest.sigma / light))
    points, line = Points(INK, nm, density, size_pt=2.8), Line(OTHER_CHANNELS[3], curve_nm, curve)
    panel = Panel(
        linear_axis(direction.label, left, right),
        linear_axis("Density / nm⁻¹", *limits(density, curve)),
        (*marks, points, line),
        LEGEND_MARGINS,
    )
    legend = (("measured, integral 1", points), ("mixture", line))
    return Picture(
        f"{direction.name}-density",
        Chart((panel,), SPECTRA_HEIGHT_PT, legend=legend),
        f"Probability density of the {other} wavelength, given the {given} one of "
        f"{strongest.given_nm:g} nm, from which wavelengths are drawn.",
    )


def _error_chart(
    numbers: FloatArray, mse: FloatArray, fit: MixtureFit, noise: float | None
) -> Chart:
    """Return the chart of the error against the number of components."""
    exponent = math.floor(math.log10(max(float(mse.min()), MIN_MSE)))
    unit = 10.0**exponent
    marks, legend = _number_marks(numbers, mse / unit, fit.components)
    before = Points(
        OTHER_CHANNELS[3],
        np.array([float(fit.components)]),
        np.array([fit.likelihood_mse / unit]),
        marker="D",
        size_pt=5.0,
    )
    marks += (before,)
    legend += (("expectation maximisation alone", before),)
    every = [*mse.tolist(), fit.likelihood_mse]
    ends = numbers[0] - 0.5, numbers[-1] + 0.5
    if noise is not None:
        line = Line(MUTED, np.array(ends), np.full(2, noise / unit), style=DASHED)
        marks, legend = (line, *marks), (*legend, ("noise", line))
        every.append(noise)
    low, high = max(min(every), MIN_MSE) / unit, max(*every, MIN_MSE) / unit
    panel = Panel(
        _number_axis(*ends),
        logarithmic_axis(f"Mean squared error / {power_of_ten(exponent)}", low / 1.6, high * 1.6),
        marks,
        LEGEND_MARGINS,
    )
    return Chart((panel,), HEIGHT_PT, legend=legend, columns=2)


def _number_chart(numbers: FloatArray, values: FloatArray, chosen: int, label: str) -> Chart:
    """Return the chart of a criterion against the number of components."""
    marks, legend = _number_marks(numbers, values, chosen)
    low, high = float(values.min()), float(values.max())
    room = 0.1 * (high - low) or 1.0
    axis = _number_axis(numbers[0] - 0.5, numbers[-1] + 0.5)
    panel = Panel(axis, linear_axis(label, low - room, high + room, most=6), marks, LEGEND_MARGINS)
    return Chart((panel,), HEIGHT_PT, legend=legend)


def _number_axis(low: float, high: float) -> Axis:
    ticks = tuple(
        (float(number), str(number)) for number in range(round(low + 0.5), round(high + 0.5))
    )
    return Axis("Number of components", low, high, ticks)


def _number_marks(
    numbers: FloatArray, values: FloatArray, chosen: int
) -> tuple[tuple[Mark, ...], tuple[tuple[str, Mark], ...]]:
    """Return marks and legend of values by the number of components, the chosen one filled."""
    is_chosen = numbers == chosen
    line = Line(INK, numbers, values, width_pt=0.8)
    others = Points(INK, numbers[~is_chosen], values[~is_chosen], face=PAPER, size_pt=5.0)
    this = Points(INK, numbers[is_chosen], values[is_chosen], size_pt=5.0)
    return (line, others, this), (("tried", others), ("taken", this))
