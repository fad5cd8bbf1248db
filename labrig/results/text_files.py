"""Results as text files."""

import csv
import io
from collections.abc import Iterable, Sequence
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
