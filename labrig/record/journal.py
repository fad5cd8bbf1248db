"""The journal: event-model documents, one JSON line each, on the disk before the next step."""

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, Self

from labrig.errors import DataError, DiskError

Document = tuple[str, dict[str, Any]]


@dataclass(frozen=True)
class JournalContent:
    """All documents of a journal, and whether its last line was torn by a crash."""

    documents: list[Document]
    torn: bool


class Journal:
    """Appends documents durably: when `append` returns, the line survives a power cut.

    Opening an existing journal cuts off a torn last line: it was never acknowledged.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            _cut_torn_line(path)
            self._file: BinaryIO = path.open("ab")
        except OSError as error:
            raise DiskError(f"{path}: the journal cannot be opened ({error})") from None

    def append(self, name: str, doc: Mapping[str, Any]) -> None:
        """Write `{"name": name, "doc": doc}` and wait until the disk has it."""
        line = json.dumps({"name": name, "doc": doc}, ensure_ascii=False, allow_nan=False)
        try:
            self._file.write(line.encode() + b"\n")
            self._file.flush()
            os.fsync(self._file.fileno())
        except OSError as error:
            raise DiskError(
                f"{self.path}: the journal cannot be written ({error.strerror}); free some space"
            ) from None

    def close(self) -> None:
        """Release the file."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def read_journal(path: Path) -> JournalContent:
    """Read a journal that may still be growing or may have been cut off by a crash.

    Raises
    ------
    DataError
        There is none, or a line other than the last is damaged.
    """
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise DataError(f"{path}: no journal to read ({error.strerror})") from None
    lines = raw.split(b"\n")
    torn = lines.pop() != b""
    documents: list[Document] = []
    for number, line in enumerate(lines, start=1):
        try:
            entry = json.loads(line)
            documents.append((entry["name"], entry["doc"]))
        except (ValueError, KeyError, TypeError):
            raise DataError(
                f"{path}, line {number}: expected a journal document, got {line[:40]!r}; "
                "the file was changed after the run"
            ) from None
    return JournalContent(documents, torn)


def _cut_torn_line(path: Path) -> None:
    if not path.exists():
        return
    raw = path.read_bytes()
    whole = raw.rfind(b"\n") + 1
    if whole < len(raw):
        with path.open("r+b") as file:
            file.truncate(whole)
            os.fsync(file.fileno())
