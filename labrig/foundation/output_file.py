"""The one way in which labrig writes a file: whole, on the disk, and never through a link.

Data go to a new file with a random name beside the one that is meant, made exclusively, so that no
file or link that somebody planted is followed or overwritten. They are on the disk before that file
takes the place of what was there.
"""

import errno
import os
import secrets
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO, Protocol

from labrig.foundation.errors import DiskError


class Disk(Protocol):
    """Storage for data that must survive a power cut."""

    def write(self, file: BinaryIO, data: bytes) -> None:
        """Append data to an unbuffered file and wait until they are on the disk.

        Raises
        ------
        OSError
            If the disk is full or gone; part of `data` may be in the file.
        """


class RealDisk:
    """The disk of this PC."""

    def write(self, file: BinaryIO, data: bytes) -> None:
        """Append data to an unbuffered file and wait until they are on the disk."""
        remaining = memoryview(data)
        while remaining:
            remaining = remaining[file.write(remaining) :]
        os.fsync(file.fileno())


REAL_DISK: Disk = RealDisk()
#: Ending of files that are being written; a crash may leave one.
PART = ".part"
#: Errors of a folder of somebody else, or of a disk for reading alone.
_REFUSED = {errno.EACCES, errno.EPERM, errno.EROFS}
#: Permissions of a file and of a folder that their owner alone can read.
OWN_FILE, OWN_FOLDER = 0o600, 0o700


def write_durably(path: Path, data: bytes, disk: Disk = REAL_DISK) -> None:
    """Write a file so that it survives a power cut and is never seen in part.

    Parameters
    ----------
    path
        File to be written or replaced; a link of this name is replaced, not followed.
    data
        Content of the file.
    disk
        Disk that writes the data.

    Raises
    ------
    DiskError
        The disk is full or gone, or something else than a file has this name, such as a folder or a
        device; `path` then has its old content or the new one.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.foundation.output_file import write_durably
    >>> write_durably(Path("serial-number.txt"), b"0123456789")
    >>> Path("serial-number.txt").read_bytes()
    b'0123456789'
    """
    with _draft_of(path, PART) as draft, draft.open("xb", buffering=0) as file:
        disk.write(file, data)


def write_text(path: Path, text: str) -> None:
    """Write a text in UTF-8, with its line ends as they are, as `write_durably` does."""
    write_durably(path, text.encode("utf-8"))


@contextmanager
def replaced(path: Path) -> Iterator[Path]:
    """Yield the path of an empty file, which takes the place of `path` at the end.

    It is for libraries and programs that write into a file by its name.

    Raises
    ------
    DiskError
        As of `write_durably`.
    """
    # Some writers tell the format by the ending.
    with _draft_of(path, f"{PART}{path.suffix}") as draft:
        draft.open("xb").close()
        yield draft
        with draft.open("r+b") as file:
            os.fsync(file.fileno())


@contextmanager
def _draft_of(path: Path, ending: str) -> Iterator[Path]:
    """Yield a new name beside `path`; the file that has it then takes the place of `path`."""
    draft = path.with_name(f".{secrets.token_hex(8)}{ending}")
    try:
        _require_no_other_kind(path)
        yield draft
        draft.replace(path)
        sync_folder(path.parent)
    except OSError as error:
        reason = error.strerror or error
        folder = path.parent
        if error.errno in _REFUSED:
            remedy = "write elsewhere, or ask for the right to write there"
        elif folder.exists():
            remedy = "see that the disk is there and has room"
        else:
            remedy = f"there is no folder {folder}: make it, or write elsewhere"
        raise DiskError(f"{path}: cannot be written ({reason}); {remedy}") from None
    finally:
        with suppress(OSError):
            draft.unlink(missing_ok=True)


def _require_no_other_kind(path: Path) -> None:
    """Refuse a name that is not free for a file, such as that of a device."""
    with suppress(FileNotFoundError):
        mode = path.lstat().st_mode
        if not stat.S_ISREG(mode) and not stat.S_ISLNK(mode):
            kind = "a folder" if stat.S_ISDIR(mode) else "a pipe or a device"
            raise DiskError(f"{path}: cannot be written; expected a file or nothing, got {kind}")


def write_private(path: Path, content: bytes) -> None:
    """Write a file that does not exist yet, which this user alone can read from the beginning.

    Its folder, where there is none, is this user's alone, too.

    Raises
    ------
    FileExistsError
        The file is there already.
    DiskError
        It cannot be written.
    """
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
    make_folder(path.parent, OWN_FOLDER)
    try:
        with os.fdopen(os.open(path, flags, OWN_FILE), "wb") as file:
            REAL_DISK.write(file, content)
    except FileExistsError:
        raise
    except OSError as error:
        raise DiskError(f"{path}: cannot be written ({error.strerror})") from None


def make_folder(path: Path, mode: int = 0o777) -> None:
    """Make a folder that a person named, and those above it, where there is none.

    Raises
    ------
    DiskError
        It cannot be made.
    """
    try:
        path.mkdir(mode, parents=True, exist_ok=True)
    except OSError as error:
        raise DiskError(f"{path}: the folder cannot be made ({error.strerror})") from None


def make_folder_in(folder: Path, name: str) -> Path:
    """Make a folder that labrig names within another one, and return its path.

    Raises
    ------
    DiskError
        It cannot be made, or a link has its name, which would lead elsewhere.
    """
    path = folder / name
    if path.is_symlink():
        raise DiskError(f"{path}: expected a folder or nothing, got a link; delete it")
    make_folder(path)
    return path


def sync_folder(folder: Path) -> None:
    """Make new and renamed entries of a folder durable, where the system can (not on Windows)."""
    if hasattr(os, "O_DIRECTORY"):
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
