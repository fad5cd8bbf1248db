"""Report of a run as one self-contained HTML file, with its figures in a folder beside it.

Each figure is drawn for the page and as SVG file, and is a page of a PDF. On the page, colours are
CSS variables with the colour of the light scheme as fallback, so that one figure serves the light
scheme, the dark scheme and print. Text remains text: on the page it takes the page's font and can
be searched, in the files it can be edited.
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
from labrig.number_format import plus_minus, rounded
from labrig.optics import CameraResponse
from labrig.quantity import duration_text
from labrig.record import FrameRecord, RunDescription
from labrig.report import parameters
from labrig.report.figure_style import VARIABLES, figure_style
from labrig.report.sections import Section

FOLDER, PDF = "figures", "figures.pdf"
#: Fonts of the SVG files: the font of the figures, then fonts of the same width.
_FONTS = "'DejaVu Sans', Verdana, Arial, sans-serif"
_GROUND = '<rect width="100%" height="100%" fill="#ffffff"/>'
_TAG = re.compile(r"<[^>]*>")
#: Pattern of the digits beyond a hundredth of a point.
_TOO_FINE = re.compile(r"(?<=\.\d\d)\d+")
#: Pattern of a group of markers that have the same style, each with its own style attribute.
_MARKERS = re.compile(
    r'<g( [^>]*)?>((?:<use [^>]*style="([^"]*)"/>)(?:<use [^>]*style="\3"/>)*)</g>'
)
_LONGEST_SLUG = 40


@dataclass(frozen=True)
class FigureFile:
    """Figure of the report.

    Attributes
    ----------
    element
        Element `<svg>` in the colours of the page.
    svg_link, pdf_link
        Links to the SVG file of the figure, and to its page in the PDF of all figures.
    """

    element: Markup
    svg_link: str
    pdf_link: str


class FigureFiles:
    """Collection of the figures of one report, to be used within `figure_style`.

    Parameters
    ----------
    title
        Title of the PDF.
    """

    def __init__(self, title: str) -> None:
        self._files: dict[str, str] = {}
        self._buffer = BytesIO()
        # Without dates and versions the same figures give the same bytes.
        metadata = {"Title": title, "Creator": "labrig", "Producer": None, "CreationDate": None}
        self._pdf = PdfPages(self._buffer, metadata=metadata)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._pdf.close()  # type: ignore[no-untyped-call]

    def add(self, figure: Figure, name: str, description: str) -> FigureFile:
        """Draw a figure and add it to the files.

        Parameters
        ----------
        figure
            Figure that is drawn; its background becomes white.
        name
            Name, unique in the report; it begins the name of the file and the ids of its elements.
        description
            Description for screen readers.
        """
        name = _slug(name)
        svg = _svg(figure)
        self._files[f"{name}.svg"] = _file(svg)
        figure.patch.set(visible=True, facecolor="white")
        self._pdf.savefig(figure)  # type: ignore[no-untyped-call]
        return FigureFile(
            element=Markup(_element(svg, figure, name, description)),
            svg_link=f"{FOLDER}/{name}.svg",
            pdf_link=f"{FOLDER}/{PDF}#page={len(self._files)}",
        )

    def write(self, folder: Path) -> None:
        """Write all files into a folder `figures` in `folder`, after the last was added.

        Raises
        ------
        OSError
            If the files cannot be written.
        """
        figures_folder = folder / FOLDER
        figures_folder.mkdir(exist_ok=True)
        for name, text in self._files.items():
            (figures_folder / name).write_text(text, encoding="utf-8", newline="\n")
        (figures_folder / PDF).write_bytes(self._buffer.getvalue())


def _slug(name: str) -> str:
    """Return a name with letters, digits and hyphens only, as addresses, files and ids need it."""
    return re.sub(r"[^A-Za-z0-9]+", "-", name)[:_LONGEST_SLUG].strip("-")


def _svg(figure: Figure) -> str:
    """Return the figure as SVG, from its root element on."""
    buffer = BytesIO()
    no_metadata = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    figure.savefig(buffer, format="svg", metadata=no_metadata)
    text = buffer.getvalue().decode("utf-8")
    text = text[text.index("<svg") :].strip()
    text = _TAG.sub(lambda tag: _TOO_FINE.sub("", tag[0]), text)
    return _MARKERS.sub(_share_style, re.sub(r">\s+<", "><", text))


def _share_style(markers: re.Match[str]) -> str:
    """Return a group of markers with their common style at the group."""
    own, uses, style = markers.groups()
    bare = uses.replace(f' style="{style}"', "")
    return f'<g{own or ""} style="{style}">{bare}</g>'


def _file(svg: str) -> str:
    """Return the text of an SVG file with a white background."""
    root, body = svg.split(">", 1)
    body = re.sub(r"font-family: [^;\"]*", f"font-family: {_FONTS}", body)
    return f'<?xml version="1.0" encoding="utf-8"?>\n{root}>{_GROUND}{body}\n'


def _element(svg: str, figure: Figure, name: str, description: str) -> str:
    """Return the SVG element for the page, with its own ids and the page's colours and font."""
    body = svg.split(">", 1)[1]
    width, height = figure.get_size_inches() * 72
    # Its style sheet would hold for the whole page, which has one of its own.
    body = re.sub(r"<defs>\s*<style.*?</style>\s*</defs>", "", body, flags=re.DOTALL)
    body = re.sub(r" font-family: [^;\"]*;", "", body)
    # Ids are unique in a figure, not in a page of figures.
    body = re.sub(r'\bid="', f'id="{name}-', body)
    body = body.replace("url(#", f"url(#{name}-").replace('xlink:href="#', f'href="#{name}-')
    for colour, variable in VARIABLES.items():
        body = body.replace(colour, f"var(--{variable}, {colour})")
    label = html.escape(description)
    return f'<svg viewBox="0 0 {width:g} {height:g}" role="img" aria-label="{label}">{body}'


_FOLDER = Path(__file__).parent
_SYMBOL = re.compile(r"\b([a-z])_([a-z])\b")


@cache
def environment() -> Environment:
    """Return the environment of the templates in this folder, with the functions that they use."""
    templates = Environment(
        loader=FileSystemLoader(_FOLDER),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    templates.globals.update(
        duration_text=duration_text,
        plus_minus=plus_minus,
        rounded=rounded,
        utc=_utc,
        state_rows=parameters.state_rows,
        quality_rows=parameters.quality_rows,
        reradiance_rows=parameters.reradiance_rows,
        candidate_rows=parameters.candidate_rows,
        n_states_reason=parameters.n_states_reason,
    )
    templates.filters["quoted"] = shlex.quote
    templates.filters["indexed"] = _indexed
    templates.filters["titled"] = _titled
    return templates


def style() -> str:
    """Return the style sheet of the page, which is labrig's own and needs no escaping."""
    return (_FOLDER / "report.css").read_text(encoding="utf-8")


def script() -> str:
    """Return the script of the page."""
    return (_FOLDER / "report.js").read_text(encoding="utf-8")


def dated_notes(text: str) -> list[tuple[str, str]]:
    """Return heading and text of every note; text before the first heading has an empty one."""
    before, *entries = re.split(r"^## +", text, flags=re.MULTILINE)
    parts = (entry.partition("\n") for entry in entries)
    return [("", before.strip()), *((heading.strip(), rest.strip()) for heading, _, rest in parts)]


def _indexed(text: str) -> Markup:
    """Return text with symbols such as `k_i` set with a subscript."""
    return Markup(_SYMBOL.sub(r"<i>\1</i><sub><i>\2</i></sub>", str(escape(text))))


def _utc(frame: FrameRecord) -> str:
    """Return the begin of a frame in UTC as text, to the millisecond."""
    start = datetime.fromtimestamp(frame.start_time, UTC)
    return start.strftime("%Y-%m-%d %H:%M:%S.%f")[:-3]


def _titled(name: str) -> str:
    """Return the name of a protocol as title: `Camera calibration` for `camera_calibration`."""
    words = name.replace("_", " ").capitalize()
    return words.replace("Lvf", "LVF")


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
            picture.draw(), f"{number}-{picture.name}", f"{section.title}: {picture.name}"
        )
        for picture in section.figures
    }
    return RenderedSection(
        section,
        tuple((by_name[picture.name], picture.caption) for picture in section.figures),
        by_name,
    )


TEMPLATE = "report.html.j2"


@dataclass(frozen=True)
class Report:
    """Report of one processed run.

    Attributes
    ----------
    about
        Description of the run, its bench and the processing.
    warnings
        Warnings, one line each, shown on top.
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
        rendered = draw((*report.sections, *report.methods), figure_files)
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
        )
    )
    try:
        path.write_text(text, encoding="utf-8", newline="\n")
        figure_files.write(path.parent)
    except OSError as error:
        raise DiskError(f"{path}: cannot be written ({error.strerror})") from None
