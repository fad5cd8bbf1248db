"""A mixture beside the re-radiation matrix for which it stands, as text and as a picture."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from labrig.fit import MixtureFit
from labrig.material import ColourDifference, ReradiationMatrix
from labrig.number_format import aligned, rounded
from labrig.report.figure_style import INK, MUTED, figure_style
from labrig.report.heat_map import (
    BAND_NM,
    draw_heat,
    label_heat,
    largest,
    shown_values,
)
from labrig.report.picture_file import require_picture, save_picture
from labrig.report.reradiation import COLUMN_COLOURS, strongest_columns

# matplotlib is slow to load.
if TYPE_CHECKING:
    from matplotlib.axes import Axes

FloatArray = NDArray[np.float64]


def describe_mixture(name: str, fit: MixtureFit, differences: Sequence[ColourDifference]) -> str:
    """Describe a mixture in lines of text.

    Parameters
    ----------
    name
        Name of the material.
    fit
        The fitted mixture.
    differences
        How far the mixture's colours are from the matrix's.

    Returns
    -------
    str
        A line for each component, the errors and how the number of components was found.

    Examples
    --------
    >>> from labrig.fit import fit_mixture
    >>> from labrig.material import read_reradiation
    >>> from labrig.report import describe_mixture
    >>> fit = fit_mixture(read_reradiation("paper.csv"), 2, threshold=1e-3)
    >>> print(describe_mixture("paper", fit, []).splitlines()[0])
    paper: 2 components, as asked for
    """
    chosen = "as asked for" if fit.selection == "given" else "by BIC"
    plural = "" if fit.components == 1 else "s"
    rows = [("weight", "incident / nm", "returning / nm", "σ / nm", "correlation")]
    mixture = fit.mixture
    for weight, mean, covariance in zip(
        mixture.weights, mixture.mean_nm, mixture.covariance_nm2, strict=True
    ):
        sd = np.sqrt(np.diag(covariance))
        rows.append(
            (
                f"{weight:.3f}",
                f"{mean[0]:.1f}",
                f"{mean[1]:.1f}",
                f"{sd[0]:.1f}, {sd[1]:.1f}",
                f"{covariance[0, 1] / sd.prod():+.2f}",
            )
        )
    lines = [f"{name}: {fit.components} component{plural}, {chosen}"]
    lines += [f"  {line}" for line in aligned(rows)]
    rate = (
        "given"
        if fit.false_discovery_rate is None
        else f"{100 * fit.false_discovery_rate:g} % of what is kept is noise"
    )
    lines += [
        f"  threshold     {rounded(fit.threshold, 3)} per band, {rate}; {fit.kept_entries} of "
        f"{fit.entries} numbers kept",
        f"  masked MSE    {rounded(fit.masked_mse, 3)} per band² (scale by {fit.scaling})",
    ]
    if fit.selection == "bic":
        tried = ", ".join(f"{one.components}: {one.bic:.0f}" for one in fit.candidates)
        lines.append(f"  BIC           {tried}")
    if not fit.converged:
        lines.append("  The refinement ended before it reached a minimum.")
    if differences:
        lines += [f"  {line}" for line in difference_lines(differences)]
    return "\n".join(lines)


def difference_lines(differences: Sequence[ColourDifference]) -> Iterator[str]:
    """Yield a table of colour differences, line by line.

    Parameters
    ----------
    differences
        Differences under one light each.

    Yields
    ------
    str
        The head, then a line for each light.

    Examples
    --------
    >>> from labrig.material import ColourDifference
    >>> from labrig.report import difference_lines
    >>> for line in difference_lines([ColourDifference("D65", "light", 0.5, 0.01)]):
    ...     print(line)
    light         ΔE2000   XYZ error  white
    D65             0.50       1.00%  under the light
    """
    yield f"{'light':12}{'ΔE2000':>8}{'XYZ error':>12}  white"
    for one in differences:
        white = "under the light" if one.white == "light" else "D65, the reference at Y = 50 %"
        yield f"{one.light:12}{one.delta_e:8.2f}{one.xyz_error:12.2%}  {white}"


def draw_mixture(
    matrix: ReradiationMatrix, smooth: ReradiationMatrix, fit: MixtureFit, path: Path
) -> None:
    """Draw a matrix, the mixture that stands for it, their difference, and emission spectra.

    Parameters
    ----------
    matrix
        The measured matrix.
    smooth
        The mixture on the same bands.
    fit
        The fitted mixture, whose components are drawn as ellipses of 1 σ.
    path
        Path of the picture, which ends in `.png`, `.svg` or `.pdf`.

    Raises
    ------
    UsageError
        The file name is not that of a picture, or the file cannot be written.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.fit import fit_mixture
    >>> from labrig.material import read_reradiation
    >>> from labrig.report import draw_mixture
    >>> paper = read_reradiation("paper.csv")
    >>> fit = fit_mixture(paper, 2, threshold=1e-3)
    >>> smooth = fit.mixture.to_matrix(paper.input_nm, paper.output_nm)
    >>> draw_mixture(paper, smooth, fit, Path("mixture.svg"))
    """
    from matplotlib.figure import Figure

    require_picture(path)
    with figure_style():
        figure = Figure(figsize=(9.0, 7.2), layout="constrained")
        figure.suptitle(matrix.name, color=INK)
        (measured, mixed), (difference, emission) = figure.subplots(2, 2)
        stokes, model = shown_values(matrix), shown_values(smooth)
        top = max(largest(stokes), largest(model), 1e-12)
        _draw_heat(measured, matrix, stokes, "measured, per 10 nm", (0.0, top), "magma_r")
        _draw_heat(mixed, matrix, model, "mixture, per 10 nm", (0.0, top), "magma_r")
        for mean, covariance in zip(fit.mixture.mean_nm, fit.mixture.covariance_nm2, strict=True):
            mixed.plot(*_ellipse(mean, covariance), color=MUTED, linewidth=1.0)
        apart = 0.25 * top
        _draw_heat(
            difference, matrix, stokes - model, "measured less mixture", (-apart, apart), "RdBu_r"
        )
        _draw_emission(emission, matrix, smooth)
        save_picture(figure, path)


def _draw_heat(
    axes: "Axes",
    matrix: ReradiationMatrix,
    values: FloatArray,
    title: str,
    limits: tuple[float, float],
    colours: str,
) -> None:
    mesh = draw_heat(axes, matrix, values, limits, colours)
    axes.set(xlim=matrix.input_edges_nm[[0, -1]], ylim=matrix.output_edges_nm[[0, -1]])
    label_heat(axes, title)
    axes.figure.colorbar(mesh, ax=axes)


def _draw_emission(axes: "Axes", matrix: ReradiationMatrix, smooth: ReradiationMatrix) -> None:
    """Draw columns of both: measured as points, the mixture as lines."""
    for colour, column in zip(COLUMN_COLOURS, strongest_columns(matrix), strict=False):
        shown = matrix.is_stokes[:, column]
        nm = matrix.output_nm[shown]
        label = f"{matrix.input_nm[column]:g} nm"
        axes.plot(nm, BAND_NM * smooth.reradiation[shown, column], color=colour, label=label)
        axes.plot(
            nm, BAND_NM * matrix.reradiation[shown, column], "o", color=colour, markersize=2.5
        )
    axes.set(xlabel="returning wavelength / nm")
    axes.set_title("per 10 nm, by incident wavelength", fontsize="medium", color=INK)
    if axes.lines:
        axes.legend(frameon=False, fontsize="small")


def _ellipse(mean: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return the ellipse of 1 σ, shape (2, 73)."""
    angle = np.linspace(0, 2 * np.pi, 73)
    circle = np.stack([np.cos(angle), np.sin(angle)])
    return np.asarray(mean[:, np.newaxis] + np.linalg.cholesky(covariance) @ circle)
