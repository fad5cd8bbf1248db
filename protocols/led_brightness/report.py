"""Report of a calibration of LEDs: spectra, brightnesses, camera against spectrometer."""

from collections.abc import Iterator
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from labrig.foundation.number_format import plus_minus, rounded
from labrig.protocols.led_brightness.result import LedBrightnessResult
from labrig.report.figure_style import (
    INK,
    LEFT_PT,
    MUTED,
    OTHER_CHANNELS,
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

#: What is said of the scale below 400 nm.
_UV = {
    "measured": "The brightness of ultraviolet LEDs is on the scale of the others.",
    "unknown": (
        "uv_scale: unknown. The brightness of LEDs below 400 nm is not on the scale of the others: "
        "a camera sees no ultraviolet, and no spectrometer measured them. Colours under light "
        "with ultraviolet depend on it."
    ),
    "none": "There is no LED below 400 nm.",
}


def render(result: LedBrightnessResult, source: Source) -> Rendered:
    """Render spectra and brightnesses of all LEDs."""
    return Rendered((_section(result),), tuple(_lines(result)))


def _section(result: LedBrightnessResult) -> Section:
    """Return the section with figures and table."""
    file = result.calibration
    unit = "in W m⁻²" if file.scale == "absolute" else "relative to the brightest LED"
    common = f"; {file.common_sigma:.1%} more are common to all" if file.common_sigma else ""
    drift = (
        f"The first LED changed by {100 * result.drift.value:+.2f} ± "
        f"{100 * result.drift.sigma:.2f} % over the run, which σ includes."
        if result.drift is not None
        else "No LED was lit twice, so that drift is not in σ."
    )
    figures = [
        Picture(
            "spectra",
            partial(_spectra_figure, result),
            "Spectra found (lines) and as the rig file has them (grey), the largest value 1.",
        )
    ]
    if any(led.by_camera is not None for led in result.leds.values()):
        figures.append(
            Picture(
                "camera-and-spectrometer",
                partial(_comparison_figure, result),
                "Brightness by the camera alone over that by the spectrometer alone, with the σ of "
                "both. A spectrometer that no lamp has calibrated has a response of its own, which "
                "shows here as a smooth curve.",
            )
        )
    return Section(
        "Brightness of the LEDs",
        (
            f"Measured on a {file.source}. Brightness b {unit}, with 1 σ{common}.",
            _UV[result.uv_scale],
            drift,
        ),
        tuple(figures),
        (_table(result),),
    )


def _table(result: LedBrightnessResult) -> Table:
    head = (
        "LED", "Spectrum by", "Centroid / nm", "b", "Camera", "Spectrometer", "Change / %",
        *(f"{channel} / DN/s" for channel in result.channels),
    )  # fmt: skip
    rows = []
    for name, led in result.leds.items():
        file = result.calibration.leds[name]
        rows.append(
            (
                name,
                file.source,
                plus_minus(led.centroid_nm, file.wavelength_sigma_nm),
                "unknown" if led.brightness is None else _text(led.brightness),
                _text(led.by_camera),
                _text(led.by_spectrometer),
                "–" if led.change is None else f"{100 * led.change:+.2f}",
                *(rounded(value, 3) for value in led.value_dn_per_s.tolist()),
            )
        )
    caption = (
        "Centroid with the σ of all wavelengths together; change: from the reading before the "
        "photographs to that after them."
    )
    return Table(head, tuple(rows), caption)


def _text(measured: Measured | None) -> str:
    return "–" if measured is None else plus_minus(measured.value, measured.sigma)


def _spectra_figure(result: LedBrightnessResult) -> Figure:
    """Draw every LED's spectrum, and that of the rig file."""
    figure = new_figure(240)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=46)
    entries = []
    for number, (name, led) in enumerate(result.leds.items()):
        colour = OTHER_CHANNELS[number % len(OTHER_CHANNELS)]
        file = result.calibration.leds[name]
        axes.plot(led.nominal_nm, led.nominal, color=MUTED, linewidth=0.8)
        axes.plot(file.wavelength_nm, file.value, color=colour, linewidth=1.2)
        entries.append(line_entry(name, colour))
    axes.set_ylim(0, 1.05)
    axes.set_xlabel("Wavelength / nm")
    axes.set_ylabel("Light per nm")
    legend_above(figure, entries, columns=5)
    return figure


def _comparison_figure(result: LedBrightnessResult) -> Figure:
    """Draw the ratio of both brightnesses by wavelength."""
    figure = new_figure(200)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=30)
    rows = [
        (led.centroid_nm, led.by_camera.over(led.by_spectrometer))
        for led in result.leds.values()
        if led.by_camera is not None and led.by_spectrometer is not None
    ]
    centre = np.array([nm for nm, _ in rows])
    ratio = np.array([measured.value for _, measured in rows])
    error_bars(axes, centre, ratio, np.array([measured.sigma for _, measured in rows]), INK)
    points(axes, centre, ratio, "o", INK, INK, size=4.0)
    axes.axhline(1.0, color=MUTED, linewidth=0.8)
    axes.set_xlabel("Wavelength / nm")
    axes.set_ylabel("Camera / spectrometer")
    legend_above(figure, [marker_entry("with 1 σ of both", "o", INK)], columns=1)
    return figure


def _lines(result: LedBrightnessResult) -> Iterator[str]:
    """Yield a line for each LED, and one on the scale below 400 nm."""
    unit = " W m⁻²" if result.calibration.scale == "absolute" else ""
    for name, led in result.leds.items():
        file = result.calibration.leds[name]
        brightness = (
            "brightness unknown" if led.brightness is None else f"b {_text(led.brightness)}{unit}"
        )
        yield (
            f"{name}: centroid {plus_minus(led.centroid_nm, file.wavelength_sigma_nm)} nm "
            f"({file.source}), {brightness}"
        )
    yield f"uv_scale: {result.uv_scale}; scale: {result.calibration.scale}"
