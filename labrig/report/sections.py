"""Parts of a report that any protocol can have: text, figures, tables."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from matplotlib.figure import Figure


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
