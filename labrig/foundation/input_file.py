"""Reading of input files, with messages that name the problem."""

import errno
import os
import stat
from contextlib import suppress
from difflib import get_close_matches
from io import BufferedReader
from itertools import islice
from pathlib import Path

from labrig.foundation.errors import DiskError, UsageError

#: Errors of the disk, which no other name and no permission would resolve.
DISK_ERRORS = {errno.EIO, errno.ENODEV, errno.ENXIO, errno.ESTALE, errno.ETIMEDOUT}

#: Largest number of names in a folder among which a similar one is looked for.
MAX_LISTED = 1000
#: Limit that a table of a year's measurements does not reach, but `/dev/zero` does.
MAX_TEXT_BYTES = 50_000_000
#: Limit of a JSON text, whose values take up to 25 times its size: of a result of many patches.
MAX_JSON_BYTES = 20_000_000
#: Limit of a picture, and of a journal of a day with a frame each second.
MAX_PICTURE_BYTES, MAX_JOURNAL_BYTES = 200_000_000, 100_000_000
#: Limit of a mesh, of some million triangles.
MAX_MESH_BYTES = 200_000_000
#: Limit of a frame, above the RAW files of 100 megapixels.
MAX_FRAME_BYTES = 300_000_000


def open_regular(path: Path) -> BufferedReader:
    """Open the file at `path` for reading; a pipe or a device is refused and never waited for.

    Raises
    ------
    UsageError
        There is no file, it is not a regular one, or it may not be read.
    DiskError
        The disk cannot be read.
    """
    # Without waiting: a named pipe would else be opened when somebody writes into it.
    flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
    try:
        descriptor = os.open(path, flags)
    except FileNotFoundError:
        raise UsageError(f"{path}: no such file{whereabouts(path)}") from None
    except OSError as error:
        error_class = DiskError if error.errno in DISK_ERRORS else UsageError
        raise error_class(f"{path}: cannot be read ({error.strerror})") from None
    mode = os.fstat(descriptor).st_mode
    if not stat.S_ISREG(mode):
        os.close(descriptor)
        kind = "a folder" if stat.S_ISDIR(mode) else "a pipe or a device; save it as a file"
        raise UsageError(f"{path}: expected a file, got {kind}")
    return os.fdopen(descriptor, "rb")


def whereabouts(path: Path) -> str:
    """Return a file of a similar name to one that is missing, or that its folder is missing, too.

    Parameters
    ----------
    path
        Path of a file that does not exist.

    Returns
    -------
    str
        End of a message; empty if there is nothing to say.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.foundation.input_file import whereabouts
    >>> whereabouts(Path("runs/decay/rigg.yaml"))
    '; did you mean runs/decay/rig.yaml?'
    """
    folder = path.parent
    if not folder.is_dir():
        return f", and no folder {folder}"
    with suppress(OSError):
        names = [each.name for each in islice(folder.iterdir(), MAX_LISTED)]
        if close := get_close_matches(path.name, names, n=1, cutoff=0.7):
            return f"; did you mean {path.with_name(close[0])}?"
    return ""


def file_size_bytes(path: Path) -> int:
    """Return the size of a file; 0 of one that cannot be looked at, which reading it reports."""
    try:
        return path.stat().st_size
    except OSError:
        return 0


def read_bytes(path: Path, most_bytes: int) -> bytes:
    """Read the bytes of the file at `path`.

    Raises
    ------
    UsageError
        There is no readable file, or it has more than `most_bytes`.
    DiskError
        The disk cannot be read.
    """
    try:
        with open_regular(path) as file:
            # A read allocates what it asks for: of a budget of 1 GB only what the file has.
            size_bytes = min(os.fstat(file.fileno()).st_size, most_bytes)
            content = file.read(size_bytes + 1)
            if size_bytes < len(content) <= most_bytes:  # it grows, or the system does not know
                content += file.read(most_bytes + 1 - len(content))
    except OSError as error:
        error_class = DiskError if error.errno in DISK_ERRORS else UsageError
        raise error_class(f"{path}: cannot be read ({error.strerror})") from None
    if len(content) > most_bytes:
        raise UsageError(f"{path}: expected a file of at most {most_bytes} bytes, got more")
    return content


def read_text(path: Path, most_bytes: int = MAX_TEXT_BYTES) -> str:
    """Read the text in the file at `path`, without a byte-order mark.

    Raises
    ------
    UsageError, DiskError
        The file is refused by `read_bytes`, or it is not text in UTF-8.
    """
    try:
        return read_bytes(path, most_bytes).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise UsageError(f"{path}: not text in UTF-8 ({error}); save it as UTF-8") from None
