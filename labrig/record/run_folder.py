"""The run folder: protocol, rig, journal and frames; created once, then only appended to."""

import json
import os
import re
import shutil
import socket
import sys
import uuid
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from filelock import Timeout

from labrig.foundation.clock import SystemClock
from labrig.foundation.errors import DiskError, LabrigError, UsageError
from labrig.foundation.file_lock import plain_lock
from labrig.foundation.input_file import read_text
from labrig.foundation.output_file import (
    PART,
    REAL_DISK,
    Disk,
    sync_folder,
    write_durably,
    write_text,
)
from labrig.foundation.readable_output import spelled
from labrig.record.attempt import AttemptWriter
from labrig.record.journal import JOURNAL, Journal
from labrig.record.plain_folder import require_plain_folder
from labrig.record.plan_files import FILES, files_bytes, plan_texts
from labrig.record.run_record import Attempt, RunRecord, run_record

MADE = "made.txt"


def made_text(time_s: float) -> str:
    """Return the content of `made.txt` for a time in seconds since 1970."""
    return datetime.fromtimestamp(time_s, UTC).isoformat(timespec="microseconds") + "\n"


def time_made(run: Path) -> datetime:
    """Return when a run folder was made.

    It orders the runs of a folder. The journal cannot: a simulated run has the times of its room,
    a copy has its own times of change, and a name can be changed by anybody.

    Parameters
    ----------
    run
        Run folder.

    Returns
    -------
    datetime
        Time in UTC from the run's `made.txt`; where that is missing or damaged, the time at which
        `protocol.yaml` was written.

    Raises
    ------
    OSError
        If there is no `protocol.yaml` either.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.record import time_made
    >>> time_made(Path("runs/decay")).tzname()
    'UTC'
    """
    try:
        made = datetime.fromisoformat(read_text(run / MADE).strip())
        return made.astimezone(UTC)
    except (LabrigError, ValueError, OverflowError):
        return datetime.fromtimestamp((run / "protocol.yaml").stat().st_mtime, UTC)


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
                f"{path.parent}: the run cannot be written to ({error.strerror}); see that its "
                "disk has room, or copy it to a folder of your own"
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


#: File by which a run folder is recognised.
PROTOCOL = "protocol.yaml"
#: File with the calibrations that were found beside the runs, and their ages.
CALIBRATIONS_FILE = "calibrations.yaml"


class RunFolder:
    """A run folder open for writing, by one process at a time.

    Parameters
    ----------
    path
        Run folder with `protocol.yaml` and `rig.yaml`.
    seed
        Seed of the uids, with which the journal's bytes are repeatable; None for random uids.
    disk
        Disk to which frames and journal are written.

    Raises
    ------
    UsageError
        If another process has the folder open.
    DataError
        If something in the folder leads elsewhere, such as a link.
    DiskError
        If the folder cannot be written to.
    """

    def __init__(self, path: Path, seed: int | None = None, disk: Disk = REAL_DISK) -> None:
        self.path = path
        self._seed = seed
        self._disk = disk
        self._lock = RunLock(path / RECORDING_LOCK, "writing to this run")
        _discard_parts(path)
        self._frame_number = _highest_frame(path / "frames")
        self._journal = Journal(path / JOURNAL, disk)
        self._executor = ThreadPoolExecutor(1)
        self._files_due = False

    @classmethod
    def create(
        cls,
        runs: Path,
        name: str,
        started: float,
        texts: Mapping[str, str],
        seed: int | None,
        disk: Disk = REAL_DISK,
    ) -> Self:
        """Create a run folder `<runs>/<time>_<name>`, with `-2`, `-3`, … appended if it exists.

        Parameters
        ----------
        runs
            Folder in which the run folder is created.
        name
            Name of the sample.
        started
            Start of the run in seconds since 1970.
        texts
            Contents of protocol and rig files, as resolved, by file name. The protocol file, by
            which a run folder is recognised, is written last.
        seed
            Seed of the uids; None for random uids.
        disk
            Disk to which files are written.

        Raises
        ------
        DiskError
            If the disk is full or gone; no run folder remains.
        """
        stamp = datetime.fromtimestamp(started, UTC).strftime("%Y-%m-%dT%H-%M-%S")
        folder_name = f"{stamp}_{_slug(name)}"
        try:
            _make_durably(runs)
            path = _make_new(runs, folder_name)
        except OSError as error:
            raise DiskError(
                f"{runs}: a run folder cannot be made there ({error.strerror}); give another --runs"
            ) from None
        try:
            (path / "frames").mkdir()
            # By the PC's clock, since the time of a simulated room is the same in every run.
            texts = {MADE: made_text(SystemClock().wall()), **texts}
            for file_name in sorted(texts, key=lambda name: name == PROTOCOL):
                write_durably(path / file_name, texts[file_name].encode(), disk)
            sync_folder(runs)
            return cls(path, seed, disk)
        except (OSError, DiskError) as error:
            _discard(path)
            raise DiskError(
                f"{runs}: a run folder cannot be made there ({error}); give another --runs"
            ) from None

    def read(self) -> RunRecord:
        """Return the record of everything acknowledged so far, without access to the disk."""
        return run_record(self.path, self._journal.read())

    @property
    def was_torn(self) -> bool:
        """Whether the last line of the journal was incomplete as the folder was opened."""
        return self._journal.was_torn

    def unknown_files(self) -> list[str]:
        """Return the names of files among the frames that have no journal line, left by a crash."""
        return _unknown_files(self.path, self.read().attempts)

    def attempt(
        self, unit: str, wall: Callable[[], float], metadata: Mapping[str, Any]
    ) -> AttemptWriter:
        """Begin an attempt at `unit`.

        Parameters
        ----------
        unit
            Name of the unit.
        wall
            Function that gives the time in seconds since 1970.
        metadata
            Keys and values of the RunStart; the first one has the run's files, too.
        """
        texts = {}
        if self._files_due or self._journal.size_bytes == 0:
            texts = {FILES: plan_texts(self.path)}
        files_before = self._files_bytes
        writer = AttemptWriter(
            self._journal,
            unit,
            self.path / "frames",
            self._next_frame_number,
            wall,
            self._new_uid,
            {**metadata, **texts},
            self._disk,
            self._executor,
        )
        self._files_due = False
        self._files_bytes = files_before + sum(map(files_bytes, texts.values()))
        return writer

    @cached_property
    def _files_bytes(self) -> int:
        """Size of the run's files in the journal, on which uids do not depend."""
        documents = [] if self._seed is None else self._journal.read().documents
        return sum(files_bytes(doc[FILES]) for _, doc in documents if FILES in doc)

    def take_edits(self) -> None:
        """Write the files as they are now into the next RunStart, from which they hold."""
        self._files_due = True

    def close_open_attempts(
        self, wall: Callable[[], float], exit_status: str, reason: str
    ) -> list[str]:
        """Write the RunStop of interrupted attempts and return the names of their units.

        Parameters
        ----------
        wall
            Function that gives the time in seconds since 1970.
        exit_status
            `abort` if somebody stopped the run, else `fail`.
        reason
            Reason for the RunStop.
        """
        open_attempts = [attempt for attempt in self.read().attempts if attempt.exit_status is None]
        for attempt in open_attempts:
            counts = {
                "frames": len(attempt.frames),
                "spectra": len(attempt.spectra),
                "actions": len(attempt.actions),
                "temperatures": len(attempt.temperatures),
            }
            self._journal.append(
                "stop",
                {
                    "uid": self._new_uid(),
                    "time": wall(),
                    "run_start": attempt.uid,
                    "exit_status": exit_status,
                    "reason": reason,
                    "num_events": {stream: number for stream, number in counts.items() if number},
                },
            )
        return [attempt.unit for attempt in open_attempts]

    def discard(self) -> None:
        """Delete a run in which nothing was recorded, as far as the disk allows."""
        _discard(self.path)

    def close(self) -> None:
        """Release the folder for other processes."""
        self._executor.shutdown()
        self._journal.close()
        self._lock.release()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _new_uid(self) -> str:
        if self._seed is None:
            return str(uuid.uuid4())
        # Without the files, in which are paths of this PC: the same run has the same uids.
        place = self._journal.size_bytes - self._files_bytes
        return str(uuid.uuid5(uuid.NAMESPACE_OID, f"labrig {self._seed} {place}"))

    def _next_frame_number(self) -> int:
        self._frame_number += 1
        return self._frame_number


def _discard(path: Path) -> None:
    """Delete a run folder, first the file by which it is recognised; keep all if that one stays."""
    with suppress(OSError):
        (path / PROTOCOL).unlink(missing_ok=True)
        shutil.rmtree(path)


def _discard_parts(path: Path) -> None:
    """Delete what a crash left half written beside the journal."""
    for part in path.glob(f".*{PART}"):
        with suppress(OSError):
            part.unlink()


def _make_durably(runs: Path) -> None:
    missing = [folder for folder in (runs, *runs.parents) if not folder.exists()]
    runs.mkdir(parents=True, exist_ok=True)
    for folder in missing:
        sync_folder(folder.parent)


def _make_new(runs: Path, name: str) -> Path:
    number = 1
    while True:
        path = runs / (name if number == 1 else f"{name}-{number}")
        try:
            path.mkdir()
        except FileExistsError:
            number += 1
        else:
            return path


def _slug(name: str) -> str:
    """Return a name as a part of a folder's: short, and with what the file system can name."""
    text = spelled(name, sys.getfilesystemencoding())
    slug = re.sub(r"[^\w.-]+", "-", text).strip("-.")
    return os.fsencode(slug)[:80].decode(sys.getfilesystemencoding(), "ignore") or "run"


def _unknown_files(run: Path, attempts: Sequence[Attempt]) -> list[str]:
    recorded = {file.path.name for attempt in attempts for file in attempt.files}
    return sorted(path.name for path in (run / "frames").glob("*") if path.name not in recorded)


def lost_files(run: Path, attempts: Sequence[Attempt]) -> list[str]:
    """Return the names of files after the last in the journal, whose lines were lost.

    A crash leaves one at most, which it kept from its line; several had lines.

    Parameters
    ----------
    run
        Run folder.
    attempts
        Attempts of which the journal still has lines.

    Returns
    -------
    list of str
        Names of files in the folder of the frames; none if nothing was lost.

    Examples
    --------
    >>> import labrig
    >>> from labrig.record import lost_files
    >>> run = labrig.read_run("runs/decay")
    >>> lost_files(run.folder, run.attempts), len(lost_files(run.folder, run.attempts[:1]))
    ([], 23)
    """
    last = max((file.path.name for attempt in attempts for file in attempt.files), default="")
    later = [
        name for name in _unknown_files(run, attempts) if name > last and not name.endswith(PART)
    ]
    return later if len(later) > 1 else []


def _highest_frame(frames: Path) -> int:
    """Return the highest frame number in use, acknowledged or not: no frame is ever overwritten."""
    numbers = [int(path.name[:6]) for path in frames.glob("[0-9]" * 6 + ".*")]
    return max(numbers, default=0)


#: Journal, tables and NeXus file, per frame; report, figures and fits, per patch; and what is kept
#: of the pictures in the report, for the next processing.
RECORDS_PER_FRAME_BYTES = 5_000
RESULTS_PER_PATCH_BYTES = 2_000_000
PICTURES_BYTES = 10_000_000


@dataclass(frozen=True)
class RunSize:
    """Size of a run folder.

    Attributes
    ----------
    frames
        Number of frames.
    frames_bytes
        Size of the frames in bytes.
    results_bytes
        Size of all else in bytes: journal, notes, results, what is kept of reduced frames.
    """

    frames: int
    frames_bytes: int
    results_bytes: int

    @classmethod
    def expected(cls, frames: int, frame_bytes: int, patches: int) -> Self:
        """Return the size to be expected of a run with that many frames and patches."""
        results_bytes = frames * RECORDS_PER_FRAME_BYTES + patches * RESULTS_PER_PATCH_BYTES
        return cls(frames, frames * frame_bytes, results_bytes + PICTURES_BYTES)

    @classmethod
    def measured(cls, folder: Path) -> Self:
        """Return the size of a run folder, the results of earlier processing included.

        Raises
        ------
        DiskError
            The disk cannot be read.
        """
        try:
            sizes = {path: path.stat().st_size for path in folder.rglob("*") if path.is_file()}
        except OSError as error:
            raise DiskError(f"{folder}: its size cannot be read ({error.strerror})") from None
        frames = [size for path, size in sizes.items() if path.parent == folder / "frames"]
        return cls(len(frames), sum(frames), sum(sizes.values()) - sum(frames))

    @property
    def total_bytes(self) -> int:
        """Size of all in bytes."""
        return self.frames_bytes + self.results_bytes

    def __str__(self) -> str:
        return (
            f"{size_text(self.total_bytes)} on disk ({self.frames} frames "
            f"{size_text(self.frames_bytes)}, all else {size_text(self.results_bytes)})"
        )


#: Receives the folder of a run that begins, and the size of what is to be recorded into it.
Begun = Callable[[Path, RunSize], None]


def size_text(size_bytes: float) -> str:
    """Format a size.

    Parameters
    ----------
    size_bytes
        Size in bytes.

    Returns
    -------
    str
        Text such as `1.57 GB` or `20 kB`, to three digits.

    Examples
    --------
    >>> from labrig.record import size_text
    >>> size_text(152_460_000)
    '152 MB'
    """
    for factor, unit in ((1e9, "GB"), (1e6, "MB")):
        if size_bytes >= factor:
            return f"{size_bytes / factor:.3g} {unit}"
    return f"{size_bytes / 1e3:.0f} kB"
