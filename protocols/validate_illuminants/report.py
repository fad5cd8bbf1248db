"""Report of photographs under lamps beside predictions."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from labrig.foundation.number_format import plus_minus, rounded
from labrig.optics import XYZ_TO_SRGB
from labrig.protocols.validate_illuminants.result import ValidateIlluminantsResult
from labrig.report.colours import css_colour, into_gamut
from labrig.report.sections import Rendered, Section, Source, Table, own_template
from labrig.results import LampComparison, LampPatch, Measured, SeenColour

WHITES = {
    "lamp": "Colours with a perfect white under the lamp.",
    "D65": (
        "The lamp shows no white: colours as on a screen (D65), exposed so that the brightest "
        "predicted sample all but clips."
    ),
}
SCALES = {
    "card": "",
    "samples": (
        "The camera hardly sees this lamp, so that the card does not measure its brightness: one "
        "number for all samples is fitted to the samples themselves. Reflected light is that of "
        "the tails of its spectrum, by the card."
    ),
}


@dataclass(frozen=True)
class ComparedSwatch:
    """A sample under a lamp on a screen, colours as `#rrggbb`.

    Attributes
    ----------
    name
        Name of the sample.
    measured, whole, reflected, reradiated
        Colour as photographed, as predicted, of the reflected and of the re-radiated part.
    difference, without
        ΔE2000 of photograph and prediction, and of photograph and the reflected part.
    """

    name: str
    measured: str
    whole: str
    reflected: str
    reradiated: str
    difference: str
    without: str


def render(result: ValidateIlluminantsResult, source: Source) -> Rendered:
    """Render the lamps with their verdicts, then each with its samples."""
    lines = tuple(f"{lamp}: {_line(comparison)}" for lamp, comparison in result.lamps.items())
    sections = [_overview(result)]
    for lamp, comparison in result.lamps.items():
        sections += _lamp_sections(lamp, comparison, result)
    return Rendered(tuple(sections), lines)


def _line(comparison: LampComparison) -> str:
    differences = [patch.delta_e.value for patch in comparison.patches.values()]
    without = [patch.delta_e_reflected.value for patch in comparison.patches.values()]
    return (
        f"{comparison.verdict} (χ² per channel {comparison.reduced_chi2:.2f}, largest pull "
        f"{comparison.largest_pull:+z.1f} σ); ΔE2000 up to {max(differences):.1f}, without "
        f"fluorescence up to {max(without):.1f}"
    )


def _overview(result: ValidateIlluminantsResult) -> Section:
    rows = tuple(
        (
            lamp,
            rounded(comparison.brightness, 3),
            comparison.scale,
            f"{comparison.reduced_chi2:.2f}",
            f"{comparison.largest_pull:+z.1f}",
            _of_patches([patch.delta_e.value for patch in comparison.patches.values()]),
            _of_patches([patch.delta_e_reflected.value for patch in comparison.patches.values()]),
            comparison.verdict,
        )
        for lamp, comparison in result.lamps.items()
    )
    table = Table(
        (
            "lamp", "brightness / (DN/s)", "by", "χ² per channel", "largest pull", "ΔE2000",
            "ΔE2000 without fluorescence", "verdict",
        ),
        rows,
        "ΔE2000: median and largest of the samples. Verdict: differs if the mean χ² per channel is "
        "above 2 or a pull above 4 σ.",
    )  # fmt: skip
    return Section("Lamps", tuple(_overview_text(result)), tables=(table,))


def _of_patches(values: list[float]) -> str:
    return f"{np.median(values):.1f}, {max(values):.1f}"


def _overview_text(result: ValidateIlluminantsResult) -> Iterator[str]:
    yield f"Predicted from {result.fluorescence}."
    missing = result.without_matrix_sigma
    matrix = "and of the matrices, whose neighbouring numbers are taken to err together"
    if len(missing) == len(next(iter(result.lamps.values())).patches):
        matrix = "not of the matrices, which have none"
    elif missing:
        matrix += f" ({', '.join(missing)}: there is none)"
    yield (
        "σ is that of the photographs (noise, flicker), of the lamps' spectra (8 %, smooth), the "
        f"camera's curves and the card, as far as the card leaves them open, {matrix}. Not in it: "
        "the turn of values into colours, which photograph and prediction share, stray light, and "
        "samples that moved, bleached or are uneven."
    )
    if result.chart_delta_e is not None:
        mean, largest = result.chart_delta_e
        yield (
            f"Colours by the ColorChecker under {result.balance}, whose patches come out with a "
            f"mean ΔE2000 of {mean:.1f}, at most {largest:.1f}."
        )
    else:
        yield "Colours by the camera's curves and the lamps' spectra."


def _lamp_sections(
    lamp: str, comparison: LampComparison, result: ValidateIlluminantsResult
) -> Iterator[Section]:
    swatches = tuple(_swatch(name, patch) for name, patch in comparison.patches.items())
    text = [WHITES[comparison.white], SCALES[comparison.scale]]
    text.append(f"In the pictures a white under {result.balance} is white.")
    yield Section(
        f"Under {lamp}",
        tuple(line for line in text if line),
        tables=(_values(comparison, result.channels), _colours(comparison)),
        template=own_template(__file__, "illuminants"),
        content=swatches,
    )


def _swatch(name: str, patch: LampPatch) -> ComparedSwatch:
    return ComparedSwatch(
        name,
        measured=_shown(patch.measured),
        whole=_shown(patch.whole),
        reflected=_shown(patch.reflected_only),
        reradiated=_shown(patch.reradiated_only),
        difference=_told(patch.delta_e),
        without=_told(patch.delta_e_reflected),
    )


def _shown(colour: SeenColour) -> str:
    """Return a colour of a picture as `#rrggbb`; what is too bright for a screen is clipped."""
    return css_colour(np.clip(into_gamut(XYZ_TO_SRGB @ colour.xyz), 0.0, 1.0))


def _told(value: Measured) -> str:
    return plus_minus(value.value, value.sigma)


def _values(comparison: LampComparison, channels: tuple[str, ...]) -> Table:
    full = max(float(patch.predicted.max()) for patch in comparison.patches.values())
    unit = full / 100 if full > 0 else 1.0
    rows = tuple(
        (
            name,
            *(
                plus_minus(v / unit, s / unit)
                for v, s in zip(patch.value, patch.sigma, strict=True)
            ),
            *(
                plus_minus(v / unit, s / unit)
                for v, s in zip(patch.predicted, patch.predicted_sigma, strict=True)
            ),
            *(f"{pull:+z.1f}" for pull in patch.pull),
        )
        for name, patch in comparison.patches.items()
    )
    head = [f"{what} {k}" for what in ("measured", "predicted", "pull") for k in channels]
    caption = (
        f"Values in per cent of the largest predicted one, {rounded(full, 3)} DN/s. Pull: measured "
        "less predicted over the σ of both."
    )
    return Table(("", *head), rows, caption)


def _colours(comparison: LampComparison) -> Table:
    rows = tuple(
        (
            name,
            *(f"{number:.1f}" for number in (*patch.measured.lab, *patch.whole.lab)),
            _told(patch.delta_e),
            f"{patch.delta_e_by_errors:.1f}",
            _told(patch.delta_e_reflected),
        )
        for name, patch in comparison.patches.items()
    )
    return Table(
        (
            "", "measured L*", "a*", "b*", "predicted L*", "a*", "b*", "ΔE2000",
            "by errors alone", "without fluorescence",
        ),
        rows,
        "CIELAB, CIE 1931 2° observer. By errors alone: the root mean square of ΔE2000 that σ of "
        "both would make if the prediction were right.",
    )  # fmt: skip
