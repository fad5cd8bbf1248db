"""The report of a run: one HTML file that needs nothing else."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from markupsafe import Markup

from labrig.errors import DiskError
from labrig.optics import CameraResponse
from labrig.record import FrameRecord, RunDescription
from labrig.report.figure_style import figure_style
from labrig.report.plates import Plates
from labrig.report.sections import Section
from labrig.report.shown import draw
from labrig.report.template import dated_notes, environment, script, style

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
