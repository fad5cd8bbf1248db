"""The report of a run: one HTML file that needs nothing else, and its figures for print beside it.

Each figure is drawn for the page and as SVG file, and is a page of a PDF. On the page, colours are
CSS variables with the light scheme's colour as fallback, so that one figure serves the light
scheme, the dark one and print. Text stays text: on the page it takes the page's font and can be
searched, in the files it can be edited.
"""

import html
import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from io import BytesIO
from pathlib import Path
from types import TracebackType
from typing import Self

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup, escape
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure

from labrig.errors import DiskError
from labrig.optics import CameraResponse
from labrig.quantity import duration_text
from labrig.record import FrameRecord, RunDescription
from labrig.report import parameters
from labrig.report.figure_style import VARIABLES, figure_style
from labrig.report.sections import Section
from labrig.written_numbers import plus_minus, rounded

FOLDER, PDF = "figures", "figures.pdf"
#: Fonts of the SVG files: as drawn, then what is as wide on computers without it.
_FONTS = "'DejaVu Sans', Verdana, Arial, sans-serif"
_GROUND = '<rect width="100%" height="100%" fill="#ffffff"/>'
_TAG = re.compile(r"<[^>]*>")
#: Digits beyond a hundredth of a point.
_TOO_FINE = re.compile(r"(?<=\.\d\d)\d+")
#: Markers of one look; each carries the look by itself.
_MARKERS = re.compile(
    r'<g( [^>]*)?>((?:<use [^>]*style="([^"]*)"/>)(?:<use [^>]*style="\3"/>)*)</g>'
)
_LONGEST_SLUG = 40


@dataclass(frozen=True)
class FigureFile:
    """A figure of the report.

    Parameters
    ----------
    element
        For the page: `<svg>` in the page's colours.
    svg_link, pdf_link
        The files beside the page: the figure alone, and its page in the PDF of all figures.
    """

    element: Markup
    svg_link: str
    pdf_link: str


class FigureFiles:
    """Collects the figures of one report; within `figure_style`.

    Parameters
    ----------
    title
        Of the PDF.
    """

    def __init__(self, title: str) -> None:
        self._files: dict[str, str] = {}
        self._buffer = BytesIO()
        # Without dates and versions the same figures give the same bytes.
        about = {"Title": title, "Creator": "labrig", "Producer": None, "CreationDate": None}
        self._pdf = PdfPages(self._buffer, metadata=about)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._pdf.close()  # type: ignore[no-untyped-call]

    def add(self, figure: Figure, name: str, described: str) -> FigureFile:
        """Draw `figure`.

        Parameters
        ----------
        name
            Unique in the report; begins its file's name and the ids of its parts.
        described
            What it shows, for those who cannot see it.
        """
        name = _slug(name)
        drawn = _svg(figure)
        self._files[f"{name}.svg"] = _file(drawn)
        figure.patch.set(visible=True, facecolor="white")
        self._pdf.savefig(figure)  # type: ignore[no-untyped-call]
        return FigureFile(
            element=Markup(_element(drawn, figure, name, described)),
            svg_link=f"{FOLDER}/{name}.svg",
            pdf_link=f"{FOLDER}/{PDF}#page={len(self._files)}",
        )

    def write(self, folder: Path) -> None:
        """Write all files into a folder `figures` in `folder`, after the last was added.

        Raises
        ------
        OSError
            They cannot be written.
        """
        place = folder / FOLDER
        place.mkdir(exist_ok=True)
        for name, text in self._files.items():
            (place / name).write_text(text, encoding="utf-8", newline="\n")
        (place / PDF).write_bytes(self._buffer.getvalue())


def _slug(name: str) -> str:
    """`name` with nothing in it that an address, a disk or an id would trip over."""
    return re.sub(r"[^A-Za-z0-9]+", "-", name)[:_LONGEST_SLUG].strip("-")


def _svg(figure: Figure) -> str:
    """The figure as SVG, from its root element on."""
    buffer = BytesIO()
    nothing = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    figure.savefig(buffer, format="svg", metadata=nothing)
    text = buffer.getvalue().decode("utf-8")
    text = text[text.index("<svg") :].strip()
    text = _TAG.sub(lambda tag: _TOO_FINE.sub("", tag[0]), text)
    return _MARKERS.sub(_styled_once, re.sub(r">\s+<", "><", text))


def _styled_once(markers: re.Match[str]) -> str:
    own, uses, style = markers.groups()
    bare = uses.replace(f' style="{style}"', "")
    return f'<g{own or ""} style="{style}">{bare}</g>'


def _file(drawn: str) -> str:
    """A file on a white ground."""
    root, body = drawn.split(">", 1)
    body = re.sub(r"font-family: [^;\"]*", f"font-family: {_FONTS}", body)
    return f'<?xml version="1.0" encoding="utf-8"?>\n{root}>{_GROUND}{body}\n'


def _element(drawn: str, figure: Figure, name: str, described: str) -> str:
    body = drawn.split(">", 1)[1]
    width, height = figure.get_size_inches() * 72
    # Its style sheet would hold for the whole page, which has one of its own.
    body = re.sub(r"<defs>\s*<style.*?</style>\s*</defs>", "", body, flags=re.DOTALL)
    body = re.sub(r" font-family: [^;\"]*;", "", body)
    # Ids are unique in a figure, not in a page of figures.
    body = re.sub(r'\bid="', f'id="{name}-', body)
    body = body.replace("url(#", f"url(#{name}-").replace('xlink:href="#', f'href="#{name}-')
    for colour, variable in VARIABLES.items():
        body = body.replace(colour, f"var(--{variable}, {colour})")
    label = html.escape(described)
    return f'<svg viewBox="0 0 {width:g} {height:g}" role="img" aria-label="{label}">{body}'


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
class RenderedSection:
    """A section whose figures are drawn; captions stand beside them.

    Attributes
    ----------
    figures
        The figures with their captions, in order.
    by_name
        The same by name.
    """

    section: Section
    figures: tuple[tuple[FigureFile, str], ...]
    by_name: Mapping[str, FigureFile]


def draw(sections: Sequence[Section], figure_files: FigureFiles) -> list[RenderedSection]:
    """Add all figures of the sections to the page's `figure_files`."""
    return [_drawn(number, section, figure_files) for number, section in enumerate(sections, 1)]


def _drawn(number: int, section: Section, figure_files: FigureFiles) -> RenderedSection:
    by_name = {
        one.name: figure_files.add(
            one.draw(), f"{number}-{one.name}", f"{section.title}: {one.name}"
        )
        for one in section.figures
    }
    return RenderedSection(
        section, tuple((by_name[one.name], one.caption) for one in section.figures), by_name
    )


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
    """Write a report as one HTML file, and its figures for print into a folder beside it.

    The figures are written into `figures` beside `path`, each as SVG file and all as one PDF. The
    same report gives the same bytes.

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
    with figure_style(), FigureFiles(f"{report.about.title}, {report.about.run}") as figure_files:
        shown = draw((*report.sections, *report.methods), figure_files)
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
        figure_files.write(path.parent)
    except OSError as error:
        raise DiskError(f"{path}: cannot be written ({error.strerror})") from None
