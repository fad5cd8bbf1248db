"""The journal: event-model documents, one JSON line each, on the disk before the next step."""

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, Self

from labrig.errors import DataError, DiskError
from labrig.record.disk import REAL_DISK, Disk

Document = tuple[str, dict[str, Any]]


@dataclass(frozen=True)
class JournalContent:
    """All documents of a journal, and whether its last line was torn by a crash."""

    documents: list[Document]
    torn: bool


class Journal:
    """Appends documents durably: when `append` returns, the line survives a power cut.

    A torn last line, of a crash or of a full disk, is cut off before the next one is written: it
    was never acknowledged.
    """

    def __init__(self, path: Path, disk: Disk = REAL_DISK) -> None:
        self.path = path
        self._disk = disk
        try:
            self._file: BinaryIO = path.open("a+b", buffering=0)
            self._file.seek(0)
            self._acknowledged = self._file.read().rfind(b"\n") + 1
        except OSError as error:
            raise DiskError(f"{path}: the journal cannot be opened ({error})") from None

    @property
    def size_bytes(self) -> int:
        """Of all acknowledged lines."""
        return self._acknowledged

    def append(self, name: str, doc: Mapping[str, Any]) -> None:
        """Write `{"name": name, "doc": doc}` and wait until the disk has it."""
        text = json.dumps({"name": name, "doc": doc}, ensure_ascii=False, allow_nan=False)
        line = text.encode() + b"\n"
        try:
            if os.fstat(self._file.fileno()).st_size > self._acknowledged:
                self._file.truncate(self._acknowledged)
            self._disk.write(self._file, line)
        except OSError as error:
            raise DiskError(
                f"{self.path}: the journal cannot be written ({error.strerror}); free some space"
            ) from None
        self._acknowledged += len(line)

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
            entry = json.loads(line, parse_constant=_refuse)
            documents.append((str(entry["name"]), dict(entry["doc"])))
        except (ValueError, KeyError, TypeError):
            raise DataError(
                f"{path}, line {number}: expected a journal document, got {line[:40]!r}; "
                "the file was changed after the run"
            ) from None
    return JournalContent(documents, torn)


def _refuse(constant: str) -> None:
    """NaN and infinity, which JSON does not have and a journal never holds."""
    raise ValueError(constant)
