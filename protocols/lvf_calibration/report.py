"""Report of the calibration of a linear variable filter."""

from collections.abc import Iterator
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from labrig.calibration import LVF_KIND, LvfFile
from labrig.foundation.arrays import FloatArray
from labrig.foundation.number_format import plus_minus, rounded
from labrig.optics import CameraResponse, WavelengthMap
from labrig.protocols.lvf_calibration.result import CameraCurves, LvfCalibrationResult, StripLines
from labrig.report.figure_style import (
    DASHED,
    INK,
    LEFT_PT,
    MUTED,
    channel_colour,
    error_bars,
    legend_above,
    line_entry,
    new_figure,
    place,
    points,
)
from labrig.report.sections import Picture, Rendered, Section, Source, Table
from labrig.results import LocatedLines

_WAVELENGTH = "Wavelength / nm"
#: Number of positions in the table; the file has all positions.
_ROWS = 11


def render(result: LvfCalibrationResult, source: Source) -> Rendered:
    """Render the wavelengths along the strip, and its transmission."""
    return Rendered((_map_section(result), _band_section(result)), tuple(_lines(result)))


def _lines(result: LvfCalibrationResult) -> Iterator[str]:
    """Yield the lines for the terminal: mercury lines, bands, and place on the sample."""
    bands, sigma = result.calibration.bands, result.calibration.sigma

    def centre(number: int) -> str:
        """Return the centre of a band with its σ in nm, as text."""
        return plus_minus(bands.centre_nm[number], sigma.centre_nm[number])

    yield (
        f"mercury lines {result.before_camera.lines}; the map leaves "
        f"{rounded(result.map_rms_nm, 2)} nm rms "
        f"({'straight' if result.map_order == 1 else 'bent'})"
    )
    yield (
        f"{len(result.filters)} colour filters: {len(bands.centre_nm)} bands from "
        f"{centre(0)} to {centre(-1)} nm"
    )
    middle = len(bands.centre_nm) // 2
    width = plus_minus(bands.fwhm_nm[middle], sigma.fwhm_nm[middle])
    yield f"width {width} nm at {centre(middle)} nm"
    yield f"on the sample: lines {result.on_sample.lines}; {_stripes_text(result)}"


def _stripes_text(result: LvfCalibrationResult) -> str:
    """Return the statement on the shift of the strip between card and glow."""
    if result.stripes is None:
        sigma = rounded(result.placed.sigma_nm, 2)
        return f"its place as on the card ± {sigma} nm ({result.no_stripes_reason})"
    shift = plus_minus(result.stripes.shift_nm, result.stripes.sigma_nm)
    return f"its glow is {shift} nm from where the card was lit"


def _map_section(result: LvfCalibrationResult) -> Section:
    """Return the section on the wavelength of each position."""
    before_camera, on_sample = result.before_camera, result.on_sample
    wavelengths = result.calibration.wavelengths.map()
    residuals = {
        "before the camera": (before_camera.lines, result.map_residual_nm),
        "on the sample": (on_sample.lines, result.placed.residual_nm),
    }
    return Section(
        "Wavelength along the strip",
        (
            f"Lines found before the camera: {before_camera.lines}; "
            f"on the sample: {on_sample.lines}. "
            f"{_stripes_text(result).capitalize()}.",
        ),
        (
            Picture(
                "lines",
                partial(_profile_figure, before_camera, wavelengths),
                "The strip under the mercury lamp, in transmission; dashed: the located lines. "
                "Of a blend, its first line is marked.",
            ),
            Picture(
                "lines-on-sample",
                partial(_profile_figure, on_sample, wavelengths),
                "The strip on the sample under the mercury lamp, seen on the grey card.",
            ),
            Picture(
                "line-residuals",
                partial(_line_residual_figure, residuals),
                "Wavelength of the map minus that of each line, with 1 σ of its place.",
            ),
        ),
    )


def _band_section(result: LvfCalibrationResult) -> Section:
    """Return the section on the transmission of each position."""
    file, count = result.calibration, len(result.filters)
    median, worst = np.median(result.band_misfit), result.band_misfit.max()
    return Section(
        "Transmission of the strip",
        (
            f"From {count} colour filters over the grey card, in units of the card seen "
            f"without the strip. Misfit per value {median:.2f} (median over the positions), "
            f"{worst:.2f} at worst; where it is above 1, σ was raised by it. Positions at the ends "
            "rest on few and faint values: their σ is larger. The camera's curves were fitted "
            "along, since they are wrong in the same way at every position.",
            "Widths are those of skewed Gaussians: of bands that are flatter on top they may be "
            "4-5 % too small, beyond σ.",
        ),
        (
            Picture(
                "transmission",
                partial(_transmission_figure, file),
                "Transmission at every position along the strip.",
            ),
            Picture(
                "along",
                partial(_along_figure, file),
                "Centre minus a straight line (grey: the map by the lines alone) and full width at "
                "half maximum of the bands, with 1 σ.",
            ),
            Picture(
                "camera-curves",
                partial(_camera_figure, result.camera_before, result.camera_curves),
                "The camera's curves as fitted with the colour filters; dashed: as in their file.",
            ),
            Picture(
                "filter-residuals",
                partial(
                    _filter_residual_figure,
                    result.transmittance_residual,
                    result.filters,
                    file.lvf.bands.centre_nm,
                ),
                "Transmittance of every colour filter along the strip, measured minus expected, "
                "in per cent.",
            ),
        ),
        (_table(file),),
    )


def _table(file: LvfFile) -> Table:
    """Return the table of the bands at some positions."""
    bands, sigma = file.bands, file.sigma
    count = len(file.position)
    chosen = sorted({round(row) for row in np.linspace(0, count - 1, _ROWS)})
    rows = [
        (
            f"p{k:02d}",
            plus_minus(bands.centre_nm[k], sigma.centre_nm[k]),
            plus_minus(bands.fwhm_nm[k], sigma.fwhm_nm[k]),
            plus_minus(
                100 * bands.peak[k],
                100 * np.hypot(sigma.peak[k], bands.peak[k] * sigma.fwhm_nm[k] / bands.fwhm_nm[k]),
            ),
            plus_minus(100 * bands.leakage[k], 100 * sigma.leakage[k]),
        )
        for k in chosen
    ]
    head = ("Position", "Centre / nm", "Width / nm", "Peak / %", "Leakage / %")
    return Table(head, tuple(rows), f"Some of the positions; all are in {LVF_KIND.file_name}.")


def _profile_figure(strip_lines: StripLines, wavelengths: WavelengthMap) -> Figure:
    """Draw the profile of the strip under the mercury lamp, and the located lines."""
    figure = new_figure(220)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=30)
    position = (
        strip_lines.profile.position
        if strip_lines.strip.rising
        else 1 - strip_lines.profile.position
    )
    nm = wavelengths.wavelength_nm(position)
    value = strip_lines.profile.value_dn_per_s / strip_lines.profile.value_dn_per_s.max()
    names = ("R", "G", "B") if value.shape[1] == 3 else ("L",)
    for number, name in enumerate(names):
        axes.plot(nm, value[:, number], color=channel_colour(name, number), linewidth=1.2)
    for line in strip_lines.lines.wavelength_nm:
        axes.axvline(line, color=MUTED, linewidth=0.8, linestyle=DASHED)
    axes.set_xlim(float(nm.min()), float(nm.max()))
    axes.set_xlabel(_WAVELENGTH)
    axes.set_ylabel("Light / brightest")
    entries = [line_entry(name, channel_colour(name, number)) for number, name in enumerate(names)]
    legend_above(figure, entries, columns=4)
    return figure


def _line_residual_figure(residuals: dict[str, tuple[LocatedLines, FloatArray]]) -> Figure:
    """Draw the residuals of the map at the lines in nm, for each place of the strip."""
    figure = new_figure(180)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=30)
    axes.axhline(0, color=MUTED, linewidth=0.8)
    colours = (INK, channel_colour("B", 2))
    entries = []
    for (name, (lines, residual_nm)), colour in zip(residuals.items(), colours, strict=True):
        nm_per_position = abs(float(np.polyfit(lines.position, lines.wavelength_nm, 1)[0]))
        error_bars(axes, lines.wavelength_nm, residual_nm, lines.sigma * nm_per_position, colour)
        points(axes, lines.wavelength_nm, residual_nm, "o", colour, colour)
        entries.append(line_entry(name, colour))
    axes.set_xlabel(_WAVELENGTH)
    axes.set_ylabel("Map − line / nm")
    legend_above(figure, entries, columns=2)
    return figure


def _transmission_figure(file: LvfFile) -> Figure:
    """Draw the transmission T_p(λ) of all positions p."""
    figure = new_figure(240)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=12)
    nm = np.arange(380.0, 780.5, 1.0)
    transmission = file.lvf.transmission(nm)
    for centre, row in zip(file.bands.centre_nm, transmission, strict=True):
        axes.plot(nm, 100 * row, color=channel_colour(_colour_channel(centre), 0), linewidth=0.9)
    axes.set_xlim(380, 740)
    axes.set_ylim(0, None)
    axes.set_xlabel(_WAVELENGTH)
    axes.set_ylabel("Transmission / %")
    return figure


def _along_figure(file: LvfFile) -> Figure:
    """Draw centre minus a straight line, and width of the bands, with 1 σ."""
    figure = new_figure(268)
    upper = place(figure, left=LEFT_PT, bottom=148, right=12, top=12)
    lower = place(figure, left=LEFT_PT, bottom=38, right=12, top=134, share_x=upper)
    position = np.array(file.position)
    bands, sigma = file.bands.bands(), file.sigma.bands()
    straight = np.polyval(np.polyfit(position, bands.centre_nm, 1), position)
    for axes, value, value_sigma in (
        (upper, bands.centre_nm - straight, sigma.centre_nm),
        (lower, bands.fwhm_nm, sigma.fwhm_nm),
    ):
        error_bars(axes, position, value, value_sigma, INK)
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


def _camera_figure(original: CameraCurves, fitted: CameraResponse) -> Figure:
    """Draw the camera's curves as in their file and as fitted with the colour filters."""
    figure = new_figure(200)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=30)
    entries = []
    for number, name in enumerate(fitted.channels):
        colour = channel_colour(name, number)
        sensitivity = original.sensitivity[:, number]
        axes.plot(
            original.wavelength_nm,
            sensitivity,
            color=colour,
            linewidth=0.9,
            linestyle=DASHED,
        )
        axes.plot(fitted.wavelength_nm, fitted.sensitivity[:, number], color=colour, linewidth=1.2)
        entries.append(line_entry(name, colour))
    axes.set_ylim(0, None)
    axes.set_xlabel(_WAVELENGTH)
    axes.set_ylabel("Sensitivity")
    legend_above(figure, entries, columns=4)
    return figure


def _filter_residual_figure(
    residuals: FloatArray, names: tuple[str, ...], centre_nm: FloatArray
) -> Figure:
    """Draw measured minus expected transmittance for every filter (row) and position (column).

    Parameters
    ----------
    residuals
        Residuals of F filters at P positions, shape (F, P).
    names
        Names of the filters, shape (F,).
    centre_nm
        Centre of the band at each position in nm, shape (P,).
    """
    height_pt = max(160.0, 9.0 * len(names) + 70)
    figure = new_figure(height_pt)
    axes = place(figure, left=LEFT_PT + 44, bottom=38, right=60, top=12)
    limit = max(0.02, float(np.nanpercentile(np.abs(residuals), 98)))
    half_step_nm = (centre_nm[-1] - centre_nm[0]) / (len(centre_nm) - 1) / 2
    picture = axes.imshow(
        100 * residuals,
        aspect="auto",
        cmap="RdBu_r",
        vmin=-100 * limit,
        vmax=100 * limit,
        extent=(centre_nm[0] - half_step_nm, centre_nm[-1] + half_step_nm, len(names) - 0.5, -0.5),
        interpolation="nearest",
    )
    label_step = max(1, round(len(names) * 11 / (height_pt - 50)))
    axes.set_yticks(range(0, len(names), label_step), names[::label_step])
    axes.tick_params(axis="y", labelsize=7)
    axes.grid(False)
    axes.set_xlabel(_WAVELENGTH)
    width, height = figure.get_size_inches() * 72
    bar = figure.add_axes((1 - 50 / width, 38 / height, 10 / width, 1 - 50 / height))
    figure.colorbar(picture, cax=bar)
    bar.tick_params(colors=MUTED, labelsize=8)
    bar.set_title("%", fontsize=8, color=MUTED)
    return figure


def _colour_channel(centre_nm: float) -> str:
    """Return the channel whose colour a band is drawn in."""
    return "B" if centre_nm < 490 else "G" if centre_nm < 590 else "R"
