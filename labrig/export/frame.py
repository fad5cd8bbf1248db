"""Tables of a result as DataFrames of pandas."""

import io
from collections import defaultdict
from typing import TYPE_CHECKING, Any

from labrig.foundation.errors import UsageError
from labrig.foundation.notebook_views import CsvTable, NotebookViews
from labrig.foundation.yaml_file import did_you_mean
from labrig.results import iter_quantities
from labrig.text_table import table_text

if TYPE_CHECKING:
    from pandas import DataFrame

#: Name of the table of all single values.
VALUES = "values"
#: Column with the folder of a table, of those that several patches or parts have alike.
PLACE = "of"


def frame_of(result: NotebookViews, name: str = "") -> "DataFrame":
    """Return a table of a result as DataFrame.

    Parameters
    ----------
    result
        A result, fit or series.
    name
        Name of a CSV file of the result without its ending, such as `series`, or `values` for all
        single values. By default the first file, or the values where there is none.

    Returns
    -------
    pandas.DataFrame
        The columns of the file, with units in their names. Files of several patches or parts are
        one below the other, with the column `of` first. The table `values` has the columns
        `quantity`, `value`, `sigma` and `unit`.

    Raises
    ------
    UsageError
        There is no such table, or pandas is not installed.

    Examples
    --------
    >>> import labrig
    >>> from labrig.export import frame_of
    >>> result = labrig.read_result("runs/decay")
    >>> list(frame_of(result).columns[:4])
    ['t_s', 'exposure_s', 'R (DN/s)', 'R_sigma (DN/s)']
    >>> values = frame_of(result, "values").set_index("quantity")
    >>> values.loc["patches.sample.fit.states.1.k_r_per_s", "unit"]
    '1/s'
    """
    try:
        import pandas
    except ImportError:
        raise UsageError(
            "a DataFrame needs pandas, which is not installed; install it with: "
            "python -m pip install 'labrig[notebook]'"
        ) from None
    files: defaultdict[str, dict[str, CsvTable]] = defaultdict(dict)
    for path, table in result.csv_tables().items():
        place, _, file = path.rpartition("/")
        files[file.removesuffix(".csv")][place] = table
    name = name or next(iter(files), VALUES)
    if name == VALUES:
        rows = [
            (".".join(each.path), each.value, each.sigma, each.unit)
            for each in iter_quantities(result)
        ]
        return pandas.DataFrame(rows, columns=["quantity", "value", "sigma", "unit"])
    if name not in files:
        raise UsageError(
            f"{type(result).__name__}: there is no table '{name}'; "
            f"{did_you_mean(name, [*files, VALUES])}"
        )
    frames = {place: _frame(table) for place, table in files[name].items()}
    if len(frames) == 1:
        return next(iter(frames.values()))
    for place, frame in frames.items():
        frame.insert(0, PLACE, place)
    return pandas.concat(frames.values(), ignore_index=True)


def _frame(table: CsvTable) -> Any:
    import pandas

    # Cells that are empty have no number; texts such as `NA` are names.
    text = io.StringIO(table_text(table.head, table.rows))
    return pandas.read_csv(text, keep_default_na=False, na_values=[""])
