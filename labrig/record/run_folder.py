"""The run folder: what was asked, what happened, every frame; made once, then only added to."""

import re
import shutil
import uuid
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from filelock import FileLock, Timeout

from labrig.errors import DiskError, UsageError
from labrig.record.attempt import AttemptWriter
from labrig.record.journal import JOURNAL, REAL_DISK, Disk, Journal, sync_folder, write_durably
from labrig.record.reading import RunRecord, run_record

#: What a run folder is known by.
PROTOCOL = "protocol.yaml"


class RunFolder:
    """A run folder open for writing; held by one labrig at a time.

    Parameters
    ----------
    path
        The folder, with `protocol.yaml` and `rig.yaml` in it.
    seed
        `None` for random uids; a number makes them, and so the journal's bytes, repeatable.
    disk
        Takes frames and journal.
    """

    def __init__(self, path: Path, seed: int | None = None, disk: Disk = REAL_DISK) -> None:
        self.path = path
        self._seed = seed
        self._disk = disk
        self._lock = FileLock(path / ".lock")
        try:
            self._lock.acquire(timeout=0)
        except Timeout:
            raise UsageError(f"{path}: another labrig is writing to this run") from None
        except OSError as error:
            raise DiskError(f"{path}: the run cannot be written to ({error.strerror})") from None
        self._frame_number = _highest_frame(path / "frames")
        self._journal = Journal(path / JOURNAL, disk)
        self._beside = ThreadPoolExecutor(1)

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
        """Make a new run folder `<runs>/<time>_<name>`, `-2` and so on if that is taken.

        Parameters
        ----------
        started
            Seconds since 1970.
        texts
            File name → content: the protocol and the rig, as resolved. The protocol, which a run
            folder is known by, is written last.

        Raises
        ------
        DiskError
            The disk is full, or gone; no run is left.
        """
        stamp = datetime.fromtimestamp(started, UTC).strftime("%Y-%m-%dT%H-%M-%S")
        wanted = f"{stamp}_{_slug(name)}"
        try:
            _make_durably(runs)
            path = _make_new(runs, wanted)
        except OSError as error:
            raise DiskError(
                f"{runs}: a run folder cannot be made there ({error.strerror}); give another --runs"
            ) from None
        try:
            (path / "frames").mkdir()
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
        """What was acknowledged so far; the disk is not asked, it may be gone."""
        return run_record(self.path, self._journal.read())

    def unknown_files(self) -> list[str]:
        """Files among the frames that no line of the journal tells of: a crash left them."""
        known = {frame.path.name for one in self.read().attempts for frame in one.frames}
        return sorted(
            path.name for path in (self.path / "frames").glob("*") if path.name not in known
        )

    def attempt(
        self, unit: str, wall: Callable[[], float], metadata: Mapping[str, Any]
    ) -> AttemptWriter:
        """Begin an attempt at `unit`."""
        return AttemptWriter(
            self._journal,
            unit,
            self.path / "frames",
            self._next_frame_number,
            wall,
            self._new_uid,
            metadata,
            self._disk,
            self._beside,
        )

    def close_open_attempts(
        self, wall: Callable[[], float], exit_status: str, reason: str
    ) -> list[str]:
        """Write the RunStop of attempts that an exception or a crash cut off; returns their units.

        Parameters
        ----------
        exit_status
            `abort` (somebody stopped it) or `fail`.
        """
        opened = [attempt for attempt in self.read().attempts if attempt.exit_status is None]
        for attempt in opened:
            counts = {
                "frames": len(attempt.frames),
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
        return [attempt.unit for attempt in opened]

    def discard(self) -> None:
        """Take away a run in which nothing happened, as far as the disk lets it."""
        _discard(self.path)

    def close(self) -> None:
        """Release the folder."""
        self._beside.shutdown()
        self._journal.close()
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
        self.close()

    def _new_uid(self) -> str:
        if self._seed is None:
            return str(uuid.uuid4())
        place = self._journal.size_bytes
        return str(uuid.uuid5(uuid.NAMESPACE_OID, f"labrig {self._seed} {place}"))

    def _next_frame_number(self) -> int:
        self._frame_number += 1
        return self._frame_number


def _discard(path: Path) -> None:
    """No half of a run is left: first goes what it is known by, and if that stays, so does all."""
    with suppress(OSError):
        (path / PROTOCOL).unlink(missing_ok=True)
        shutil.rmtree(path)


def _make_durably(runs: Path) -> None:
    missing = [folder for folder in (runs, *runs.parents) if not folder.exists()]
    runs.mkdir(parents=True, exist_ok=True)
    for folder in missing:
        sync_folder(folder.parent)


def _make_new(runs: Path, wanted: str) -> Path:
    number = 1
    while True:
        path = runs / (wanted if number == 1 else f"{wanted}-{number}")
        try:
            path.mkdir()
        except FileExistsError:
            number += 1
        else:
            return path


def _slug(name: str) -> str:
    return re.sub(r"[^\w.-]+", "-", name).strip("-")[:80] or "run"


def _highest_frame(frames: Path) -> int:
    """Highest number in use, acknowledged or not: no frame is ever overwritten."""
    numbers = [int(path.name[:6]) for path in frames.glob("[0-9]" * 6 + ".*")]
    return max(numbers, default=0)
