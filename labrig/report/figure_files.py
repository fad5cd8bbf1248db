"""Files of figures: SVG on a page and beside it, one PDF of all, pictures that a command draws.

On the page, colours are CSS variables with the colour of the light scheme as fallback, so that one
figure serves the light scheme, the dark scheme and print. Text remains text: on the page it takes
the page's font and can be searched, in the files it can be edited.
"""

import html
import re
from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

from markupsafe import Markup

from labrig.foundation.activity import counted
from labrig.foundation.errors import UsageError
from labrig.foundation.output_file import make_folder, make_folder_in, write_durably, write_text
from labrig.report.chart import Chart
from labrig.report.chart_svg import svg_body
from labrig.report.figure_style import VARIABLES, figure_style
from labrig.report.sections import Picture, Section

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FOLDER = "figures"
#: Fonts of the SVG files: the font of matplotlib's figures, then fonts of the same width.
_FONTS = "'DejaVu Sans', Verdana, Arial, sans-serif"
_GROUND = '<rect width="100%" height="100%" fill="#ffffff"/>'
_NAMESPACES = 'xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"'
_TAG = re.compile(r"<[^>]*>")
#: Pattern of the digits beyond a hundredth of a point.
_TOO_FINE = re.compile(r"(?<=\.\d\d)\d+")
#: Pattern of a group of markers that have the same style, each with its own style attribute.
_MARKERS = re.compile(
    r'<g( [^>]*)?>((?:<use [^>]*style="([^"]*)"/>)(?:<use [^>]*style="\3"/>)*)</g>'
)
_COLOUR = re.compile("|".join(VARIABLES))
_MAX_SLUG = 40
#: Dots per inch of images in a figure, such as a matrix; all else has none.
_IMAGE_DPI = 200


@dataclass(frozen=True)
class FigureFile:
    """Figure of the report.

    Attributes
    ----------
    element
        Element `<svg>` in the colours of the page.
    link
        Link to the SVG file of the figure.
    """

    element: Markup
    link: str


class FigureFiles:
    """Collection of the figures of one report."""

    def __init__(self) -> None:
        self._files: dict[str, str] = {}

    def add(self, picture: Picture, name: str, description: str) -> FigureFile:
        """Draw a picture and add it to the files.

        Parameters
        ----------
        picture
            Picture that is drawn.
        name
            Name, unique in the report; it begins the name of the file and the ids of its elements.
        description
            Description for screen readers.
        """
        name = slug(name)
        if isinstance(picture.drawing, Chart):
            width, height = picture.drawing.width_pt, picture.drawing.height_pt
            body = svg_body(picture.drawing)
        else:
            with figure_style():
                figure = picture.figure()
                width, height = figure.get_size_inches() * 72
                body = _matplotlib_body(figure)
        box = _box(width, height)
        self._files[f"{name}.svg"] = (
            f'<?xml version="1.0" encoding="utf-8"?>\n<svg {_NAMESPACES} width="{width:g}pt" '
            f'height="{height:g}pt" {box} font-family="{_FONTS}" '
            f'stroke-linejoin="round">{_GROUND}{body}</svg>\n'
        )
        return FigureFile(
            element=_element(box, _with_own_ids(body, name), description),
            link=f"{FOLDER}/{name}.svg",
        )

    def write(self, folder: Path) -> None:
        """Write all files into a folder `figures` in `folder`, after the last was added.

        Raises
        ------
        DiskError
            If the files cannot be written.
        """
        figures_folder = make_folder_in(folder, FOLDER)
        for name, text in self._files.items():
            write_text(figures_folder / name, text)


def chart_element(chart: Chart, description: str) -> Markup:
    """Return a chart as element `<svg>` of the page, without a file of its own."""
    return _element(_box(chart.width_pt, chart.height_pt), svg_body(chart), description)


def _box(width_pt: float, height_pt: float) -> str:
    """Return the attribute of the size of a figure."""
    return f'viewBox="0 0 {width_pt:g} {height_pt:g}"'


def _element(box: str, body: str, description: str) -> Markup:
    """Return a figure as element `<svg>` in the colours of the page."""
    body = _COLOUR.sub(lambda colour: f"var(--{VARIABLES[colour[0]]}, {colour[0]})", body)
    return Markup(f'<svg {box} role="img" aria-label="{html.escape(description)}">{body}</svg>')


def slug(name: str) -> str:
    """Return a name with letters, digits and hyphens only, as addresses, files and ids need it."""
    return re.sub(r"[^A-Za-z0-9]+", "-", name)[:_MAX_SLUG].strip("-")


def _matplotlib_body(figure: "Figure") -> str:
    """Return what the element `<svg>` of a figure contains."""
    buffer = BytesIO()
    # Without dates and versions the same figures give the same bytes.
    no_metadata = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    figure.savefig(buffer, format="svg", metadata=no_metadata, dpi=_IMAGE_DPI)
    text = buffer.getvalue().decode("utf-8")
    text = text[text.index("<svg") :].strip()
    text = _TAG.sub(lambda tag: _TOO_FINE.sub("", tag[0]), text)
    text = _MARKERS.sub(_share_style, re.sub(r">\s+<", "><", text))
    body = text.split(">", 1)[1].removesuffix("</svg>")
    # Its style sheet would hold for the whole page, which has one of its own.
    body = re.sub(r"<defs>\s*<style.*?</style>\s*</defs>", "", body, flags=re.DOTALL)
    return re.sub(r" font-family: [^;\"]*;", "", body)


def _share_style(markers: re.Match[str]) -> str:
    """Return a group of markers with their common style at the group."""
    own, uses, style = markers.groups()
    bare = uses.replace(f' style="{style}"', "")
    return f'<g{own or ""} style="{style}">{bare}</g>'


def _with_own_ids(body: str, name: str) -> str:
    """Return the body of a figure with ids that begin with its name.

    Ids of matplotlib are unique in a figure, not in a page of figures.
    """
    body = re.sub(r'\bid="', f'id="{name}-', body)
    return body.replace("url(#", f"url(#{name}-").replace('xlink:href="#', f'href="#{name}-')


def write_figures_pdf(path: Path, title: str, sections: Sequence[Section]) -> int:
    """Draw the figures of all sections as pages of one PDF.

    Text remains text, in an embedded font. The same sections give the same bytes.

    Parameters
    ----------
    path
        Path of the PDF.
    title
        Title of the PDF.
    sections
        Sections of a report.

    Returns
    -------
    int
        Number of pages; without figures no file is written.

    Raises
    ------
    DiskError
        If `path` cannot be written.

    Examples
    --------
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from labrig.report import Picture, Section, new_figure, place, write_figures_pdf
    >>> def line():
    ...     figure = new_figure(200)
    ...     place(figure, left=62, bottom=38, right=12, top=30).plot([0, 1], [1, 0])
    ...     return figure
    >>> section = Section("Decay", figures=(Picture("line", line),))
    >>> write_figures_pdf(Path("figures.pdf"), "A line", [section])
    1
    """
    from matplotlib.backends.backend_pdf import PdfPages  # slow to load

    pictures = [picture for section in sections for picture in section.figures]
    if not pictures:
        return 0
    # Without dates and versions the same figures give the same bytes.
    metadata = {"Title": title, "Creator": "labrig", "Producer": None, "CreationDate": None}
    content = BytesIO()
    with figure_style(), PdfPages(content, metadata=metadata) as pdf:
        for picture in counted(pictures, "drawing figures"):
            figure = picture.figure()
            figure.patch.set(visible=True, facecolor="white")
            pdf.savefig(figure)
    make_folder(path.parent)
    write_durably(path, content.getvalue())
    return len(pictures)


PICTURES = (".png", ".svg", ".pdf")
DPI = 150


def require_picture(path: Path) -> None:
    """Refuse, before anything is drawn, a file name that is not that of a picture.

    Parameters
    ----------
    path
        Path of the picture.

    Raises
    ------
    UsageError
        It does not end in `.png`, `.svg` or `.pdf`.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.report import require_picture
    >>> require_picture(Path("glow.png"))
    """
    if path.suffix.lower() not in PICTURES:
        raise UsageError(f"{path}: expected a file name that ends in {', '.join(PICTURES)}")


def save_picture(figure: "Figure", path: Path, dpi: float = DPI) -> None:
    """Write a figure into a file, in the format of its ending.

    Parameters
    ----------
    figure
        Figure of matplotlib.
    path
        Path of the file, which ends in `.png`, `.svg` or `.pdf`.
    dpi
        Pixels of each inch.

    Raises
    ------
    DiskError
        The file cannot be written.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.report import new_figure, save_picture
    >>> save_picture(new_figure(200), Path("empty.png"))
    >>> Path("empty.png").is_file()
    True
    """
    content = BytesIO()
    figure.savefig(content, format=path.suffix[1:].lower(), dpi=dpi)
    write_durably(path, content.getvalue())
