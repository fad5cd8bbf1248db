"""The report of any protocol but the decay, and of a chain of them: one HTML file."""

from dataclasses import dataclass
from pathlib import Path

from markupsafe import Markup

from labrig.errors import DiskError
from labrig.record.frames import FrameRecord
from labrig.report.content import DeviceLine, Interruption
from labrig.report.plates import Plates
from labrig.report.sections import Section
from labrig.report.shown import draw
from labrig.report.template import dated_notes, environment, script, style

TEMPLATE = "stage.html.j2"


@dataclass(frozen=True)
class StagePage:
    """One processed run.

    Attributes
    ----------
    title, kind
        The sample's name, and what was done with it.
    run, started, ended, rig, simulated, labrig_version, libraries, devices, guard
        As in `RunReport`.
    protocol_text, rig_text
        As in `RunReport`.
    frames
        All of them, for the list with checksums.
    warnings
        Shown on top, one line each.
    sections
        What was found, in this order.
    interruptions, notes
        As in `RunReport`.
    """

    title: str
    kind: str
    run: str
    started: str
    ended: str
    rig: str
    simulated: bool
    labrig_version: str
    libraries: tuple[tuple[str, str], ...]
    devices: tuple[DeviceLine, ...]
    guard: str
    protocol_text: str
    rig_text: str
    frames: tuple[FrameRecord, ...]
    warnings: tuple[str, ...]
    sections: tuple[Section, ...]
    interruptions: tuple[Interruption, ...] = ()
    notes: str = ""
    #: The provenance's template asks for curves that coloured the page; none do here.
    camera: None = None


def write_stage_page(path: Path, page: StagePage) -> None:
    """Write `page` to `path`, its figures into a folder `figures` beside it; in `figure_style`.

    Raises
    ------
    DiskError
        `path` cannot be written.
    """
    with Plates(f"{page.title}, {page.run}") as plates:
        shown = draw(page.sections, plates)
    text = (
        environment()
        .get_template(TEMPLATE)
        .render(
            report=page,
            shown=shown,
            notes=dated_notes(page.notes),
            style=Markup(style()),
            script=Markup(script()),
        )
    )
    try:
        path.write_text(text, encoding="utf-8", newline="\n")
        plates.write(path.parent)
    except OSError as error:
        raise DiskError(f"{path}: cannot be written ({error.strerror})") from None
