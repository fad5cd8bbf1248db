"""Report of re-radiation matrices that were measured under LEDs."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from labrig.foundation.number_format import plus_minus, rounded
from labrig.material import ReradiationMatrix, appearance
from labrig.optics import Spectrum, read_light
from labrig.protocols.led_fluorescence.report.led_figures import (
    COLOURS,
    METHODS,
    excitation_chart,
    matrix_figure,
    methods_charts,
    reflectance_chart,
    values_chart,
)
from labrig.protocols.led_fluorescence.result import LedFluorescenceResult
from labrig.report.colours import Screen, css_colour, into_gamut, screen_for
from labrig.report.figure_style import VARIABLES
from labrig.report.reradiation import screen_linear
from labrig.report.reradiation_figures import RETURNING, emission_spectra, spectra_chart
from labrig.report.sections import Picture, Rendered, Section, Source, Table, own_template
from labrig.results import ColourUnderLight, FluorescentPatch

UV_SCALE = {
    "measured": "The brightness of the ultraviolet LEDs is known.",
    "unknown": (
        "How bright the ultraviolet LEDs shone is not known (uv_scale: unknown): colours marked "
        "with * depend on it. The protocol led_brightness measures it with a spectrometer."
    ),
    "none": "No LED is in the ultraviolet: fluorescence by ultraviolet light is extrapolated.",
}
#: Number of samples beyond which each is folded up.
MAX_OPEN = 4


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


@dataclass(frozen=True)
class LitPair:
    """Colours of a sample under an LED on a screen.

    Attributes
    ----------
    led
        Name of the LED.
    photographed, predicted
        Colour as photographed and as the matrix predicts it, as `#rrggbb`.
    """

    led: str
    photographed: str
    predicted: str


@dataclass(frozen=True)
class SamplePage:
    """Values of a sample for the template, besides its text and figures.

    Attributes
    ----------
    number
        Number of the sample, counted from 1.
    is_folded
        Whether there are so many samples that each is folded up.
    photographed
        Colours under the LEDs.
    colours_known
        Whether the camera's sensitivity is known.
    halves
        Number of figures that are half as wide as the page; the others are a third as wide.
    dyes
        Tables of the dyes and of their number.
    swatches, colours
        Colours under lights, and their table.
    legend
        Name of each method, and the page's variable for its colour.
    methods_note
        What the figures of the methods show.
    differences
        Table of the colour differences between methods.
    """

    number: int
    is_folded: bool
    photographed: tuple[LitPair, ...]
    colours_known: bool
    halves: int
    dyes: tuple[Table, ...]
    swatches: tuple[LitSwatch, ...]
    colours: Table
    legend: tuple[tuple[str, str], ...]
    methods_note: str
    differences: Table


def render(result: LedFluorescenceResult, source: Source) -> Rendered:
    """Render the matrix of each sample, its spectra and colours, and the LEDs."""
    several = len(result.patches) > 1
    lines = tuple(
        f"{name}: {_line(patch)}" if several else _line(patch)
        for name, patch in result.patches.items()
    )
    sections = [_summary(result)] if several else []
    screen = screen_for(source.camera)
    for number, (name, patch) in enumerate(result.patches.items(), 1):
        sections.append(_sample(name if several else "Sample", number, patch, result, screen))
    return Rendered((*sections, _leds(result)), lines)


def _line(patch: FluorescentPatch) -> str:
    """Return the line for the terminal: number of dyes, strongest re-radiation, colour."""
    colour = patch.colours[0]
    lightness, a, b = _lab(colour)
    under = f"under {colour.light} L* {lightness}, a* {a}, b* {b}"
    if colour.depends_on_uv:
        under += ", if ultraviolet excites as little as that: its scale is not known"
    if patch.method == "per-led":
        under += "; one LED by itself, without σ"
    if not patch.dyes:
        return f"no fluorescence found; {under}"
    share, nm = _strongest_share(patch)
    dyes = "1 dye" if len(patch.dyes) == 1 else f"{len(patch.dyes)} dyes"
    return f"{dyes}, up to {share} % of {nm} nm re-radiated; {under}"


def _lab(colour: ColourUnderLight) -> tuple[str, ...]:
    """Return L*, a*, b* as texts, with σ where the method has one."""
    return tuple(map(_known, colour.lab, colour.lab_sigma))


def _known(value: float, sigma: float) -> str:
    return plus_minus(value, sigma) if np.isfinite(sigma) else f"{value:.1f}".replace("-", "−")


def _strongest_share(patch: FluorescentPatch) -> tuple[str, str]:
    """Return the largest fraction in % that is re-radiated, and of which wavelength in nm."""
    matrix = patch.matrix.named("")
    peak, sigma = _strongest(matrix, patch), matrix.reradiated_fraction_sigma
    error = np.nan if sigma is None else 100 * sigma[peak]
    return _known(100 * matrix.reradiated_fraction[peak], error), f"{matrix.input_nm[peak]:g}"


def _summary(result: LedFluorescenceResult) -> Section:
    """Return the colours and the table of all samples."""
    rows, swatches = [], []
    for name, patch in result.patches.items():
        colour, share, nm = patch.colours[0], "–", "–"
        if patch.dyes:
            share, nm = _strongest_share(patch)
        mark = " *" if colour.depends_on_uv else ""
        chi2 = rounded(patch.reduced_chi2, 2)
        rows.append((f"{name}{mark}", nm, *_lab(colour), chi2))
        swatch = _swatch(patch.matrix.named(name), read_light(colour.light))
        swatches.append((f"{name}{mark}", swatch, str(len(patch.dyes)), share))
    light = next(iter(result.patches.values())).colours[0].light
    table = Table(
        ("sample", "re-radiated most of / nm", "L*", "a*", "b*", "reduced χ²"),
        tuple(rows),
        f"L*, a*, b* under {light}, with a perfect white under it, CIE 1931 2° observer; ± 1 σ.",
    )
    return Section(
        "All samples",
        (UV_SCALE[result.uv_scale],),
        tables=(table,),
        template=own_template(__file__, "samples"),
        content=(light, tuple(swatches)),
    )


def _strongest(matrix: ReradiationMatrix, patch: FluorescentPatch) -> int:
    """Return the measured input band of the most re-radiation."""
    fraction = np.where(patch.is_extrapolated, -np.inf, matrix.reradiated_fraction)
    return int(np.argmax(fraction))


def _leds(result: LedFluorescenceResult) -> Section:
    rows = tuple(
        (
            led,
            "–" if is_lamp else f"{peak_nm:.0f}",
            f"{brightness:.4g}" if known else "not known",
        )
        for led, is_lamp, peak_nm, brightness, known in zip(
            result.leds,
            result.is_lamp,
            result.led_peak_nm,
            result.brightness,
            result.is_brightness_known,
            strict=True,
        )
    )
    table = Table(
        ("LED or lamp" if result.lamps else "LED", "peak / nm", "brightness / (DN/s)"),
        rows,
        "Brightness: counts of a perfect white in a channel of sensitivity 1.",
    )
    text = [] if len(result.patches) > 1 else [UV_SCALE[result.uv_scale]]
    if result.geometry:
        text.append(f"Reflectance is the radiance factor at {result.geometry} (light/camera).")
    return Section("LEDs", tuple(text), tables=(table,))


def _sample(
    name: str,
    number: int,
    patch: FluorescentPatch,
    result: LedFluorescenceResult,
    screen: Screen,
) -> Section:
    matrix = patch.matrix.named(name)
    halves = _half_figures(patch, matrix, result)
    thirds = [
        Picture(f"{_slug(name)}-under-{_slug(light)}", chart, f"Under {light}.")
        for light, chart in methods_charts(patch).items()
    ]
    page = SamplePage(
        number=number,
        is_folded=len(result.patches) > MAX_OPEN,
        photographed=tuple(_lit_pairs(patch, result, screen)),
        colours_known=screen.known,
        halves=len(halves),
        dyes=_dye_tables(patch, matrix),
        swatches=tuple(_swatch(matrix, read_light(colour.light)) for colour in patch.colours),
        colours=_colour_table(patch),
        legend=tuple(
            (METHODS[method], VARIABLES[COLOURS[method]])
            for method in METHODS
            if method != "direct" or patch.direct is not None
        ),
        methods_note=_methods_note(patch),
        differences=_difference_table(patch),
    )
    return Section(
        name,
        tuple(_text(patch)),
        (*halves, *thirds),
        anchor=f"sample-{number}",
        template=own_template(__file__, "fluorescent_patch"),
        content=page,
    )


def _slug(name: str) -> str:
    return "".join(letter if letter.isalnum() else "-" for letter in name.lower())


def _half_figures(
    patch: FluorescentPatch, matrix: ReradiationMatrix, result: LedFluorescenceResult
) -> tuple[Picture, ...]:
    slug = _slug(matrix.name)
    values = Picture(
        f"{slug}-values",
        values_chart(patch, result),
        "Values over the light of a white under the LED, and the values predicted by the "
        "matrix (lines). Bars: 1 σ of the values.",
    )
    reflectance = Picture(
        f"{slug}-reflectance",
        reflectance_chart(patch),
        "Reflectance by all LEDs together, with a band of ± 1 σ, and one LED by itself.",
    )
    if not patch.dyes:
        return reflectance, values
    unlit = np.where(patch.is_extrapolated, np.nan, matrix.reradiation)
    # Single numbers have no σ that holds: their errors are those of the shapes that were assumed.
    drawn = replace(matrix, reradiation=unlit, reradiation_sigma=None)
    emission = spectra_chart(emission_spectra(drawn), RETURNING)
    return (
        Picture(
            f"{slug}-matrix",
            partial(matrix_figure, matrix, patch.is_extrapolated),
            "Re-radiation per 10 nm. Hatched: incident light that no LED of known brightness had; "
            "there it is extrapolated.",
        ),
        Picture(
            f"{slug}-emission",
            emission,
            "Emission: columns of the matrix, by incident wavelength.",
        ),
        Picture(
            f"{slug}-excitation",
            excitation_chart(patch),
            "Excitation: fraction re-radiated of each incident wavelength, by all LEDs together "
            "with a band of ± 1 σ, and one LED by itself.",
        ),
        reflectance,
        values,
    )


def _methods_note(patch: FluorescentPatch) -> str:
    note = (
        "Re-radiation under each light that excites the sample, by all LEDs together and by one "
        "LED by itself, the thesis's method."
    )
    if patch.direct is None:
        return note
    return (
        f"{note} Points: as the spectrometer read it, ± 1 σ, without the part that it cannot "
        "separate from the light itself."
    )


def _lit_pairs(
    patch: FluorescentPatch, result: LedFluorescenceResult, screen: Screen
) -> Iterator[LitPair]:
    """Yield the colours under each LED; none if the camera has not three channels."""
    if len(result.channels) != 3:
        return
    for led, seen, predicted in zip(result.leds, patch.value, patch.predicted, strict=True):
        colours = into_gamut(np.array([seen, predicted]) @ screen.glow.T)
        first, second = np.clip(colours / max(float(colours[0].max()), 1e-12), 0.0, 1.0)
        yield LitPair(led, css_colour(first), css_colour(second))


def _text(patch: FluorescentPatch) -> Iterator[str]:
    if patch.method == "per-led":
        yield (
            "Matrix, dyes and colours are those of one LED by itself (method: per-led), the "
            "thesis's method. It has six numbers for three values, so that there is no σ."
        )
    elif not patch.dyes:
        yield "The values are those of a surface that only reflects."
    else:
        yield (
            "Colours, excitation and all light that comes back have σ. A single number of the "
            "matrix has none: how emission is divided between wavelengths that a camera's channels "
            "hardly tell apart follows from the shapes that emissions are assumed to have. What "
            "the matrix's files state beside a number is the spread of surfaces that explain the "
            "values alike; its error may be twice as large, and more where two dyes are seen as "
            "one."
        )
    if np.isfinite(patch.reduced_chi2):
        yield f"Reduced χ² of the values: {patch.reduced_chi2:.2f}."
    if patch.mixture is not None:
        low, high = patch.mixture.measured_nm
        yield (
            f"mixture.json: {len(patch.mixture.weights)} normal densities for the re-radiation of "
            f"{low:g} nm to {high:g} nm. What they say of other incident light is not measured."
        )
    if patch.bleaching is not None:
        ratio = plus_minus(patch.bleaching.value, patch.bleaching.sigma)
        yield f"At the end of the run the first LED gave {ratio} of its light at the start."


def _dye_tables(patch: FluorescentPatch, matrix: ReradiationMatrix) -> tuple[Table, ...]:
    if not patch.dyes:
        return ()
    return (_dye_table(patch, matrix), *((_number_table(patch),) if patch.probability else ()))


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
    """Return the probabilities of the numbers of dyes, in one row."""
    numbers = range(len(patch.probability))
    row = ("probability", *(f"{probability:.3f}" for probability in patch.probability))
    names = ("no dye", "1 dye", *(f"{number} dyes" for number in numbers[2:]))
    return Table(("", *names[: len(numbers)]), (row,))


def _difference_table(patch: FluorescentPatch) -> Table:
    """Return the colour differences between methods, a row for each two."""
    lights = tuple(dict.fromkeys(each.light for each in patch.differences))
    pairs = dict.fromkeys((each.first, each.second) for each in patch.differences)
    found = {(each.first, each.second, each.light): each for each in patch.differences}
    rows = tuple(
        (
            f"{METHODS[first]} – {METHODS[second]}",
            *(f"{found[first, second, light].delta_e:.1f}" for light in lights),
        )
        for first, second in pairs
    )
    caption = "ΔE2000 between the matrices, with a perfect white under the light."
    if patch.direct is not None:
        caption += " What the spectrometer did not measure is taken from the other method."
    return Table(("", *lights), rows, caption)


def _colour_table(patch: FluorescentPatch) -> Table:
    rows = tuple(
        (
            f"{colour.light} *" if colour.depends_on_uv else colour.light,
            *_lab(colour),
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
