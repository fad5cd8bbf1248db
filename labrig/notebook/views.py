"""Page and figures of a result, by the sections with which it describes itself."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

from labrig.foundation.errors import UsageError
from labrig.foundation.notebook_views import NotebookViews
from labrig.foundation.yaml_file import did_you_mean
from labrig.notebook.described import Description, describe
from labrig.report import (
    WIDTH_PT,
    Chart,
    NotebookPage,
    Picture,
    columns_pictures,
    figure_style,
    notebook_html,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def html(result: NotebookViews) -> str:
    """Return a result as HTML for the output of a notebook's cell.

    Parameters
    ----------
    result
        A result, fit, series, material or run.

    Returns
    -------
    str
        The tables of its report, and the figures that take no time; all others by name.

    Raises
    ------
    DataError
        The run's folder was changed since the result was read.

    Examples
    --------
    >>> import labrig
    >>> from labrig.notebook import html
    >>> "Rate <i>k</i><sub>" in html(labrig.read_result("runs/decay"))
    True
    """
    described = describe(result)
    files = (path.rpartition("/")[2].removesuffix(".csv") for path in result.csv_tables())
    return notebook_html(
        NotebookPage(
            described.kind,
            described.title,
            described.run,
            described.warnings,
            described.sections,
            figures=tuple(name for name, _ in _pictures(result, described)),
            tables=tuple(dict.fromkeys([*files, "values"])),
        )
    )


def plot(result: NotebookViews, name: str = "") -> "Figure":
    """Draw a figure of a result.

    Parameters
    ----------
    result
        A result, fit, series or material.
    name
        Name of the figure, or its start; the first one by default.

    Returns
    -------
    matplotlib.figure.Figure
        The figure of the report, to be changed and saved; a notebook shows it.

    Raises
    ------
    UsageError
        There is no such figure, or nothing to draw.

    Examples
    --------
    >>> import labrig
    >>> from labrig.notebook import plot
    >>> figure = plot(labrig.read_result("runs/decay"), "residuals")
    >>> figure.axes[0].get_ylabel()
    'Residual / σ'
    """
    pictures = dict(_pictures(result, describe(result)))
    kind = type(result).__name__
    if not pictures:
        raise UsageError(f"{kind}: there is nothing to draw: it has single values only")
    # One of many small ones is no figure to begin with.
    whole = (each for each in pictures if name or not _is_small(pictures[each]))
    begin_alike = (each for each in (*whole, *pictures) if each.startswith(name))
    chosen = name if name in pictures else next(begin_alike, None)
    if chosen is None:
        known = did_you_mean(name, list(pictures))
        raise UsageError(f"{kind}: there is no figure '{name}'; {known}")
    with figure_style():
        figure = pictures[chosen].figure()
    figure.patch.set(visible=True, facecolor="white")
    return figure


def _is_small(picture: Picture) -> bool:
    return isinstance(picture.drawing, Chart) and picture.drawing.width_pt < WIDTH_PT


def _pictures(result: NotebookViews, described: Description) -> Iterator[tuple[str, Picture]]:
    """Yield all figures by names of their own, with the section before the name where two have one.

    Of a result whose description has none, its columns are drawn.
    """
    sections = described.sections
    names = [picture.name.strip("-") for section in sections for picture in section.figures]
    seen: set[str] = set()
    for section in sections:
        for picture in section.figures:
            name = picture.name.strip("-")
            whole = name if names.count(name) == 1 else f"{section.title} {name}".strip()
            whole = f"{section.part} {whole}" if whole in seen and section.part else whole
            seen.add(whole)
            yield whole, picture
    if not names:
        for picture in columns_pictures(result):
            yield picture.name, picture
