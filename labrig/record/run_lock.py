"""A lock on a run folder that says who holds it."""

import json
import os
import socket
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Self

from filelock import Timeout

from labrig.foundation.clock import SystemClock
from labrig.foundation.errors import DiskError, LabrigError, UsageError
from labrig.foundation.file_lock import plain_lock
from labrig.foundation.input_file import read_text
from labrig.foundation.output_file import write_text
from labrig.record.plain_folder import require_plain_folder

#: Time to wait for a lock: who only looks whether it is held, holds it for a moment.
#: Lock of the process that records into a run.
RECORDING_LOCK = ".lock"
LOCK_TIMEOUT_S = 0.5


class RunLock:
    """The right of one process to change a run folder, held until it is released or ends.

    Parameters
    ----------
    path
        File of the lock in the run folder; who holds it stands in a file beside it.
    activity
        What the process does, for the message to others, as in `processing this run`.

    Raises
    ------
    UsageError
        Another process holds the lock; the message names it.
    DataError
        Something in the run folder leads elsewhere.
    DiskError
        The folder cannot be written to.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.record import RunLock
    >>> with RunLock(Path("runs/decay/.process.lock"), "processing this run"):
    ...     pass
    """

    def __init__(self, path: Path, activity: str) -> None:
        require_plain_folder(path.parent)
        self._lock = plain_lock(path, LOCK_TIMEOUT_S)
        self._holder = path.with_suffix(".holder")
        try:
            self._lock.acquire()
        except Timeout:
            holder = _holder_text(self._holder)
            raise UsageError(
                f"{path.parent}: another labrig is {activity}{holder}; wait until it has ended"
            ) from None
        except OSError as error:
            raise DiskError(
                f"{path.parent}: the run cannot be written to ({error.strerror})"
            ) from None
        content = {"pid": os.getpid(), "host": socket.gethostname(), "since": SystemClock().wall()}
        with suppress(DiskError):  # it only helps others
            write_text(self._holder, json.dumps(content))

    def release(self) -> None:
        """Release the lock for other processes."""
        with suppress(OSError):  # the next holder writes its own
            self._holder.unlink()
        with suppress(OSError):  # the system lets go of it when labrig ends
            self._lock.release()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.release()


def _holder_text(path: Path) -> str:
    """Return who holds a lock and since when; empty if that is not known."""
    try:
        holder = json.loads(read_text(path, 10_000))
        since = datetime.fromtimestamp(float(holder["since"]), UTC)
        pid, host = int(holder["pid"]), holder["host"]
        return f" (process {pid} on {host}, since {since:%Y-%m-%d %H:%M:%S} UTC)"
    except (LabrigError, OSError, ValueError, KeyError, TypeError, OverflowError, RecursionError):
        return ""
