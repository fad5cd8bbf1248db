"""Refusal of run folders that lead out of themselves, such as by a link that somebody planted."""

import os
import stat
from pathlib import Path

from labrig.foundation.errors import DataError

_KINDS = (
    (stat.S_ISLNK, "a link"),
    (stat.S_ISFIFO, "a named pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)


def require_plain_folder(folder: Path) -> None:
    """Refuse a run folder in which something is neither a file nor a folder.

    labrig reads and writes below a run folder by name. A link there would make it write elsewhere,
    and a named pipe would make it wait for ever. The run folder itself may be reached by a link.

    Parameters
    ----------
    folder
        Run folder; one that is missing is not refused here.

    Raises
    ------
    DataError
        Something in it is a link, a named pipe, a socket or a device.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.record import require_plain_folder
    >>> require_plain_folder(Path("runs/decay"))
    """
    waiting = [os.fspath(folder)]
    while waiting:
        try:
            with os.scandir(waiting.pop()) as entries:
                for entry in entries:
                    if entry.is_dir(follow_symlinks=False) and not _is_junction(entry):
                        waiting.append(entry.path)
                    elif not entry.is_file(follow_symlinks=False):
                        raise DataError(
                            f"{entry.path}: expected files and folders alone in a run, got "
                            f"{_kind(entry)}, which may lead elsewhere; delete it, or "
                            "replace it by the file or folder to which it leads"
                        )
        except OSError:
            continue  # what cannot be listed is named where it is used


def _is_junction(entry: os.DirEntry[str]) -> bool:
    """Return whether a folder of Windows is a link; Python tells from 3.12 on."""
    reparse = getattr(stat, "FILE_ATTRIBUTE_REPARSE_POINT", 0)
    attributes = getattr(entry.stat(follow_symlinks=False), "st_file_attributes", 0)
    return bool(attributes & reparse)


def _kind(entry: os.DirEntry[str]) -> str:
    mode = entry.stat(follow_symlinks=False).st_mode
    return next((name for matches, name in _KINDS if matches(mode)), "a link")
