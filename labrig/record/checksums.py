"""Checksums of a run's frames and spectra, read anew only if a file was touched since.

That a frame has the checksum of its journal is noted with the size and the modification time of its
file. As long as both stay the same, the file is trusted and not read. A note by another user or
another PC does not count.

What was reduced from frames lies in the run folder, which may come from somebody else. A digest
with a secret of this user shows that this user's own labrig has written it.
"""

import hmac
import json
import os
import secrets
import shutil
import stat
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import cache
from hashlib import file_digest, sha256
from pathlib import Path
from typing import TypeVar

from labrig.foundation.activity import counted
from labrig.foundation.errors import DiskError, LabrigError
from labrig.foundation.input_file import MAX_JSON_BYTES, open_regular, read_text
from labrig.foundation.output_file import make_folder_in, write_durably, write_private
from labrig.record.frames import FileRecord

_FOLDER, _FILE = "labrig", "kept_numbers_key"
_BYTES = 32


def own_digest(content: bytes) -> str:
    """Return the HMAC-SHA256 of a content by the secret of this user.

    Parameters
    ----------
    content
        Content of a file.

    Returns
    -------
    str
        Digest in hexadecimal digits. Where no secret can be kept, it is another one in each
        process.

    Examples
    --------
    >>> from labrig.record import own_digest
    >>> own_digest(b"numbers") == own_digest(b"numbers"), len(own_digest(b""))
    (True, 64)
    """
    return hmac.new(_secret(), content, sha256).hexdigest()


@cache
def _secret() -> bytes:
    """Return the secret of this user, which is made when it is first asked for."""
    from platformdirs import user_cache_path

    file = user_cache_path(_FOLDER, appauthor=False) / _FILE
    with suppress(FileExistsError, DiskError):
        write_private(file, secrets.token_bytes(_BYTES))
    return _read(file) or secrets.token_bytes(_BYTES)


def _read(file: Path) -> bytes | None:
    """Return the secret in a file that this user alone can read; None if it is none."""
    with suppress(OSError, LabrigError), open_regular(file) as opened:
        status = os.fstat(opened.fileno())
        is_own = os.name == "nt" or (
            status.st_uid == os.getuid() and not stat.S_IMODE(status.st_mode) & 0o077
        )
        content = opened.read(_BYTES + 1)
        if is_own and len(content) == _BYTES:
            return content
    return None


#: Folder of the frames in a run folder.
FRAMES = "frames"
#: Folder in a run folder for what can be made again from the frames; it may be deleted.
CACHE = "cache"
_CHECKED = "checked_frames.txt"
#: Files read at once: hashing takes longer than reading from most disks.
_READERS = 4

#: Size in bytes, modification time in nanoseconds, and checksum of a file.
_State = list[int | str]
FileRecordT = TypeVar("FileRecordT", bound=FileRecord)


def damaged_frames(
    run: Path, frames: Iterable[FileRecordT], *, trust: bool = True
) -> dict[FileRecordT, str]:
    """Return the frames and spectra whose files differ from the journal's checksums, and how.

    Parameters
    ----------
    run
        Run folder.
    frames
        Frames and spectra of the run.
    trust
        Whether a file that was read before, and has the same size and modification time since, is
        not read again.

    Returns
    -------
    dict of FrameRecord or SpectrumRecord to str
        For each damaged one how its file differs, as in `is missing`.

    Examples
    --------
    >>> import labrig
    >>> from labrig.record import damaged_frames
    >>> run = labrig.read_run("runs/decay")
    >>> damaged_frames(run.folder, run.frames("decay"))
    {}
    """
    checked = _read_checked(run) if trust else {}
    unchecked = [frame for frame in frames if not _is_checked(frame, checked)]
    with ThreadPoolExecutor(_READERS) as pool:
        states = list(
            counted(pool.map(_checked_state, unchecked), "reading frames", len(unchecked))
        )
    damaged = {}
    for frame, state in zip(unchecked, states, strict=True):
        if isinstance(state, str):
            damaged[frame] = state
            checked.pop(frame.path.name, None)
        else:
            checked[frame.path.name] = state
    if unchecked:
        _write_checked(run, checked)
    return damaged


def discard_cache(run: Path) -> None:
    """Delete what was reduced from the frames of a run and which frames were checked.

    Both can be made again from the frames; that nobody changed them cannot be checked.

    Parameters
    ----------
    run
        Run folder.

    Raises
    ------
    DiskError
        Something cannot be deleted, and would be used again.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.record import discard_cache
    >>> discard_cache(Path("runs/decay"))
    >>> Path("runs/decay/cache").exists()
    False
    """
    folder = run / CACHE
    try:
        if folder.exists():
            shutil.rmtree(folder)
    except OSError as error:
        raise DiskError(
            f"{folder}: cannot be deleted ({error.strerror}), though it may have been changed; "
            "delete it"
        ) from None


def _is_checked(frame: FileRecord, checked: dict[str, _State]) -> bool:
    """Return whether the frame's file is the one that was read before, by all that can be seen."""
    try:
        status = frame.path.stat()
    except OSError:
        return False
    return checked.get(frame.path.name) == [status.st_size, status.st_mtime_ns, frame.sha256]


def _checked_state(frame: FileRecord) -> _State | str:
    """Read a frame's file and return its state, or its damage as text."""
    try:
        with open_regular(frame.path) as file:
            status = os.fstat(file.fileno())
            # A file of another size need not be read; a forged one may have no end.
            same_size = status.st_size == frame.size_bytes
            if same_size and file_digest(file, "sha256").hexdigest() == frame.sha256:
                return [status.st_size, status.st_mtime_ns, frame.sha256]
    except (OSError, LabrigError) as error:
        if not frame.path.exists():
            return "is missing"
        if isinstance(error, LabrigError):
            return str(error).removeprefix(f"{frame.path}: ")
        return f"cannot be read ({error.strerror})"
    return "was changed after the run (its checksum differs)"


def _read_checked(run: Path) -> dict[str, _State]:
    """Return the states of the files that were checked before; none if the list is unusable."""
    try:
        digest, _, text = read_text(run / CACHE / _CHECKED, MAX_JSON_BYTES).partition("\n")
        if digest != own_digest(text.encode()):
            return {}
        content = json.loads(text)
    except (LabrigError, OSError, ValueError, RecursionError):
        return {}
    return content if isinstance(content, dict) else {}


def _write_checked(run: Path, checked: dict[str, _State]) -> None:
    """Write the list as far as the disk allows: without it, files are read again."""
    with suppress(OSError, DiskError):
        text = json.dumps(checked)
        content = f"{own_digest(text.encode())}\n{text}".encode()
        write_durably(make_folder_in(run, CACHE) / _CHECKED, content)
