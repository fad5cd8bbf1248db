"""Figures as they leave: each is drawn once for the page and as SVG file, and is a page of a PDF.

On the page, colours are CSS variables with the light scheme's colour as fallback, so that one
figure serves the light scheme, the dark one and print. Text stays text: on the page it takes the
page's font and can be searched, in the files it can be edited.
"""

import re
from dataclasses import dataclass
from html import escape
from io import BytesIO
from pathlib import Path
from types import TracebackType
from typing import Self

from markupsafe import Markup
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure

from labrig.report.figure_style import VARIABLES

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
class Plate:
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


class Plates:
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

    def add(self, figure: Figure, name: str, described: str) -> Plate:
        """Draw `figure`.

        Parameters
        ----------
        name
            Unique in the report; begins its file's name and the ids of its parts.
        described
            What it shows, for those who cannot see it.
        """
        name = _slug(name)
        drawn = _drawn(figure)
        self._files[f"{name}.svg"] = _file(drawn)
        figure.patch.set(visible=True, facecolor="white")
        self._pdf.savefig(figure)  # type: ignore[no-untyped-call]
        return Plate(
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


def _drawn(figure: Figure) -> str:
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
    label = escape(described)
    return f'<svg viewBox="0 0 {width:g} {height:g}" role="img" aria-label="{label}">{body}'
