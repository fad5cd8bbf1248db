"""Elements of a report: sections with text, figures and tables, and rendered results."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from labrig.acquire import RigFile
from labrig.optics import CameraResponse
from labrig.record import RunDescription, RunRecord
from labrig.report.chart import Chart

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def own_template(module: str, name: str) -> str:
    """Return the path of a template `name.html.j2` beside a module, given by its `__file__`."""
    return str(Path(module).resolve().with_name(f"{name}.html.j2"))


@dataclass(frozen=True)
class Picture:
    """Figure of a report with its caption.

    Attributes
    ----------
    name
        Name of its file: lower case, unique in its section.
    drawing
        Chart, or function that draws a figure with matplotlib, called within `figure_style`.
    caption
        Description of the figure, with units and the meaning of error bars.
    """

    name: str
    drawing: "Chart | Callable[[], Figure]"
    caption: str = ""

    def figure(self) -> "Figure":
        """Return the figure as drawn by matplotlib, within `figure_style`."""
        if isinstance(self.drawing, Chart):
            from labrig.report.chart_figure import chart_figure  # matplotlib is slow to load

            return chart_figure(self.drawing)
        return self.drawing()


@dataclass(frozen=True)
class Table:
    """Table of a report, whose first column names the rows; the others are numbers.

    Attributes
    ----------
    head
        Heads of the columns.
    rows
        Rows of cells, each as long as `head`.
    caption
        Text below the table.
    title
        Heading of the table; empty without one.
    links
        Address to which the first cell of each row leads, empty without one; () without any.
    """

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    caption: str = ""
    title: str = ""
    links: tuple[str, ...] = ()


@dataclass(frozen=True)
class Section:
    """Section of a report.

    Attributes
    ----------
    title
        Heading of the section.
    text
        Paragraphs of text.
    figures, tables
        Figures and tables, in order.
    points
        Items of a list that follows the text.
    part
        Name of the part of a chain of protocols; empty if the run is no chain.
    anchor
        Target of links to the section; empty without links.
    template
        File name of the template of the layout.
    content
        Data for the template besides text, figures and tables.
    """

    title: str
    text: tuple[str, ...] = ()
    figures: tuple[Picture, ...] = ()
    tables: tuple[Table, ...] = ()
    points: tuple[str, ...] = ()
    part: str = ""
    anchor: str = ""
    template: str = "section.html.j2"
    content: Any = None


@dataclass(frozen=True)
class Source:
    """Source of a result: run, protocol and rig.

    Attributes
    ----------
    run
        Part of the run that belongs to the protocol; its photographs may be shown.
    protocol
        Model of the protocol.
    rig
        Rig file of the run.
    about
        Description of the run, its bench and the processing.
    camera
        Spectral responses of the camera, for colours; None if they are not known.
    anchor
        Beginning of the names of all link targets.
    """

    run: RunRecord
    protocol: Any
    rig: RigFile
    about: RunDescription
    camera: CameraResponse | None = None
    anchor: str = ""


@dataclass(frozen=True)
class Rendered:
    """Result as sections of a report and lines of text.

    Attributes
    ----------
    sections
        Sections of the report, in order.
    lines
        Most important numbers, in lines for the terminal.
    methods
        Sections with methods, for the end of the report.
    """

    sections: tuple[Section, ...]
    lines: tuple[str, ...]
    methods: tuple[Section, ...] = ()


class Renderer(Protocol):
    """Function that renders a result, named by the measurement's registration."""

    def __call__(self, result: Any, source: Source, /) -> Rendered:
        """Render a result of the type that belongs to the protocol."""
