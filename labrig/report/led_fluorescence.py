"""Report of re-radiation matrices that were measured under LEDs."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from labrig.material import ReradiationMatrix, appearance
from labrig.number_format import plus_minus
from labrig.optics import Spectrum, read_light
from labrig.report.colours import css_colour
from labrig.report.led_figures import (
    excitation_chart,
    matrix_figure,
    reflectance_chart,
    values_chart,
)
from labrig.report.reradiation import screen_linear
from labrig.report.reradiation_spectra import emission_spectra, spectra_chart
from labrig.report.sections import Picture, Rendered, Section, Source, Table
from labrig.results import FluorescentPatch, LedFluorescenceResult

UV_SCALE = {
    "measured": "The brightness of the ultraviolet LEDs is known.",
    "unknown": (
        "How bright the ultraviolet LEDs shone is not known (uv_scale: unknown): colours marked "
        "with * depend on it. The protocol led_brightness measures it with a spectrometer."
    ),
    "none": "No LED is in the ultraviolet: what that excites is extrapolated.",
}


@dataclass(frozen=True)
class LitSwatch:
    """Colour of a sample under a light on a screen.

    Attributes
    ----------
    light
        Name of the light.
    whole, reflected, reradiated
        Colour of all light, of what is reflected and of what is re-radiated, as `#rrggbb`.
    """

    light: str
    whole: str
    reflected: str
    reradiated: str


def render(result: LedFluorescenceResult, source: Source) -> Rendered:
    """Render the matrix of each sample, its spectra and colours, and the LEDs."""
    several = len(result.patches) > 1
    lines = tuple(
        f"{name}: {_line(patch)}" if several else _line(patch)
        for name, patch in result.patches.items()
    )
    sections = [_leds(result)]
    for name, patch in result.patches.items():
        sections += _patch_sections(name if several else "Sample", patch, result)
    return Rendered(tuple(sections), lines)


def _line(patch: FluorescentPatch) -> str:
    """Return the line for the terminal: number of dyes, strongest re-radiation, colour."""
    matrix = patch.matrix.named("")
    colour = patch.colours[0]
    lightness, a, b = (
        plus_minus(value, sigma) for value, sigma in zip(colour.lab, colour.lab_sigma, strict=True)
    )
    under = f"under {colour.light} L* {lightness}, a* {a}, b* {b}"
    if colour.depends_on_uv:
        under += ", if ultraviolet excites as little as that: its scale is not known"
    if not patch.dyes:
        return f"no fluorescence found; {under}"
    peak = _strongest(matrix, patch)
    fraction, sigma = matrix.reradiated_fraction, matrix.reradiated_fraction_sigma
    assert sigma is not None
    dyes = "1 dye" if len(patch.dyes) == 1 else f"{len(patch.dyes)} dyes"
    return (
        f"{dyes}, up to {plus_minus(100 * fraction[peak], 100 * sigma[peak])} % of "
        f"{matrix.input_nm[peak]:g} nm re-radiated; {under}"
    )


def _strongest(matrix: ReradiationMatrix, patch: FluorescentPatch) -> int:
    """Return the measured input band of the most re-radiation."""
    fraction = np.where(patch.is_extrapolated, -np.inf, matrix.reradiated_fraction)
    return int(np.argmax(fraction))


def _leds(result: LedFluorescenceResult) -> Section:
    rows = tuple(
        (led, f"{peak_nm:.0f}", f"{brightness:.4g}" if known else "not known")
        for led, peak_nm, brightness, known in zip(
            result.leds,
            result.led_peak_nm,
            result.brightness,
            result.is_brightness_known,
            strict=True,
        )
    )
    table = Table(
        ("LED", "peak / nm", "brightness / (DN/s)"),
        rows,
        "Brightness: what a channel of sensitivity 1 would count of a perfect white.",
    )
    text = [UV_SCALE[result.uv_scale]]
    if result.geometry:
        text.append(f"Reflectance is the radiance factor at {result.geometry} (light/camera).")
    return Section("LEDs", tuple(text), tables=(table,))


def _patch_sections(
    name: str, patch: FluorescentPatch, result: LedFluorescenceResult
) -> Iterator[Section]:
    matrix = patch.matrix.named(name)
    slug = "".join(letter if letter.isalnum() else "-" for letter in name.lower())
    pictures = [
        Picture(
            f"{slug}-matrix",
            partial(matrix_figure, matrix, patch.is_extrapolated),
            "Re-radiation per 10 nm. Hatched: incident light that no LED of known brightness had; "
            "there it is extrapolated.",
        ),
        Picture(
            f"{slug}-excitation",
            excitation_chart(patch, matrix),
            "Fraction re-radiated by incident wavelength, by all LEDs together with a band of "
            "± 1 σ, and by the thesis's method, one LED by itself.",
        ),
        Picture(
            f"{slug}-reflectance",
            reflectance_chart(patch, matrix),
            "Reflectance with a band of ± 1 σ, and by the thesis's method.",
        ),
    ]
    if patch.dyes:
        chart = spectra_chart(emission_spectra(matrix), "Returning wavelength / nm")
        caption = "Columns of the matrix by incident wavelength; bands: ± 1 σ."
        pictures.insert(1, Picture(f"{slug}-emission", chart, caption))
    yield Section(
        name,
        tuple(_text(patch)),
        tuple(pictures),
        (_dye_table(patch, matrix), _number_table(patch)) if patch.dyes else (),
    )
    swatches = tuple(_swatch(matrix, read_light(colour.light)) for colour in patch.colours)
    yield Section(
        f"{name}: colours",
        tables=(_colour_table(patch),),
        template="led_colours.html.j2",
        content=swatches,
    )
    caption = (
        "Values over the light of a white under the LED, in R, G, B, and what the camera would see "
        "of the matrix (lines). Bars: 1 σ of the values."
    )
    values = Picture(f"{slug}-values", values_chart(patch, result), caption)
    misfit = f"Reduced χ² {patch.reduced_chi2:.2f}."
    yield Section(f"{name}: values", (misfit,), (values,))


def _text(patch: FluorescentPatch) -> Iterator[str]:
    if not patch.dyes:
        yield "The values are those of a surface that only reflects."
    if patch.bleaching is not None:
        ratio = plus_minus(patch.bleaching.value, patch.bleaching.sigma)
        yield f"The first LED gave {ratio} at the end of the run of what it gave at its begin."


def _dye_table(patch: FluorescentPatch, matrix: ReradiationMatrix) -> Table:
    rows = []
    for number, dye in enumerate(patch.dyes, 1):
        lit = np.where(patch.is_extrapolated, -np.inf, dye.excitation)
        quantum_yield = dye.quantum_yield
        known = np.isfinite(quantum_yield.value)
        rows.append(
            (
                f"dye {number}",
                f"{matrix.output_nm[np.argmax(dye.emission)]:g}",
                f"{matrix.input_nm[np.argmax(lit)]:g}",
                plus_minus(quantum_yield.value, quantum_yield.sigma) if known else "–",
            )
        )
    return Table(
        ("", "emission peak / nm", "excitation peak / nm", "quantum yield"),
        tuple(rows),
        "Quantum yield: photons emitted per photon that does not come back at its own wavelength, "
        "which other pigments of the sample may have absorbed.",
    )


def _number_table(patch: FluorescentPatch) -> Table:
    rows = tuple(
        (str(number), f"{probability:.3f}") for number, probability in enumerate(patch.probability)
    )
    return Table(("dyes", "probability"), rows)


def _colour_table(patch: FluorescentPatch) -> Table:
    rows = tuple(
        (
            f"{colour.light} *" if colour.depends_on_uv else colour.light,
            *(
                plus_minus(value, sigma)
                for value, sigma in zip(colour.lab, colour.lab_sigma, strict=True)
            ),
        )
        for colour in patch.colours
    )
    return Table(
        ("light", "L*", "a*", "b*"),
        rows,
        "CIELAB with a perfect white under the light, CIE 1931 2° observer. *: depends on how "
        "bright LEDs of unknown brightness are."
        if any(colour.depends_on_uv for colour in patch.colours)
        else "CIELAB with a perfect white under the light, CIE 1931 2° observer.",
    )


def _swatch(matrix: ReradiationMatrix, light: Spectrum) -> LitSwatch:
    """Return the colours on a screen on which a perfect white under the light is white."""
    dark = ReradiationMatrix(
        matrix.name,
        matrix.input_nm,
        matrix.output_nm,
        matrix.reflectance,
        np.zeros_like(matrix.reradiation),
    )
    whole, reflected = appearance(matrix, light), appearance(dark, light)
    colours = [
        screen_linear(xyz, whole.white)
        for xyz in (whole.xyz, reflected.xyz, np.maximum(whole.xyz - reflected.xyz, 0.0))
    ]
    return LitSwatch(light.name, *(css_colour(np.clip(colour, 0.0, 1.0)) for colour in colours))
