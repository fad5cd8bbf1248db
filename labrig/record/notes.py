"""What a person has to say about a run: `notes.md` in its folder, only ever added to."""

from datetime import UTC, datetime
from pathlib import Path

from labrig.errors import DiskError, UsageError
from labrig.record.durable import REAL_DISK, sync_folder

_NAME = "notes.md"


def add_note(run: Path, text: str, written_time: float) -> Path:
    """Add a note to the run in `run`; returns the file.

    Parameters
    ----------
    text
        Markdown; its lines are kept as they are.
    written_time
        Seconds since 1970.

    Raises
    ------
    UsageError
        There is nothing to note.
    DiskError
        The file cannot be written.
    """
    if not text.strip():
        raise UsageError("expected a text to note, got nothing; write: labrig note RUN 'the text'")
    path = run / _NAME
    written = datetime.fromtimestamp(written_time, UTC)
    entry = f"## {written:%Y-%m-%d %H:%M} UTC\n\n{text.strip()}\n\n"
    try:
        with path.open("ab", buffering=0) as notes:
            REAL_DISK.write(notes, entry.encode())
        sync_folder(run)
    except OSError as error:
        raise DiskError(f"{path}: the note cannot be written ({error.strerror})") from None
    return path


def read_notes(run: Path) -> str:
    """All that was noted, as written; empty if nothing was."""
    path = run / _NAME
    return path.read_text(encoding="utf-8", errors="replace") if path.is_file() else ""
