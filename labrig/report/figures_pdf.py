"""All figures of a report in one PDF, as publishers take it."""

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path

from labrig.foundation.output_file import make_folder, write_durably
from labrig.report.figure_style import figure_style
from labrig.report.sections import Section


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
        for picture in pictures:
            figure = picture.figure()
            figure.patch.set(visible=True, facecolor="white")
            pdf.savefig(figure)
    make_folder(path.parent)
    write_durably(path, content.getvalue())
    return len(pictures)
