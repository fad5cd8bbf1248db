"""Report of a camera calibration."""

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from labrig.calibration import CameraFile, Linearity, Noise
from labrig.foundation.number_format import exposure_text, plus_minus, rounded
from labrig.optics import Factor
from labrig.protocols.camera_calibration.result import (
    CameraCalibrationResult,
    FittedFlat,
    PhotonTransfer,
)
from labrig.report.figure_style import (
    BAND_OPACITY,
    DASHED,
    INK,
    LEFT_PT,
    MARKERS,
    MUTED,
    OTHER_CHANNELS,
    PAPER,
    channel_colour,
    error_bars,
    legend_above,
    line_entry,
    marker_entry,
    new_figure,
    place,
    points,
)
from labrig.report.sections import Picture, Rendered, Section, Source, Table
from labrig.results import Measured

HEIGHT_PT = 230.0


def render(result: CameraCalibrationResult, source: Source) -> Rendered:
    """Render noise, linearity, factors of the settings, and flat field."""
    file = result.calibration
    sections = [_noise(result.photon_transfers)]
    if file.linearity is not None:
        sections.append(_linearity(file.linearity))
    sections += [_settings(file, result.repeat_flicker), _flat_field(file, result.flats)]
    return Rendered(tuple(sections), tuple(_lines(file, result.flats)))


def _noise(transfers: Sequence[PhotonTransfer]) -> Section:
    """Return the section with gain and read noise at each ISO speed."""
    rows = tuple(
        (
            f"{noise.iso:g}",
            plus_minus(noise.gain_e_per_dn, noise.gain_e_per_dn_sigma),
            plus_minus(100 * bend.value, 100 * bend.sigma),
            _read_noise(noise),
            f"{noise.row_noise_e:.2g}",
        )
        for noise, bend in ((transfer.noise, transfer.bend) for transfer in transfers)
    )
    return Section(
        "Photon transfer curve",
        ("Variance of the difference of two frames of the same light, over their level.",),
        (
            Picture(
                "photon-transfer",
                partial(_transfer_figure, transfers),
                "Variance of a pixel from frame to frame, that of reading and rounding subtracted, "
                "in DN². Lines: photon noise of the gain for faint light; a sensor that bends "
                "leaves them near white.",
            ),
        ),
        (
            Table(
                ("ISO", "Gain / (e/DN)", "Bend at white / %", "Read noise / e", "Row noise / e"),
                rows,
                "The gain is that of faint light; the bend is the deviation from linearity at "
                "white, by the photon transfer and the ratios of the channels together.",
            ),
        ),
    )


def _read_noise(noise: Noise) -> str:
    """Return the read noise in electrons, or the limit below which it is."""
    if noise.read_noise_is_limit:
        return f"below {rounded(noise.read_noise_e)}"
    return plus_minus(noise.read_noise_e, noise.read_noise_e_sigma)


def _transfer_figure(transfers: Sequence[PhotonTransfer]) -> Figure:
    """Draw the photon transfer curve of each ISO speed."""
    figure = new_figure(HEIGHT_PT)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=46)
    _logarithmic(axes)
    axes.set_yscale("log")
    entries = []
    for number, transfer in enumerate(transfers):
        colour, marker = OTHER_CHANNELS[number % len(OTHER_CHANNELS)], MARKERS[number % 8]
        level = np.array([point.level_dn for point in transfer.points])
        variance = np.array(transfer.photon_variance_dn2, dtype=np.float64)
        points(axes, level, variance, marker, colour, PAPER)
        axes.plot(level, level / transfer.noise.gain_e_per_dn, color=colour, linewidth=1.0)
        entries.append(marker_entry(f"ISO {transfer.noise.iso:g}", marker, colour, PAPER))
    axes.set_xlabel("Level above dark / DN")
    axes.set_ylabel("Photon variance / DN²")
    legend_above(figure, entries, columns=6)
    return figure


def _logarithmic(axes: Axes) -> None:
    """Make the horizontal axis logarithmic, with plain numbers as labels."""
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: rounded(value)))
    axes.xaxis.set_minor_locator(NullLocator())


def _linearity(linearity: Linearity) -> Section:
    """Return the section on the deviation from linearity."""
    saturation = (
        "is not known"
        if linearity.saturation_dn is None
        else f"is {linearity.saturation_dn:.0f} DN"
    )
    return Section(
        "Linearity",
        (
            "From the ratios of the channels along a bracket of exposure times: errors of shutter "
            f"and lamp are common-mode to the channels. The saturation level {saturation}.",
        ),
        (
            Picture(
                "linearity",
                partial(_linearity_figure, linearity),
                "Deviation from linearity; bars are ± 1 σ.",
            ),
        ),
    )


def _linearity_figure(linearity: Linearity) -> Figure:
    """Draw the deviation from linearity in per cent over the level in DN."""
    figure = new_figure(HEIGHT_PT)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=14)
    axes.axhline(0, color=MUTED, linewidth=0.8)
    level = np.array([0.0, *linearity.level_dn])
    percent = 100 * np.array([0.0, *linearity.deviation])
    sigma = 100 * np.array([0.0, *linearity.sigma])
    axes.plot(level, percent, color=INK, linewidth=1.0)
    error_bars(axes, level, percent, sigma, INK)
    points(axes, level, percent, "o", INK, PAPER)
    axes.set_xlabel("Level above dark / DN")
    axes.set_ylabel("Deviation from linearity / %")
    return figure


def _settings(file: CameraFile, repeat_flicker: Measured) -> Section:
    """Return the section with the factors of exposure times, ISO speeds and f-numbers."""
    flicker = plus_minus(100 * file.flicker, 100 * file.flicker_sigma)
    repeated = plus_minus(100 * repeat_flicker.value, 100 * repeat_flicker.sigma)
    tables = (
        _table("ISO", file.iso_gain, "{:g}", "Signal over that expected of the nominal ISO speed."),
        _table(
            "f-number", file.aperture, "f/{:g}", "Light over that expected of the nominal f-number."
        ),
    )
    return Section(
        "Exposure time, ISO, aperture",
        (
            f"Light flickers from frame to frame by {flicker} % in brackets, by {repeated} % in "
            "frames of the same exposure. The longest measured exposure time is taken as exact: "
            f"{exposure_text(file.shutter[-1].setting)}.",
        ),
        (
            Picture(
                "shutter",
                partial(_shutter_figure, file),
                "Actual over nominal exposure time; bars are ± 1 σ.",
            ),
        ),
        tuple(table for table in tables if table.rows),
    )


def _shutter_figure(file: CameraFile) -> Figure:
    """Draw actual over nominal exposure time."""
    figure = new_figure(HEIGHT_PT)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=14)
    _logarithmic(axes)
    axes.axhline(1, color=MUTED, linewidth=0.8)
    times_s = np.array([factor.setting for factor in file.shutter])
    ratio = np.array([factor.factor for factor in file.shutter])
    error_bars(axes, times_s, ratio, np.array([factor.sigma for factor in file.shutter]), INK)
    points(axes, times_s, ratio, "o", INK, PAPER)
    axes.set_xlabel("Nominal exposure time / s")
    axes.set_ylabel("Actual / nominal")
    return figure


def _table(name: str, factors: Sequence[Factor], form: str, caption: str) -> Table:
    """Return the table of the factor of each setting, whose name is formatted by `form`."""
    rows = tuple(
        (
            form.format(factor.setting),
            plus_minus(factor.factor, factor.sigma) if factor.sigma else "1",
        )
        for factor in factors
    )
    return Table((name, "Factor"), rows, caption)


def _flat_field(file: CameraFile, flats: Sequence[FittedFlat]) -> Section:
    """Return the section with the vignetting at each f-number; the first flat is drawn."""
    first = flats[0]
    rows = tuple(
        (
            "–" if fitted.flat.f_number is None else f"f/{fitted.flat.f_number:g}",
            *(
                plus_minus(100 * light, 100 * sigma)
                for light, sigma in zip(
                    fitted.flat.at(1.0), fitted.sigma_at(np.ones(1))[0], strict=True
                )
            ),
            f"{100 * max(abs(g) for row in fitted.flat.gradient for g in row):.1f}",
        )
        for fitted in flats
    )
    head = ("Aperture", *(f"{name} in the corners / %" for name in file.channels), "Gradient / %")
    stop = first.flat.f_number
    return Section(
        "Flat field and vignetting",
        (
            "The part that is symmetric about the middle of the frame is the lens's vignetting and "
            "is divided out. The gradient across the card is the lamp's and is kept.",
        ),
        (
            Picture(
                "flat-field",
                partial(_flat_figure, first, file.channels),
                "Blocks of the card"
                + ("" if stop is None else f" at f/{stop:g}")
                + ", the gradient divided out, and the fitted vignetting; dashed: extrapolated "
                "beyond the card, band: ± 1 σ.",
            ),
        ),
        (
            Table(
                head,
                rows,
                "Relative illumination of the corners, and the lamp's gradient. The card "
                f"reaches to {rounded(first.measured_to, 2)} of half the diagonal: the corners are "
                "extrapolated, ± 1 σ by the scatter of the blocks with one more power of the "
                "distance left free than the curve has.",
            ),
        ),
    )


def _corner(fitted: FittedFlat) -> str:
    """Return the relative illumination of the corners in the darkest channel, with ± 1 σ."""
    corners, stop = fitted.flat.at(1.0), fitted.flat.f_number
    darkest = int(np.argmin(corners))
    sigma = float(fitted.sigma_at(np.ones(1))[0, darkest])
    at = "" if stop is None else f" at f/{stop:g}"
    return f"{plus_minus(100 * float(corners[darkest]), 100 * sigma)} %{at}"


def _flat_figure(fitted: FittedFlat, channels: Sequence[str]) -> Figure:
    """Draw the relative illumination over the distance from the middle of the frame."""
    figure = new_figure(HEIGHT_PT)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=46)
    rho, end = np.linspace(0, 1, 101), fitted.measured_to
    sigma = fitted.sigma_at(rho**2)
    entries: list[Artist] = []
    for number, name in enumerate(channels):
        colour, marker = channel_colour(name, number), MARKERS[number % len(MARKERS)]
        distance = np.sqrt(fitted.rho2[number])
        points(axes, distance, fitted.light[number], marker, colour, PAPER, size=2.6)
        curve = fitted.flat.at(rho**2)[:, number]
        band = curve - sigma[:, number], curve + sigma[:, number]
        axes.fill_between(rho, *band, color=colour, alpha=BAND_OPACITY, linewidth=0)
        axes.plot(rho[rho <= end], curve[rho <= end], color=colour, linewidth=1.2)
        axes.plot(rho[rho >= end], curve[rho >= end], color=colour, linewidth=1.2, linestyle=DASHED)
        entries.append(marker_entry(name, marker, colour, PAPER))
    entries.append(line_entry("beyond the card", MUTED, DASHED))
    axes.set_xlabel("Distance from the middle / half the diagonal")
    axes.set_ylabel("Relative illumination")
    legend_above(figure, entries, columns=4)
    return figure


def _lines(file: CameraFile, flats: Sequence[FittedFlat]) -> Iterator[str]:
    """Yield the lines for the terminal."""
    for noise in file.noise:
        yield (
            f"ISO {noise.iso:g}: gain {plus_minus(noise.gain_e_per_dn, noise.gain_e_per_dn_sigma)} "
            f"e/DN, read noise {_read_noise(noise)} e"
        )
    yield f"flicker {plus_minus(100 * file.flicker, 100 * file.flicker_sigma)} %"
    for name, factors in (("shutter", file.shutter), ("aperture", file.aperture)):
        if len(factors) > 1:
            largest = max(factors, key=lambda entry: abs(entry.factor - 1))
            setting = (
                exposure_text(largest.setting) if name == "shutter" else f"f/{largest.setting:g}"
            )
            factor = plus_minus(largest.factor, largest.sigma)
            yield f"{name}: largest deviation from nominal at {setting}, × {factor}"
    yield f"vignetting: corners, beyond the card, at {', '.join(map(_corner, flats))}"
    if glare := file.glare:
        text = plus_minus(100 * glare.fraction, 100 * glare.sigma)
        yield f"veiling glare: {text} % of the frame's mean light"
