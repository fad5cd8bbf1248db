"""The journal: event-model documents, one JSON line each, on the disk before the next step.

Each line holds the SHA-256 of the line before it, which seals the journal: a value that is changed,
a line that is left out or moved no longer fits the line that follows.

A document repeats what others say: an event has the time at which it was written for each of its
values and its number in its stream, a stop counts the events. Nobody but labrig writes journals.
"""

import json
import math
import os
from collections.abc import Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from hashlib import sha256
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, Self

from labrig.foundation.errors import DataError, DiskError, UsageError
from labrig.foundation.input_file import MAX_JOURNAL_BYTES, MAX_TEXT_BYTES, read_bytes
from labrig.foundation.output_file import REAL_DISK, Disk, write_durably
from labrig.record.plain_folder import require_plain_folder

JOURNAL = "journal.jsonl"
_AFTER = "after"
Document = tuple[str, dict[str, Any]]


@dataclass(frozen=True)
class JournalContent:
    """Content of a journal.

    Attributes
    ----------
    documents
        Event-model documents, each with the name of its kind.
    torn
        Whether the last line is incomplete because of a crash.
    seal
        SHA-256 of the last complete line, in hexadecimal digits; empty if there is none.
    """

    documents: list[Document]
    torn: bool
    seal: str = ""


def sealed_line(name: str, doc: Mapping[str, Any], seal: str) -> bytes:
    r"""Return the line of a document in a journal.

    Parameters
    ----------
    name
        Kind of the document, such as `event`.
    doc
        Document.
    seal
        SHA-256 of the line before; empty for the first line.

    Returns
    -------
    bytes
        Line with its end.

    Examples
    --------
    >>> from labrig.record import sealed_line
    >>> sealed_line("stop", {"time": 0.5}, "")
    b'{"name": "stop", "doc": {"time": 0.5}, "after": ""}\n'
    """
    entry = {"name": name, "doc": doc, _AFTER: seal}
    return json.dumps(entry, ensure_ascii=False, allow_nan=False).encode() + b"\n"


def _seal(line: bytes) -> str:
    """Return the seal of a line without its end."""
    return sha256(line).hexdigest()


class Journal:
    """A journal open for writing: a line survives a power cut as soon as `append` returns.

    The content of a file after a failed write or fsync is undefined: a line may be there
    completely, in part, or only until the power fails. Acknowledged lines are therefore kept in
    memory, `read` returns only those, and anything after them in the file is cut off before the
    next line is written. The journal of an earlier process is written anew when it is opened, since
    part of what is read may not be on the disk.

    Parameters
    ----------
    path
        File of the journal; created if it does not exist.
    disk
        Disk to which lines are written.

    Attributes
    ----------
    was_torn
        Whether the last line was incomplete as the journal was opened; it is cut off.

    Raises
    ------
    DiskError
        If the journal cannot be opened.
    """

    def __init__(self, path: Path, disk: Disk = REAL_DISK) -> None:
        self.path = path
        self._disk = disk
        try:
            raw = read_bytes(path, MAX_JOURNAL_BYTES) if path.exists() else b""
            self._acknowledged = bytearray(raw[: raw.rfind(b"\n") + 1])
            self.was_torn = len(self._acknowledged) < len(raw)
            *_, last, _ = [b"", *bytes(self._acknowledged).split(b"\n")]
            self._seal = _seal(last) if last else ""
            write_durably(path, bytes(self._acknowledged), disk)
            self._file: BinaryIO = path.open("ab", buffering=0)
        except OSError as error:
            raise DiskError(f"{path}: the journal cannot be opened ({error})") from None

    @property
    def size_bytes(self) -> int:
        """Size of all acknowledged lines in bytes."""
        return len(self._acknowledged)

    def read(self) -> JournalContent:
        """Return all acknowledged documents; the disk is not accessed."""
        return _parse(self.path, bytes(self._acknowledged))

    def append(self, name: str, doc: Mapping[str, Any]) -> None:
        """Write the line of a document and wait until it is on the disk."""
        line = sealed_line(name, doc, self._seal)
        try:
            if os.fstat(self._file.fileno()).st_size > self.size_bytes:
                self._file.truncate(self.size_bytes)
            self._disk.write(self._file, line)
        except OSError as error:
            raise DiskError(
                f"{self.path}: the journal cannot be written ({error.strerror}); see that the disk "
                "is there and has room"
            ) from None
        self._acknowledged += line
        self._seal = _seal(line[:-1])

    def close(self) -> None:
        """Close the file."""
        with suppress(OSError):  # every line in it was acknowledged before
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

    Parameters
    ----------
    path
        File `journal.jsonl` of a run folder.

    Returns
    -------
    JournalContent
        Event-model documents with their names, and whether the last line is incomplete.

    Raises
    ------
    DataError
        If there is no such file, or a line other than the last is damaged.
    DiskError
        If the file cannot be read.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.record import read_journal
    >>> journal = read_journal(Path("runs/decay/journal.jsonl"))
    >>> [document["unit"] for name, document in journal.documents if name == "start"]
    ['dark', 'meter', 'decay-1']
    >>> journal.torn
    False
    """
    if not path.is_file():
        raise DataError(
            f"{path}: there is no journal; restore it from a copy, or record the run: labrig "
            f"resume {path.parent}"
        )
    return _parse(path, read_bytes(path, MAX_JOURNAL_BYTES))


def line_seals(path: Path) -> list[str]:
    """Return the SHA-256 of every complete line of a journal, each the seal of all up to it.

    Parameters
    ----------
    path
        File `journal.jsonl` of a run folder.

    Returns
    -------
    list of str
        Seals in hexadecimal digits, in the order of the lines; none if there is no such file.

    Raises
    ------
    DiskError
        If the file cannot be read.

    Examples
    --------
    >>> from pathlib import Path
    >>> import labrig
    >>> from labrig.record import line_seals
    >>> line_seals(Path("runs/decay/journal.jsonl"))[-1] == labrig.read_run("runs/decay").seal
    True
    """
    raw = read_bytes(path, MAX_JOURNAL_BYTES) if path.is_file() else b""
    return [_seal(line) for line in raw.split(b"\n")[:-1]]


def _parse(path: Path, raw: bytes) -> JournalContent:
    lines = raw.split(b"\n")
    torn = lines.pop() != b""
    documents: list[Document] = []
    seal = ""
    for number, line in enumerate(lines, start=1):
        try:
            entry = json.loads(line, parse_constant=_refuse_constant)
            if b"\\ud" in line.lower():  # perhaps half of a surrogate pair, which is no text
                json.dumps(entry, ensure_ascii=False).encode()
            documents.append((str(entry["name"]), dict(entry["doc"])))
            after = entry[_AFTER]
        except (ValueError, KeyError, TypeError, RecursionError):
            raise DataError(
                f"{path}, line {number}: expected a journal document, got {line[:40]!r}; "
                "the file was changed after the run; restore it from a copy"
            ) from None
        if after != seal:
            before = "the beginning" if number == 1 else f"line {number - 1}"
            raise DataError(
                f"{path}, line {number}: does not follow {before} as it was written: the file was "
                "changed after the run; restore it from a copy"
            )
        seal = _seal(line)
    return JournalContent(documents, torn, seal)


def _refuse_constant(constant: str) -> None:
    """Refuse NaN and infinity, which are not JSON."""
    raise ValueError(constant)


_NAME = "notes.md"


def add_note(run: Path, text: str, time_s: float) -> Path:
    """Add a note to a run.

    Parameters
    ----------
    run
        Run folder.
    text
        Note in Markdown; its lines are kept as they are.
    time_s
        Time of the note in seconds since 1970.

    Returns
    -------
    Path
        File `notes.md` of the run, to which the note was appended.

    Raises
    ------
    UsageError
        If the text is empty.
    DataError
        If something in the run folder leads elsewhere.
    DiskError
        If the file cannot be written.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.record import add_note
    >>> file = add_note(Path("runs/decay"), "The lens cap was on until 14:20.", 1_767_225_600.0)
    >>> file.name
    'notes.md'
    """
    if not text.strip():
        raise UsageError("expected a text to note, got nothing; write: labrig note RUN 'the text'")
    require_plain_folder(run)
    path = run / _NAME
    written = datetime.fromtimestamp(time_s, UTC)
    entry = f"## {written:%Y-%m-%d %H:%M} UTC\n\n{text.strip()}\n\n"
    # Written anew: a backup may share the file by a hard link, which would get the note, too.
    before = read_bytes(path, MAX_TEXT_BYTES) if path.exists() else b""
    write_durably(path, before + entry.encode())
    return path


def read_notes(run: Path) -> str:
    """Read the notes on a run.

    Parameters
    ----------
    run
        Run folder.

    Returns
    -------
    str
        All notes in Markdown, as written; empty if there are none.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.record import add_note, read_notes
    >>> _ = add_note(Path("runs/decay"), "Room light on behind the door.", 1_767_225_600.0)
    >>> print(read_notes(Path("runs/decay")).strip().splitlines()[-1])
    Room light on behind the door.
    """
    path = run / _NAME
    return read_bytes(path, MAX_TEXT_BYTES).decode(errors="replace") if path.is_file() else ""


#: Values of the events of each stream, with their kinds.
VALUES: Mapping[str, Mapping[str, str]] = {
    "actions": {
        "device": "string",
        "action": "string",
        "start_time": "number",
        "end_time": "number",
        "late_s": "number",
        "task": "string",
    },
    "temperatures": {"time": "number", "temperature_c": "number"},
    "frames": {
        "frame": "string",
        "sha256": "string",
        "size_bytes": "integer",
        "role": "string",
        "exposure_s": "number",
        "iso": "integer",
        "f_number": "number",
        "start_time": "number",
        "end_time": "number",
        "late_s": "number",
        "disk_s": "number",
    },
    "spectra": {
        "frame": "string",
        "sha256": "string",
        "size_bytes": "integer",
        "role": "string",
        "integration_s": "number",
        "repetitions": "integer",
        "start_time": "number",
        "end_time": "number",
        "late_s": "number",
    },
}
#: Keys of a RunStart that are texts, where they are there.
_TEXTS = ("protocol", "sample", "labrig_version", "guard", "rig")
#: Parts of a descriptor for which labrig has nothing.
_EMPTY = ("configuration", "object_keys", "object_classes", "hints")
_READS_BACK = "_reads_back"
_STATUSES = ("success", "abort", "fail")
#: Times since 1970 are rounded to less than this, in seconds.
_ROUNDING_S = 1e-5


def check_start(doc: Mapping[str, Any]) -> None:
    """Check a RunStart.

    Raises
    ------
    ValueError, KeyError, TypeError
        It is none that labrig writes.
    """
    devices = doc.get("devices", {})
    texts = [doc[key] for key in _TEXTS if key in doc]
    if not isinstance(devices, dict):
        raise TypeError("'devices' is of another kind")
    texts += [doc["uid"], doc["unit"], *devices.values(), *dict(doc.get("files", {})).values()]
    if not all(isinstance(text, str) for text in texts):
        raise TypeError("'unit', 'devices', 'files' or another text is of another kind")
    if not all(isinstance(doc[key], bool) for key in doc if key.endswith(_READS_BACK)):
        raise TypeError("whether a light reads back is of another kind")


def check_descriptor(doc: Mapping[str, Any]) -> None:
    """Check the descriptor of a stream.

    Raises
    ------
    ValueError, KeyError, TypeError
        It is none that labrig writes.
    """
    if doc["name"] not in VALUES:
        raise ValueError(f"'{doc['name']}' is no stream")
    expected = described(doc["name"])
    # An earlier labrig may have written fewer values.
    if any(expected.get(name) != value for name, value in dict(doc["data_keys"]).items()):
        raise ValueError(f"the values of {doc['name']} are described otherwise")
    if any(doc[key] != {} for key in _EMPTY):
        raise ValueError(f"{', '.join(_EMPTY)} are not empty")


def described(stream: str) -> dict[str, dict[str, Any]]:
    """Return the description of a stream's values, as a descriptor has it."""
    return {
        name: {"source": "labrig", "dtype": kind, "shape": []}
        for name, kind in VALUES[stream].items()
    }


def check_event(doc: Mapping[str, Any], number: int, names: Collection[str]) -> None:
    """Check an event by its number in its stream and the names of the stream's values.

    Raises
    ------
    ValueError, KeyError, TypeError
        It is none that labrig writes.
    """
    data, time_s = dict(doc["data"]), doc["time"]
    if data.keys() != set(names):
        raise ValueError(f"expected the values {', '.join(names)}, got {', '.join(data)}")
    if doc["seq_num"] != number:
        raise ValueError(f"it is number {doc['seq_num']} of its stream, expected {number}")
    if doc["timestamps"] != dict.fromkeys(data, time_s):
        raise ValueError("its 'timestamps' are not its 'time'")
    if doc["filled"] != {}:
        raise ValueError("'filled' is not empty")
    ends_s = float(data["end_time"] if "end_time" in data else data["time"])
    if not ends_s <= time_s + _ROUNDING_S:
        raise ValueError(f"it was written {ends_s - time_s:.3g} s before its end")
    if not data.get("start_time", ends_s) <= ends_s + _ROUNDING_S:
        raise ValueError("it ends before it begins")


def check_stop(doc: Mapping[str, Any], counts: Mapping[str, int]) -> None:
    """Check a RunStop by the number of events of each stream.

    Raises
    ------
    ValueError, KeyError, TypeError
        It is none that labrig writes.
    """
    if doc["exit_status"] not in _STATUSES or not isinstance(doc.get("reason", ""), str):
        raise ValueError(f"expected a status among {', '.join(_STATUSES)} and a reason")
    if not isinstance(doc["uid"], str) or not math.isfinite(doc["time"]):
        raise ValueError("'uid' or 'time' is of another kind")
    stated = dict(doc["num_events"])
    for stream in (*counts, *stated):
        if (number := stated.get(stream, 0)) != counts.get(stream, 0):
            raise ValueError(f"it counts {number} {stream}, there are {counts.get(stream, 0)}")
