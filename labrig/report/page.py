"""Report of a run as one self-contained HTML file, with its figures in a folder beside it."""

import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import cache
from pathlib import Path

from jinja2 import (
    ChoiceLoader,
    Environment,
    FileSystemLoader,
    FunctionLoader,
    StrictUndefined,
)
from markupsafe import Markup, escape

from labrig.foundation.errors import DiskError
from labrig.foundation.input_file import read_text
from labrig.foundation.number_format import plus_minus, rounded, subscripted, typeset
from labrig.foundation.output_file import write_text
from labrig.foundation.quantity import duration_text
from labrig.foundation.result_warning import ResultWarning
from labrig.optics import CameraResponse
from labrig.record import FrameRecord, RunDescription
from labrig.report import parameters
from labrig.report.figure_files import FigureFile, FigureFiles, chart_element
from labrig.report.sections import Section
from labrig.results import interval_rows

_FOLDER = Path(__file__).parent
_SYMBOL = re.compile(r"\b([a-z])_([a-z])\b")
#: A power: an exponent without blanks, or in parentheses.
_POWER = re.compile(r"\^(?:\(([^()]*)\)|([−\w.]*\w))")


def _by_path(name: str) -> str | None:
    """Return the text of a measurement's own template, which has a path for its name."""
    return read_text(Path(name)) if Path(name).is_absolute() else None


@cache
def environment() -> Environment:
    """Return the environment of the templates in this folder, with the functions that they use."""
    templates = Environment(
        loader=ChoiceLoader([FileSystemLoader(_FOLDER), FunctionLoader(_by_path)]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    templates.globals.update(
        chart_element=chart_element,
        duration_text=duration_text,
        plus_minus=plus_minus,
        rounded=rounded,
        utc=_utc,
        state_rows=parameters.state_rows,
        interval_rows=interval_rows,
        quality_rows=parameters.quality_rows,
        reradiance_rows=parameters.reradiance_rows,
        candidate_rows=parameters.candidate_rows,
        n_states_reason=parameters.n_states_reason,
    )
    templates.filters["quoted"] = shlex.quote
    templates.filters["indexed"] = _indexed
    templates.filters["subscripted"] = subscripted
    templates.filters["titled"] = _titled
    return templates


def style() -> str:
    """Return the style sheet of the page, which is labrig's own and needs no escaping."""
    return read_text(_FOLDER / "report.css")


def script() -> str:
    """Return the script of the page."""
    return read_text(_FOLDER / "report.js")


def dated_notes(text: str) -> list[tuple[str, str]]:
    """Return heading and text of every note; text before the first heading has an empty one."""
    before, *entries = re.split(r"^## +", text, flags=re.MULTILINE)
    parts = (entry.partition("\n") for entry in entries)
    return [("", before.strip()), *((heading.strip(), rest.strip()) for heading, _, rest in parts)]


def _indexed(text: str) -> Markup:
    """Return text with indices as in `k_i` and powers as in `t^2` set as such, numbers too."""
    written = _SYMBOL.sub(r"<i>\1</i><sub><i>\2</i></sub>", str(escape(typeset(text))))
    return Markup(_POWER.sub(r"<sup>\1\2</sup>", written))


def _utc(frame: FrameRecord) -> str:
    """Return the start of a frame in UTC as text, to the millisecond."""
    start = datetime.fromtimestamp(frame.start_time, UTC)
    return start.strftime("%Y-%m-%d %H:%M:%S.%f")[:-3]


def _titled(name: str) -> str:
    """Return the name of a protocol as title: `Camera calibration` for `camera_calibration`."""
    words = name.replace("_", " ").capitalize()
    return words.replace("Lvf", "LVF").replace("Led ", "LED ")


@dataclass(frozen=True)
class RenderedSection:
    """Section whose figures are drawn.

    Attributes
    ----------
    section
        Section of the report.
    figures
        Figures with their captions, in order.
    by_name
        Figures by name.
    """

    section: Section
    figures: tuple[tuple[FigureFile, str], ...]
    by_name: Mapping[str, FigureFile]


def draw(sections: Sequence[Section], figure_files: FigureFiles) -> list[RenderedSection]:
    """Draw the figures of all sections and add them to `figure_files`."""
    return [
        _draw_section(number, section, figure_files) for number, section in enumerate(sections, 1)
    ]


def _draw_section(number: int, section: Section, figure_files: FigureFiles) -> RenderedSection:
    """Draw the figures of the `number`-th section."""
    by_name = {
        picture.name: figure_files.add(
            picture, f"{number}-{picture.name}", f"{section.title}: {picture.name}"
        )
        for picture in section.figures
    }
    return RenderedSection(
        section,
        tuple((by_name[picture.name], picture.caption) for picture in section.figures),
        by_name,
    )


TEMPLATE = "report.html.j2"
#: What stands in a page before and after sections that were made later than its other ones.
BEGIN_LATER, END_LATER = "<!-- made later -->", "<!-- end of what was made later -->"
_LATER = re.compile(f"{BEGIN_LATER}.*?{END_LATER}", re.DOTALL)


def section_page(sections: Sequence[Section], folder: Path, beside: str) -> str:
    """Return sections as a part of a page, and write their figures into a folder beside it.

    Parameters
    ----------
    sections
        Sections with figures and tables.
    folder
        Folder of the figures, which are written into `figures` in it.
    beside
        Address of that folder from the page.

    Returns
    -------
    str
        HTML of the sections, for `with_later`.

    Raises
    ------
    DiskError
        A figure cannot be written.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.report import Section, section_page
    >>> remark = Section("Remarks", text=("It was cold.",))
    >>> print(section_page([remark], Path("."), "."))
    <section>
    <h2>Remarks</h2>
    <p class="text">It was cold.</p>
    </section>
    """
    figure_files = FigureFiles()
    parts = []
    for rendered in draw(sections, figure_files):
        item = replace(
            rendered,
            figures=tuple(
                (replace(figure, link=f"{beside}/{figure.link}"), caption)
                for figure, caption in rendered.figures
            ),
        )
        parts.append(environment().get_template(rendered.section.template).render(item=item))
    try:
        figure_files.write(folder)
    except OSError as error:
        raise DiskError(f"{folder}: cannot be written ({error.strerror})") from None
    return "\n".join(part.strip() for part in parts)


def with_later(page: str, part: str) -> str | None:
    """Return a report's page with what was made later in its place; None if it has no such place.

    Parameters
    ----------
    page
        Text of a page by `write_report`.
    part
        HTML, instead of what stood there before.

    Returns
    -------
    str or None
        Text of the page.

    Examples
    --------
    >>> from labrig.report import with_later
    >>> with_later("<p>no report</p>", "<p>remark</p>") is None
    True
    """
    if not _LATER.search(page):
        return None
    return _LATER.sub(lambda _: f"{BEGIN_LATER}\n{part}\n{END_LATER}", page, count=1)


@dataclass(frozen=True)
class Report:
    """Report of one processed run.

    Attributes
    ----------
    about
        Description of the run, its bench and the processing.
    warnings
        Warnings, shown on top.
    sections
        Sections with results, in order.
    methods
        Sections with methods, which follow notes and interruptions.
    frames
        All frames of the run, for the list with checksums.
    camera
        Camera whose responses were used for the colours; None if raw values are shown.
    """

    about: RunDescription
    warnings: tuple[ResultWarning, ...] = ()
    sections: tuple[Section, ...] = ()
    methods: tuple[Section, ...] = ()
    frames: Sequence[FrameRecord] = ()
    camera: CameraResponse | None = None


def write_report(path: Path, report: Report) -> None:
    """Write a report as one HTML file, and its figures into a folder beside it.

    The figures are written into `figures` beside `path`, each as SVG file. The same report gives
    the same bytes.

    Parameters
    ----------
    path
        Path of the HTML file.
    report
        Report of one processed run.

    Raises
    ------
    DiskError
        If `path` cannot be written.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.record import RunDescription
    >>> from labrig.report import Report, Section, write_report
    >>> about = RunDescription(
    ...     title="strontium aluminate", protocol="decay", run="2026-03-01_decay",
    ...     started="10:00", ended="10:30", rig="darkroom", simulated=False, labrig_version="0.1.0"
    ... )
    >>> section = Section("Remarks", text=("The sample was at 20 °C for an hour before.",))
    >>> write_report(Path("report.html"), Report(about, sections=(section,)))
    >>> "<h1>strontium aluminate</h1>" in Path("report.html").read_text(encoding="utf-8")
    True
    """
    figure_files = FigureFiles()
    # The list of contents leads to every section.
    sections = [
        replace(section, anchor=section.anchor or f"section-{number}")
        for number, section in enumerate((*report.sections, *report.methods), 1)
    ]
    rendered = draw(sections, figure_files)
    text = (
        environment()
        .get_template(TEMPLATE)
        .render(
            report=report,
            about=report.about,
            sections=rendered[: len(report.sections)],
            methods=rendered[len(report.sections) :],
            notes=dated_notes(report.about.notes),
            # Style sheet and script are labrig's own; escaping them would break them.
            style=Markup(style()),
            script=Markup(script()),
            later=Markup(f"{BEGIN_LATER}{END_LATER}"),
        )
    )
    write_text(path, text)
    figure_files.write(path.parent)
