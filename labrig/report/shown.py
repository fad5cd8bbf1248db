"""Sections of a report with their figures drawn."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from labrig.report.plates import Plate, Plates
from labrig.report.sections import Section


@dataclass(frozen=True)
class Shown:
    """A section whose figures are drawn; captions stand beside them.

    Attributes
    ----------
    plates
        The figures with their captions, in order.
    plate
        The same by name.
    """

    section: Section
    plates: tuple[tuple[Plate, str], ...]
    plate: Mapping[str, Plate]


def draw(sections: Sequence[Section], plates: Plates) -> list[Shown]:
    """Add all figures of the sections to the page's `plates`."""
    return [_drawn(number, section, plates) for number, section in enumerate(sections, 1)]


def _drawn(number: int, section: Section, plates: Plates) -> Shown:
    plate = {
        one.name: plates.add(one.draw(), f"{number}-{one.name}", f"{section.title}: {one.name}")
        for one in section.figures
    }
    return Shown(section, tuple((plate[one.name], one.caption) for one in section.figures), plate)
