"""Report of a check of colours by a ColorChecker."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.number_format import plus_minus
from labrig.optics import XYZ_TO_SRGB
from labrig.protocols.colour_check.result import (
    CheckedColour,
    CheckedPatch,
    ColourCheckResult,
    ColourSummary,
)
from labrig.report.colours import css_colour, into_gamut
from labrig.report.sections import Rendered, Section, Source, Table, own_template


@dataclass(frozen=True)
class CheckedSwatch:
    """A patch on a screen, colours as `#rrggbb`, empty where it was not measured.

    Attributes
    ----------
    name
        Name of the patch.
    published, plain, through
        Colours.
    of_plain, of_through
        ΔE2000 from the published colour, and the allowed one.
    """

    name: str
    published: str
    plain: str
    through: str
    of_plain: str
    of_through: str


def render(result: ColourCheckResult, source: Source) -> Rendered:
    """Render the patches beside their published colours, and the verdicts."""
    return Rendered((_section(result),), tuple(_lines(result)))


def _lines(result: ColourCheckResult) -> Iterator[str]:
    yield f"plainly: {_line(result.plain)}"
    if result.through is not None:
        yield f"through the filter: {_line(result.through)}"


def _line(summary: ColourSummary) -> str:
    return (
        f"{summary.verdict}; mean ΔE2000 {summary.mean:.2f} (allowed {summary.allowed:.1f}), most "
        f"{summary.largest:.1f} in {summary.worst}"
    )


def _section(result: ColourCheckResult) -> Section:
    return Section(
        "The ColorChecker",
        tuple(_text(result)),
        tables=(_table(result),),
        template=own_template(__file__, "colour_check"),
        content=tuple(_swatch(name, patch) for name, patch in result.patches.items()),
    )


def _text(result: ColourCheckResult) -> Iterator[str]:
    yield (
        f"Published reflectances under {result.lamp}; CIELAB, CIE 1931 2° observer, with a perfect "
        f"white under this lamp. Plainly: by the curves of {result.camera}, balanced by a grey "
        "card in the chart's place."
    )
    yield from (f"{line[0].upper()}{line[1:]}." for line in _lines(result))
    balance = ", ".join(
        f"{name} {plus_minus(value, sigma)}"
        for name, value, sigma in zip(
            result.channels, result.card_balance, result.card_balance_sigma, strict=True
        )
    )
    yield f"Grey card over the prediction by curves and lamp, relative to the mean: {balance}."
    if result.card_misfit is not None and result.filter_shift_nm is not None:
        yield (
            f"Through the filter it differs {result.card_misfit:.2f} times as much as errors "
            f"allow; the strip lies {result.filter_shift_nm:+.1f} nm from where it was calibrated."
        )
    yield (
        "Allowed is the difference that known errors make: the difference of your chart from the "
        "published means (2 % of level, 1.5 % of course), curves, card, filter and noise."
    )


def _swatch(name: str, patch: CheckedPatch) -> CheckedSwatch:
    return CheckedSwatch(
        name,
        published=_shown(patch.published_xyz),
        plain=_shown(patch.plain.xyz),
        through="" if patch.through is None else _shown(patch.through.xyz),
        of_plain=_told(patch.plain),
        of_through="" if patch.through is None else _told(patch.through),
    )


def _shown(xyz: FloatArray) -> str:
    return css_colour(np.clip(into_gamut(XYZ_TO_SRGB @ xyz), 0.0, 1.0))


def _told(colour: CheckedColour) -> str:
    return f"{colour.delta_e:.1f} ({colour.allowed:.1f})"


def _table(result: ColourCheckResult) -> Table:
    def numbers(lab: FloatArray | None) -> tuple[str, ...]:
        return ("", "", "") if lab is None else tuple(f"{number:.1f}" for number in lab)

    rows = tuple(
        (
            name,
            *numbers(patch.published_lab),
            *numbers(patch.plain.lab),
            *numbers(None if patch.through is None else patch.through.lab),
        )
        for name, patch in result.patches.items()
    )
    head = ("", "published L*", "a*", "b*", "plainly L*", "a*", "b*", "through L*", "a*", "b*")
    return Table(head, rows, "All of it is in colour_check.csv.")
