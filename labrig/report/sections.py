"""Parts of a report that any protocol can have: text, figures, tables."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

from matplotlib.figure import Figure

from labrig.acquire import RigFile
from labrig.optics import CameraResponse
from labrig.record import RunDescription, RunRecord


@dataclass(frozen=True)
class Picture:
    """A figure.

    Attributes
    ----------
    name
        Of its file: lower case, unique in its section.
    draw
        Makes the figure, when it is wanted and within the page's style.
    caption
        What is to be seen, with units; what error bars are.
    """

    name: str
    draw: Callable[[], Figure]
    caption: str = ""


@dataclass(frozen=True)
class Table:
    """A table; the first column names its row, the others are numbers."""

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    caption: str = ""
    title: str = ""


@dataclass(frozen=True)
class Section:
    """What one thing that was measured looks like in a report.

    Attributes
    ----------
    title
        Its heading.
    text
        Paragraphs.
    figures, tables
        In this order.
    points
        Sentences of a list, after the text.
    part
        The part of a chain that it belongs to; empty if the run is none.
    anchor
        What links to it are made to; empty if there are none.
    template, content
        How it is laid out, and what that needs besides the figures.
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
    """What a result was found in.

    Attributes
    ----------
    run
        The protocol's part of the run; its photographs may be shown.
    protocol
        Its model.
    rig
        The bench as it was.
    about
        The run, its bench and what its result was made with.
    camera
        The camera's curves, for colours; None if they are not known.
    anchor
        Begins the names of places in the page that links lead to.
    """

    run: RunRecord
    protocol: Any
    rig: RigFile
    about: RunDescription
    camera: CameraResponse | None = None
    anchor: str = ""


@dataclass(frozen=True)
class Rendered:
    """A result for people.

    Attributes
    ----------
    sections
        Of the report, in this order.
    lines
        The numbers that matter, for the terminal.
    methods
        How it was done, for the end of the report.
    """

    sections: tuple[Section, ...]
    lines: tuple[str, ...]
    methods: tuple[Section, ...] = ()


class Renderer(Protocol):
    """A protocol's part of a report, registered in `labrig.reports` under the protocol's name."""

    def __call__(self, result: Any, source: Source, /) -> Rendered:
        """Show a result of the protocol's own type."""
