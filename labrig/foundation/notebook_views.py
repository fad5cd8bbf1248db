"""Views of a result in a notebook: page, figure, tables and arrays."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame
    from xarray import Dataset, DataTree


@dataclass(frozen=True)
class CsvTable:
    """Table as in a CSV file.

    Attributes
    ----------
    head
        Names of the columns, with their units.
    rows
        Cells of each row, as long as `head`; an empty text where there is no number.
    comments
        Lines above the table, each of which begins with `#`.
    """

    head: Sequence[str]
    rows: Iterable[Sequence[Any]]
    comments: Sequence[str] = ()


class NotebookViews:
    """Base of results, fits and series, which a notebook shows by how they describe themselves.

    Pages and figures are made above what holds numbers, and matplotlib, pandas and xarray are slow
    to load. So a view is loaded by its name when it is asked for.
    """

    def csv_tables(self) -> Mapping[str, CsvTable]:
        """Return the tables by file name, such as `series.csv`; none without columns of numbers."""
        return {}

    def plot(self, name: str = "") -> "Figure":
        """Draw a figure, as `labrig figures` does.

        Parameters
        ----------
        name
            Name of the figure, as the page lists it, or its start; the first one by default.

        Raises
        ------
        UsageError
            There is no such figure, or nothing to draw.
        """
        figure: Figure = resolve_name("labrig.notebook:plot")(self, name)
        return figure

    def to_pandas(self, name: str = "") -> "DataFrame":
        """Return a table, with units in the names of its columns.

        Parameters
        ----------
        name
            Name of a table, such as `series`, or `values` for every single value with σ and unit.
            By default the first table, or the values where there is none.

        Raises
        ------
        UsageError
            There is no such table, or pandas is not installed.
        """
        frame: DataFrame = resolve_name("labrig.export:frame_of")(self, name)
        return frame

    def to_xarray(self) -> "Dataset | DataTree":
        """Return all numbers with their units as attributes; σ of `x` is `x_sigma`.

        Raises
        ------
        UsageError
            xarray is not installed.
        """
        data: Dataset | DataTree = resolve_name("labrig.export:dataset_of")(self)
        return data

    def _repr_html_(self) -> str:
        """Return the page that a notebook shows."""
        html: str = resolve_name("labrig.notebook:html")(self)
        return html
