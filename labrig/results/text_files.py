"""Writers of results as text files."""

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from labrig.foundation.output_file import write_text


def write_csv(
    path: Path,
    head: Sequence[str],
    rows: Iterable[Sequence[Any]],
    comments: Iterable[str] = (),
) -> None:
    """Write a table whose first line after the comments names the columns.

    Parameters
    ----------
    path
        File of the table.
    head
        Names of the columns.
    rows
        Cells of each row; numbers are written with as many digits as their text has.
    comments
        Lines above the table, each of which begins with `#`.

    Raises
    ------
    DiskError
        The file cannot be written.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.results import write_csv
    >>> write_csv(Path("light.csv"), ("wavelength_nm", "value"), [(500, "0.25")])
    >>> Path("light.csv").read_text().split()
    ['wavelength_nm,value', '500,0.25']
    """
    # Not above: it loads NumPy, and who lists runs needs none.
    from labrig.text_table import table_text

    write_text(path, table_text(head, rows, comments))


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Write a JSON object, one key a line; all its numbers must be finite.

    Raises
    ------
    DiskError
        The file cannot be written.
    """
    write_text(path, json_text(content) + "\n")


def json_text(content: Mapping[str, Any]) -> str:
    """Return the text of a JSON object, one key a line."""
    return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)


def finite(item: Any, spelled: Callable[[float], str | None] = lambda number: None) -> Any:
    """Return `item` with numbers that are not finite as None, or as the text by `spelled`."""
    if isinstance(item, Mapping):
        return {key: finite(value, spelled) for key, value in item.items()}
    if isinstance(item, list | tuple):
        return [finite(value, spelled) for value in item]
    if isinstance(item, float) and not math.isfinite(item):
        return spelled(item)
    return item
