"""A result as a notebook shows it: the sections of its report, without what fills a page."""

import re
from dataclasses import dataclass, replace

from markupsafe import Markup

from labrig.foundation.result_warning import ResultWarning
from labrig.report.chart import Chart
from labrig.report.figure_files import FigureFile, FigureFiles
from labrig.report.page import RenderedSection, environment, style
from labrig.report.sections import Section

TEMPLATE = "notebook.html.j2"
#: Rules for a page within another one, after those of the report.
_OWN_RULES = """
& { max-width: 1000px; margin: 0; padding: 12px 16px; font-size: 14px; border-radius: 4px; }
h1 { margin: 0; padding: 0; font-size: 22px; }
h2 { font-size: 17px; margin-bottom: 10px; }
section { margin-top: 18px; }
header { margin-bottom: 8px; }
table { width: auto; margin: 0; font-size: inherit; border: 0; }
th, td { max-width: none; text-align: left; }
tr, tbody tr:nth-child(odd), tbody tr:hover { background: none; }
.number { text-align: right; }
details.behind { margin-top: 8px; border-top: 1px solid var(--rule); padding-top: 6px; }
details.behind > section { margin-top: 10px; }
details.behind > section > h2 { display: none; }
.file, button { display: none; }
"""
#: A figure whose drawing is left out, and the target of a link to a section.
_NOT_DRAWN = re.compile(r'<figure class="plot"><figcaption>.*?</figcaption></figure>', re.DOTALL)
_TARGET = re.compile(r'(?<=<a) href="#[^"]*"| id=""')


@dataclass(frozen=True)
class NotebookPage:
    """A result for a notebook.

    Attributes
    ----------
    kind
        Kind of the result, such as the name of its protocol.
    title
        Name of the sample; empty if unknown.
    run
        Name of the run; empty without one.
    warnings
        Warnings, shown on top.
    sections
        Sections of the result; those behind the first are folded up.
    figures, tables
        Names by which figures and tables are asked for.
    """

    kind: str
    title: str = ""
    run: str = ""
    warnings: tuple[ResultWarning, ...] = ()
    sections: tuple[Section, ...] = ()
    figures: tuple[str, ...] = ()
    tables: tuple[str, ...] = ()


def notebook_html(page: NotebookPage) -> str:
    """Return a result as HTML for the output of a notebook's cell.

    The figures of the first section are drawn; of the others those that take no time.

    Parameters
    ----------
    page
        The result.

    Returns
    -------
    str
        An element `<div>` with its own style, which holds for nothing else in the notebook.

    Examples
    --------
    >>> from labrig.report import NotebookPage, Section, Table, notebook_html
    >>> section = Section("Results", tables=(Table(("", "k / s⁻¹"), (("state 1", "0.2(1)"),)),))
    >>> "0.2(1)" in notebook_html(NotebookPage("decay", sections=(section,)))
    True
    """
    bodies = [
        (section.title, Markup(_body(section, is_first=number == 0)))
        for number, section in enumerate(page.sections)
    ]
    # A reader looks for a curve first.
    shown = [number for number, (_, body) in enumerate(bodies) if "<svg" in body][:1]
    return (
        environment()
        .get_template(TEMPLATE)
        .render(page=page, bodies=bodies, shown=shown, style=Markup(_scoped_style()))
    )


def _body(section: Section, *, is_first: bool) -> str:
    files = FigureFiles()
    none = FigureFile(Markup(""), "")
    by_name = {
        picture.name: files.add(picture, picture.name, f"{section.title}: {picture.name}")
        if is_first or isinstance(picture.drawing, Chart)
        else none
        for picture in section.figures
    }
    figures = tuple((by_name[picture.name], picture.caption) for picture in section.figures)
    item = RenderedSection(replace(section, anchor=""), figures, by_name)
    html = environment().get_template(section.template).render(item=item)
    return _TARGET.sub("", _NOT_DRAWN.sub("", html)).strip()


def _scoped_style() -> str:
    """Return the report's style sheet for what is within the element alone."""
    rules = re.sub(r"^(:root|html|body)(?= \{)", "&", style(), flags=re.MULTILINE)
    rules = rules.replace("  :root {", "  & {").partition("@media print")[0]
    return f".labrig-result {{\n{rules}{_OWN_RULES}}}"
