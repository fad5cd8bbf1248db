"""What the calibration of an LVF looks like."""

import numpy as np
from matplotlib.figure import Figure

from labrig.analyse.lvf_calibration.lines import StripLines
from labrig.analyse.lvf_calibration.picture import FloatArray
from labrig.calibration import LvfFile
from labrig.fit.lvf import LocatedLines, LvfCalibration
from labrig.optics import CameraResponse, WavelengthMap
from labrig.report.figure_style import (
    INK,
    LEFT_PT,
    MUTED,
    channel_colour,
    error_bars,
    new_figure,
    place,
    points,
)
from labrig.report.legend import legend_above, lined

_WAVELENGTH = "Wavelength / nm"


def profile_figure(found: StripLines, wavelengths: WavelengthMap) -> Figure:
    """The strip under mercury, and which line is where."""
    figure = new_figure(220)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=30)
    position = found.profile.position if found.strip.rising else 1 - found.profile.position
    nm = wavelengths.wavelength_nm(position)
    value = found.profile.value / found.profile.value.max()
    names = ("R", "G", "B") if value.shape[1] == 3 else ("L",)
    for number, name in enumerate(names):
        axes.plot(nm, value[:, number], color=channel_colour(name, number), linewidth=1.2)
    for line in found.lines.wavelength_nm:
        axes.axvline(line, color=MUTED, linewidth=0.8, linestyle=(0, (4, 2.5)))
    axes.set_xlim(float(nm.min()), float(nm.max()))
    axes.set_xlabel(_WAVELENGTH)
    axes.set_ylabel("Light / brightest")
    entries = [lined(name, channel_colour(name, number)) for number, name in enumerate(names)]
    legend_above(figure, entries, columns=4)
    return figure


def line_residual_figure(fits: dict[str, tuple[FloatArray, FloatArray, FloatArray]]) -> Figure:
    """What the map leaves of every line: name → wavelengths, residuals, σ, all in nm."""
    figure = new_figure(180)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=30)
    axes.axhline(0, color=MUTED, linewidth=0.8)
    colours = (INK, channel_colour("B", 2))
    entries = []
    for (name, (nm, left, sigma)), colour in zip(fits.items(), colours, strict=False):
        error_bars(axes, nm, left, sigma, colour)
        points(axes, nm, left, "o", colour, colour)
        entries.append(lined(name, colour))
    axes.set_xlabel(_WAVELENGTH)
    axes.set_ylabel("Map − line / nm")
    legend_above(figure, entries, columns=2)
    return figure


def transmission_figure(file: LvfFile) -> Figure:
    """T_p(λ) of all positions."""
    figure = new_figure(240)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=12)
    nm = np.arange(380.0, 780.5, 1.0)
    transmission = file.lvf.transmission(nm)
    for centre, row in zip(file.bands.centre_nm, transmission, strict=True):
        axes.plot(nm, 100 * row, color=channel_colour(_colour_of(centre), 0), linewidth=0.9)
    axes.set_xlim(380, 740)
    axes.set_ylim(0, None)
    axes.set_xlabel(_WAVELENGTH)
    axes.set_ylabel("Transmission / %")
    return figure


def along_figure(file: LvfFile) -> Figure:
    """Centre, less a straight line, and width, with 1 σ."""
    figure = new_figure(268)
    upper = place(figure, left=LEFT_PT, bottom=148, right=12, top=12)
    lower = place(figure, left=LEFT_PT, bottom=38, right=12, top=134, share_x=upper)
    position = np.array(file.position)
    bands, sigma = file.bands.bands(), file.sigma.bands()
    straight = np.polyval(np.polyfit(position, bands.centre_nm, 1), position)
    for axes, value, unsure in (
        (upper, bands.centre_nm - straight, sigma.centre_nm),
        (lower, bands.fwhm_nm, sigma.fwhm_nm),
    ):
        error_bars(axes, position, value, unsure, INK)
        points(axes, position, value, "o", INK, INK, size=3.0)
    grid = np.linspace(*file.wavelengths.span, 101)
    mapped = file.wavelengths.map()
    line = np.interp(grid, position, straight)
    inside = (grid >= position[0]) & (grid <= position[-1])
    upper.plot(
        grid[inside], (mapped.wavelength_nm(grid) - line)[inside], color=MUTED, linewidth=0.9
    )
    upper.tick_params(labelbottom=False)
    upper.set_ylabel("Bend / nm")
    lower.set_ylabel("Width / nm")
    lower.set_xlabel("Position from blue end to red end")
    return figure


def camera_figure(before: CameraResponse, found: CameraResponse) -> Figure:
    """Curves of every channel, as they were known and as the filters tell them."""
    figure = new_figure(200)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=30)
    entries = []
    for number, name in enumerate(found.channels):
        colour = channel_colour(name, number)
        dashed = (0, (4, 2.5))
        known = before.sensitivity[:, number]
        axes.plot(before.wavelength_nm, known, color=colour, linewidth=0.9, linestyle=dashed)
        axes.plot(found.wavelength_nm, found.sensitivity[:, number], color=colour, linewidth=1.2)
        entries.append(lined(name, colour))
    axes.set_ylim(0, None)
    axes.set_xlabel(_WAVELENGTH)
    axes.set_ylabel("Sensitivity")
    legend_above(figure, entries, columns=4)
    return figure


def filter_residual_figure(
    left: FloatArray, names: tuple[str, ...], centre_nm: FloatArray
) -> Figure:
    """Transmittance measured minus expected, for every filter (row) and position (column)."""
    height = max(160.0, 9.0 * len(names) + 70)
    figure = new_figure(height)
    axes = place(figure, left=LEFT_PT + 44, bottom=38, right=60, top=12)
    most = max(0.02, float(np.nanpercentile(np.abs(left), 98)))
    step = (centre_nm[-1] - centre_nm[0]) / (len(centre_nm) - 1) / 2
    picture = axes.imshow(
        100 * left,
        aspect="auto",
        cmap="RdBu_r",
        vmin=-100 * most,
        vmax=100 * most,
        extent=(centre_nm[0] - step, centre_nm[-1] + step, len(names) - 0.5, -0.5),
        interpolation="nearest",
    )
    every = max(1, round(len(names) * 11 / (height - 50)))
    axes.set_yticks(range(0, len(names), every), names[::every])
    axes.tick_params(axis="y", labelsize=7)
    axes.grid(False)
    axes.set_xlabel(_WAVELENGTH)
    width, tall = figure.get_size_inches() * 72
    bar = figure.add_axes((1 - 50 / width, 38 / tall, 10 / width, 1 - 50 / tall))
    figure.colorbar(picture, cax=bar)
    bar.tick_params(colors=MUTED, labelsize=8)
    bar.set_title("%", fontsize=8, color=MUTED)
    return figure


def line_residuals(
    lines: LocatedLines, residual_nm: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Wavelengths, residuals and σ in nm, for `line_residual_figure`."""
    slope = abs(float(np.polyfit(lines.position, lines.wavelength_nm, 1)[0]))
    return lines.wavelength_nm, residual_nm, lines.sigma * slope


def misfit_text(found: LvfCalibration) -> str:
    """How well the filters agree with one another."""
    median, worst = np.median(found.misfit), found.misfit.max()
    return f"{median:.2f} (median over the positions), {worst:.2f} at worst"


def _colour_of(centre_nm: float) -> str:
    return "B" if centre_nm < 490 else "G" if centre_nm < 590 else "R"
