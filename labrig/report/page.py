"""The report of a run: one HTML file that needs nothing else."""

import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup, escape

from labrig.errors import DiskError
from labrig.optics import CameraResponse
from labrig.quantity import duration_text
from labrig.record import FrameRecord, RunDescription
from labrig.report import parameters
from labrig.report.figure_style import figure_style
from labrig.report.plates import Plate, Plates
from labrig.report.sections import Section
from labrig.written_numbers import plus_minus, rounded

_FOLDER = Path(__file__).parent
_SYMBOL = re.compile(r"\b([a-z])_([a-z])\b")


@cache
def environment() -> Environment:
    """Templates of this folder, with the functions that all of them use."""
    made = Environment(
        loader=FileSystemLoader(_FOLDER),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.globals.update(
        duration_text=duration_text,
        plus_minus=plus_minus,
        rounded=rounded,
        utc=_utc,
        state_rows=parameters.state_rows,
        quality_rows=parameters.quality_rows,
        paper_rows=parameters.paper_rows,
        candidate_rows=parameters.candidate_rows,
        why_so_many_states=parameters.why_so_many_states,
    )
    made.filters["quoted"] = shlex.quote
    made.filters["indexed"] = _indexed
    made.filters["titled"] = _titled
    return made


def style() -> str:
    """The page's style sheet; labrig's own, so that it need not be escaped."""
    return (_FOLDER / "report.css").read_text(encoding="utf-8")


def script() -> str:
    """The page's script."""
    return (_FOLDER / "report.js").read_text(encoding="utf-8")


def dated_notes(text: str) -> list[tuple[str, str]]:
    """Heading and text of every note; what stands before the first heading has none."""
    before, *entries = re.split(r"^## +", text, flags=re.MULTILINE)
    split = (entry.partition("\n") for entry in entries)
    return [("", before.strip()), *((heading.strip(), rest.strip()) for heading, _, rest in split)]


def _indexed(text: str) -> Markup:
    """Symbols such as `k_i` with their index below the line."""
    return Markup(_SYMBOL.sub(r"<i>\1</i><sub><i>\2</i></sub>", str(escape(text))))


def _utc(frame: FrameRecord) -> str:
    """When the frame began."""
    start = datetime.fromtimestamp(frame.start_time, UTC)
    return start.strftime("%Y-%m-%d %H:%M:%S.%f")[:-3]


def _titled(name: str) -> str:
    """`Camera calibration` of `camera_calibration`."""
    words = name.replace("_", " ").capitalize()
    return words.replace("Lvf", "LVF")


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


TEMPLATE = "report.html.j2"


@dataclass(frozen=True)
class Report:
    """One processed run.

    Attributes
    ----------
    about
        The run, its bench and what its result was made with.
    warnings
        Shown on top, one line each.
    sections
        What was found, in this order.
    methods
        How, after what happened in the run.
    frames
        All of them, for the list with checksums.
    camera
        Whose curves coloured the page; None if none did.
    """

    about: RunDescription
    warnings: tuple[str, ...] = ()
    sections: tuple[Section, ...] = ()
    methods: tuple[Section, ...] = ()
    frames: Sequence[FrameRecord] = ()
    camera: CameraResponse | None = None


def write_report(path: Path, report: Report) -> None:
    """Write `report` to `path`, its figures for print into a folder `figures` beside it.

    The same report gives the same bytes.

    Raises
    ------
    DiskError
        `path` cannot be written.
    """
    with figure_style(), Plates(f"{report.about.title}, {report.about.run}") as plates:
        shown = draw((*report.sections, *report.methods), plates)
    text = (
        environment()
        .get_template(TEMPLATE)
        .render(
            report=report,
            about=report.about,
            found=shown[: len(report.sections)],
            methods=shown[len(report.sections) :],
            notes=dated_notes(report.about.notes),
            # Style sheet and script are labrig's own; escaping them would break them.
            style=Markup(style()),
            script=Markup(script()),
        )
    )
    try:
        path.write_text(text, encoding="utf-8", newline="\n")
        plates.write(path.parent)
    except OSError as error:
        raise DiskError(f"{path}: cannot be written ({error.strerror})") from None
