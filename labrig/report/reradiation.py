"""A fluorescent surface, as lines of text and as a picture."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.foundation.number_format import plus_minus, rounded
from labrig.material import Appearance, ReradiationMatrix, appearance, reradiates
from labrig.optics import XYZ_TO_SRGB, Spectrum, edges_from_centres, is_narrow
from labrig.report.colours import css_colour, into_gamut
from labrig.report.figure_files import require_picture, save_picture
from labrig.report.figure_style import INK, MUTED, RULE, figure_style
from labrig.report.reradiation_figures import (
    BAND_NM,
    draw_heat,
    emission_spectra,
    label_heat,
    largest,
    shown_values,
    spectra_marks,
)

# matplotlib is slow to load.
if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


#: X, Y, Z of a screen's white, D65.
SCREEN_WHITE = np.array([0.95047, 1.0, 1.08883])
#: σ above zero from which a number is named as the largest one.
KNOWN_SIGMAS = 3.0


def describe_reradiation(matrix: ReradiationMatrix, lights: Sequence[Spectrum]) -> str:
    """Describe a fluorescent surface in lines of text.

    Parameters
    ----------
    matrix
        Its reflectance and re-radiation.
    lights
        Lights under which its colour is described.

    Returns
    -------
    str
        Grids, reflectance, the strongest re-radiation, sums over the columns, singular values, and
        a line for each light.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.material import ReradiationMatrix
    >>> from labrig.optics import read_light
    >>> from labrig.report import describe_reradiation
    >>> nm = np.arange(380.0, 781.0, 10.0)
    >>> values = np.diag(np.full(41, 0.2))
    >>> values[14, 5:9] = 0.1
    >>> matrix = ReradiationMatrix.from_bands("paper", nm, nm, values)
    >>> print(describe_reradiation(matrix, [read_light("450nm")]))
    paper: fluorescent
      incident light       380-780 nm in 41 bands of 10 nm
      light that returns   380-780 nm in 41 bands of 10 nm
      reflectance          0.2 to 0.2
      re-radiation         strongest 0.1 per 10 nm, 430 nm to 520 nm; up to 10 % of 430 nm
      singular values      1, 0, 0, 0 of the largest: one dye
      sums of columns      up to 0.3 with the reflectance, at 430 nm
      under 450nm          2.03 times as bright as a white, 90 % of that re-radiated
    """
    lines = [f"{matrix.name or 'surface without a name'}: fluorescent"]
    lines += [
        _line("incident light", _grid(matrix.input_nm)),
        _line("light that returns", _grid(matrix.output_nm)),
        _line("reflectance", _reflectance(matrix)),
        _line("re-radiation", reradiation_text(matrix)),
    ]
    if matrix.reradiated_fraction.max() > 0:
        lines.append(_line("singular values", _dyes(matrix)))
    if matrix.unit == "relative":
        return "\n".join(
            [*lines, "  Re-radiation is relative: there are no fractions and no colours."]
        )
    total = matrix.total_fraction
    most = int(total.argmax())
    lines.append(
        _line(
            "sums of columns",
            f"up to {rounded(float(total[most]), 3)} with the reflectance, at "
            f"{matrix.input_nm[most]:g} nm",
        )
    )
    lines += [_line(f"under {light.name}", _seen(matrix, light)) for light in lights]
    return "\n".join(lines)


def _line(name: str, text: str) -> str:
    return f"  {name:<20} {text}"


def _grid(wavelength_nm: FloatArray) -> str:
    widths = np.diff(edges_from_centres(wavelength_nm))
    bands = f"{len(wavelength_nm)} bands"
    if np.ptp(widths) < 1e-6:
        bands += f" of {widths[0]:g} nm"
    return f"{wavelength_nm[0]:g}-{wavelength_nm[-1]:g} nm in {bands}"


def _reflectance(matrix: ReradiationMatrix) -> str:
    measured = matrix.reflectance[~np.isnan(matrix.reflectance)]
    if not len(measured):
        return "not measured"
    return f"{rounded(float(measured.min()), 3)} to {rounded(float(measured.max()), 3)}"


def reradiation_text(matrix: ReradiationMatrix) -> str:
    """Return the strongest re-radiation and the largest fraction of an input band's light.

    Parameters
    ----------
    matrix
        Reflectance and re-radiation of a surface.

    Returns
    -------
    str
        Both with their wavelengths, σ in brackets where it is known; or that there is none above
        the noise.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.material import ReradiationMatrix
    >>> from labrig.report import reradiation_text
    >>> nm = np.arange(380.0, 781.0, 10.0)
    >>> grey = ReradiationMatrix.from_bands("grey", nm, nm, np.diag(np.full(41, 0.2)))
    >>> reradiation_text(grey)
    'none'
    """
    stokes = np.where(matrix.is_stokes, np.nan_to_num(matrix.reradiation), 0.0)
    if matrix.reradiation_sigma is not None and reradiates(matrix):
        stokes = np.where(stokes > KNOWN_SIGMAS * matrix.reradiation_sigma, stokes, 0.0)
    out, into = np.unravel_index(stokes.argmax(), stokes.shape)
    if not stokes[out, into] > 0:
        return "none"
    where = f"{matrix.input_nm[into]:g} nm to {matrix.output_nm[out]:g} nm"
    unmeasured = float(np.mean(np.isnan(matrix.reradiation[matrix.is_stokes])))
    rest = f"; {100 * unmeasured:.0f} % of the numbers not measured" if unmeasured else ""
    if matrix.unit == "relative":
        return f"strongest {where}{rest}"
    fraction, sigma = matrix.reradiated_fraction, matrix.reradiated_fraction_sigma
    if sigma is not None and not reradiates(matrix):
        noise = rounded(100 * float(np.median(sigma[sigma > 0])), 2)
        return f"none above the noise of {noise} % of a wavelength{rest}"
    known = fraction if sigma is None else np.where(fraction > KNOWN_SIGMAS * sigma, fraction, 0.0)
    most = int(known.argmax())
    share = (
        rounded(100 * float(fraction[most]), 3)
        if sigma is None
        else plus_minus(100 * float(fraction[most]), 100 * float(sigma[most]))
    )
    return (
        f"strongest {rounded(float(BAND_NM * stokes[out, into]), 3)} per {BAND_NM:g} nm, {where}; "
        f"up to {share} % of {matrix.input_nm[most]:g} nm{rest}"
    )


def _dyes(matrix: ReradiationMatrix) -> str:
    values = matrix.singular_values()[:4]
    text = ", ".join(rounded(float(value), 2) if value > 1e-9 else "0" for value in values)
    return f"{text} of the largest" + (": one dye" if values[1] < 0.1 else "")


def _seen(matrix: ReradiationMatrix, light: Spectrum) -> str:
    try:
        colour = appearance(matrix, light)
    except DataError as error:
        return str(error)
    if not colour.xyz[1] > 0:
        return "black within its noise"
    of_that = f"{round(100 * colour.reradiated_y / colour.xyz[1])} % of that re-radiated"
    if is_narrow(light):
        # CIELAB has no meaning where a white is all but black.
        return f"{rounded(float(colour.xyz[1]), 3)} times as bright as a white, {of_that}"
    lab = ", ".join(f"{name}* {value:.1f}" for name, value in zip("Lab", colour.lab, strict=True))
    return f"{lab}; Y {100 * colour.xyz[1]:.1f} % of a white's, {of_that}"


def draw_reradiation(matrix: ReradiationMatrix, lights: Sequence[Spectrum], path: Path) -> None:
    """Draw a fluorescent surface: its matrix, emission spectra, reflectance and colours.

    Parameters
    ----------
    matrix
        Its reflectance and re-radiation.
    lights
        Lights under which its colour is shown.
    path
        Path of the picture, which ends in `.png`, `.svg` or `.pdf`.

    Raises
    ------
    UsageError
        The file name is not that of a picture.
    DiskError
        The file cannot be written.

    Examples
    --------
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from labrig.material import ReradiationMatrix
    >>> from labrig.optics import read_light
    >>> from labrig.report import draw_reradiation
    >>> nm = np.arange(380.0, 781.0, 10.0)
    >>> values = np.diag(np.full(41, 0.2))
    >>> values[14, 5:9] = 0.1
    >>> matrix = ReradiationMatrix.from_bands("paper", nm, nm, values)
    >>> draw_reradiation(matrix, [read_light("D65")], Path("paper.svg"))
    """
    require_picture(path)
    with figure_style():
        figure = reradiation_figure(matrix, lights)
        save_picture(figure, path)


def reradiation_figure(matrix: ReradiationMatrix, lights: Sequence[Spectrum]) -> "Figure":
    from labrig.report.notebook_figure import NotebookFigure  # matplotlib is slow to load

    figure = NotebookFigure(figsize=(9.0, 6.2 if lights else 5.2), layout="constrained")
    figure.suptitle(matrix.name, color=INK)
    heights = [1.0, 1.0, 0.4] if lights else [1.0, 1.0]
    rows = figure.add_gridspec(len(heights), 2, height_ratios=heights)
    _draw_matrix(figure.add_subplot(rows[:2, 0]), matrix)
    _draw_emission(figure.add_subplot(rows[0, 1]), matrix)
    _draw_reflectance(figure.add_subplot(rows[1, 1]), matrix)
    if lights:
        _draw_colours(figure.add_subplot(rows[2, :]), matrix, lights)
    return figure


def _draw_matrix(axes: "Axes", matrix: ReradiationMatrix) -> None:
    """Draw re-radiation by wavelength of input and output, with what was not measured in grey."""
    values = shown_values(matrix)
    top = largest(values)
    mesh = draw_heat(axes, matrix, values, (0.0, top if top > 0 else 1.0))
    low = max(matrix.input_edges_nm[0], matrix.output_edges_nm[0])
    high = min(matrix.input_edges_nm[-1], matrix.output_edges_nm[-1])
    axes.plot([low, high], [low, high], color=MUTED, linewidth=0.8)
    label_heat(axes, "re-radiation per 10 nm")
    axes.figure.colorbar(mesh, ax=axes, location="bottom", shrink=0.9, aspect=30)


def _draw_emission(axes: "Axes", matrix: ReradiationMatrix) -> None:
    """Draw emission spectra of the strongest excitations."""
    from labrig.report.chart_figure import draw_mark

    spectra = emission_spectra(matrix)
    for order, (_, mark) in enumerate(spectra_marks(spectra), start=2):
        draw_mark(axes, mark, order)
    for line, spectrum in zip(axes.lines, spectra, strict=True):
        line.set_label(f"{spectrum.given_nm:g} nm")
    axes.axhline(0.0, color=RULE, linewidth=0.8, zorder=0)
    axes.set(xlabel="returning wavelength / nm", xlim=matrix.output_nm[[0, -1]])
    axes.set_title("re-radiation per 10 nm, by incident wavelength", fontsize="medium", color=INK)
    if spectra:
        axes.legend(frameon=False, fontsize="small")


def _draw_reflectance(axes: "Axes", matrix: ReradiationMatrix) -> None:
    """Draw the reflectance, and the fraction of each incident wavelength that is re-radiated."""
    axes.plot(matrix.output_nm, matrix.reflectance, color=INK, label="reflected")
    if matrix.reflectance_sigma is not None:
        low, high = (matrix.reflectance + k * matrix.reflectance_sigma for k in (-1, 1))
        axes.fill_between(matrix.output_nm, low, high, color=INK, alpha=0.2, linewidth=0)
    fraction, sigma = matrix.reradiated_fraction, matrix.reradiated_fraction_sigma
    (line,) = axes.plot(matrix.input_nm, fraction, color="#a8326e", label="re-radiated")
    if sigma is not None:
        axes.fill_between(
            matrix.input_nm, fraction - sigma, fraction + sigma, color=line.get_color(), alpha=0.2,
            linewidth=0,
        )  # fmt: skip
    axes.axhline(0.0, color=RULE, linewidth=0.8, zorder=0)
    axes.set(xlabel="incident wavelength / nm")
    axes.set_title("fraction of the incident light", fontsize="medium", color=INK)
    axes.legend(frameon=False, fontsize="small")


def _draw_colours(axes: "Axes", matrix: ReradiationMatrix, lights: Sequence[Spectrum]) -> None:
    """Draw swatches: above all light, below what is reflected alone."""
    from matplotlib.patches import Rectangle

    axes.set(xlim=(-0.65, len(lights)), ylim=(-0.55, 2.0))
    axes.set_axis_off()
    for y, text in ((1.0, "all light"), (0.0, "reflected alone")):
        axes.text(-0.04, y + 0.5, text, ha="right", va="center", color=INK, fontsize="small")
    plain = ReradiationMatrix(
        matrix.name, matrix.input_nm, matrix.output_nm, matrix.reflectance,
        np.zeros_like(matrix.reradiation),
    )  # fmt: skip
    for place, light in enumerate(lights):
        try:
            pair = [appearance(surface, light) for surface in (plain, matrix)]
        except DataError:
            pair = []
        full = max([1.0, *(float(colour.xyz[1]) for colour in pair)])
        for y, colour in enumerate(pair):
            fill = css_colour(_on_screen(colour, light) / full)
            axes.add_patch(Rectangle((place + 0.03, y), 0.94, 0.94, facecolor=fill, linewidth=0))
        label = light.name if pair else f"{light.name}: not visible"
        scale = f", 1/{rounded(full, 2)} as bright" if full > 1.05 else ""
        axes.text(place + 0.5, -0.12, label + scale, ha="center", va="top", color=MUTED,
                  fontsize="small")  # fmt: skip


def screen_colour(matrix: ReradiationMatrix, light: Spectrum) -> str:
    """Return the colour of a surface under a broad light as `#rrggbb`."""
    colour = appearance(matrix, light)
    return css_colour(_on_screen(colour, light) / max(1.0, float(colour.xyz[1])))


def _on_screen(colour: Appearance, light: Spectrum) -> FloatArray:
    """Return linear sRGB, where an eye used to a broad light sees its white as the screen's."""
    return screen_linear(colour.xyz, SCREEN_WHITE if is_narrow(light) else colour.white)


def screen_linear(xyz: FloatArray, white: FloatArray) -> FloatArray:
    """Return linear sRGB of X, Y, Z (3,), in which a white (3,) is the screen's."""
    return into_gamut(XYZ_TO_SRGB @ (xyz * SCREEN_WHITE / white))
