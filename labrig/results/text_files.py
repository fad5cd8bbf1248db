"""Results as text files."""

import csv
import io
import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from labrig.errors import DiskError


def write_text(path: Path, text: str) -> None:
    """Write a text, its lines ended alike on every computer.

    Raises
    ------
    DiskError
        The file cannot be written.
    """
    try:
        path.write_text(text, encoding="utf-8", newline="")
    except OSError as error:
        raise DiskError(f"{path}: cannot be written ({error.strerror})") from None


def write_csv(path: Path, head: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
    """Write a table whose first line names the columns.

    Raises
    ------
    DiskError
        The file cannot be written.
    """
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(head)
    table.writerows(rows)
    write_text(path, text.getvalue())


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Write an object, a key a line, all its numbers `finite`.

    Raises
    ------
    DiskError
        The file cannot be written.
    """
    write_text(path, json_text(content) + "\n")


def json_text(content: Mapping[str, Any]) -> str:
    """The text of such a file."""
    return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)


def finite(item: Any, spelled: Callable[[float], str | None] = lambda number: None) -> Any:
    """`item` as JSON knows it: numbers that are not finite are None, or as they are `spelled`."""
    if isinstance(item, Mapping):
        return {key: finite(value, spelled) for key, value in item.items()}
    if isinstance(item, list | tuple):
        return [finite(value, spelled) for value in item]
    if isinstance(item, float) and not math.isfinite(item):
        return spelled(item)
    return item
