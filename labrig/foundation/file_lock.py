"""Locks between processes, held on a file that is no link."""

from pathlib import Path

from filelock import FileLock

from labrig.foundation.errors import UsageError


def plain_lock(path: Path, timeout_s: float = -1, every_s: float = 0.05) -> FileLock:
    """Return a lock that is not held yet.

    Parameters
    ----------
    path
        File of the lock, made where there is none.
    timeout_s
        Time to wait for another process in s; below 0 without end.
    every_s
        Time between two attempts in s.

    Raises
    ------
    UsageError
        Something else than a file has that name, such as a link, which would be followed.
    """
    if path.is_symlink() or (path.exists() and not path.is_file()):
        raise UsageError(f"{path}: expected a file or nothing, got something else; delete it")
    return FileLock(path, timeout=timeout_s, poll_interval=every_s)
