"""Summary of a run, and its status."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Literal, get_args

from labrig.foundation.errors import UsageError

if TYPE_CHECKING:
    from labrig.record import RunRecord
    from labrig.results import Measured

#: `running`: a process records missing units; `interrupted`: units are missing, since a person, a
#: crash or a power cut ended the run; `failed`: units are missing because of a fault that the
#: journal names; `recorded`: all units are complete, without a result; `processed`: with a result;
#: `damaged`: journal or result cannot be read.
RunStatus = Literal["running", "interrupted", "failed", "recorded", "processed", "damaged"]
STATUSES: tuple[RunStatus, ...] = get_args(RunStatus)
#: Statuses of a run of which units are missing, in which it may be running at another moment.
INCOMPLETE: frozenset[RunStatus] = frozenset({"running", "interrupted", "failed"})
#: Time for which a lock has to be held to be that of a run: who only looks holds it for a moment.
LOOK_S = 0.1


@dataclass(frozen=True)
class RunSummary:
    """Summary of a run folder.

    Attributes
    ----------
    folder
        Run folder.
    sample
        Name of the sample.
    protocol
        Name of the protocol.
    made
        Time at which the folder was made, in UTC, by the PC's clock.
    began
        Start of the first attempt in UTC, by the clock of the rig; None if there is none.
    status
        Status of the run.
    done
        Number of completed units.
    units
        Number of all units; None if the protocol is not installed.
    frames
        Number of frames of completed units.
    parameters
        What tells the course of each decay, by name: rates, or the parameters of the law that
        describes it; by the folder of its fit in the result, such as `decay/left-paint`, which is
        "" if the fit lies in the result itself.
    values
        Headline values of the result with σ and unit, by their names.
    headline
        What the result says first, for people; "" if there is no result.
    """

    folder: Path
    sample: str
    protocol: str
    made: datetime
    began: datetime | None
    status: RunStatus
    done: int
    units: int | None
    frames: int
    parameters: "Mapping[str, Mapping[str, Measured]]"
    values: "Mapping[str, Measured]"
    headline: str = ""

    def at_present(self) -> "RunSummary":
        """Return the summary with status `running` if a process records the missing units now."""
        if self.status not in INCOMPLETE or not is_being_written(self.folder):
            return self
        return replace(self, status="running")


def status_of(record: "RunRecord", *, is_complete: bool) -> RunStatus:
    """Return the status of a run.

    Parameters
    ----------
    record
        Record of the run's journal.
    is_complete
        Whether all units of the run are complete.

    Returns
    -------
    RunStatus
        Status; never `damaged`, since there is a record.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.catalogue import status_of
    >>> from labrig.record import read_run
    >>> status_of(read_run("runs/decay"), is_complete=True)
    'processed'
    """
    if is_complete:
        return "processed" if (record.folder / "result").is_dir() else "recorded"
    if is_being_written(record.folder):
        return "running"
    last = record.attempts[-1].exit_status if record.attempts else None
    return "failed" if last == "fail" else "interrupted"


def is_being_written(folder: Path) -> bool:
    """Return whether a process has a run open for writing.

    Parameters
    ----------
    folder
        Run folder.

    Returns
    -------
    bool
        Whether it is being written; False for the run of another user, where nobody can tell.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.catalogue import is_being_written
    >>> is_being_written(Path("runs/decay"))
    False
    """
    from filelock import Timeout

    from labrig.foundation.file_lock import plain_lock
    from labrig.record import RECORDING_LOCK

    lock = folder / RECORDING_LOCK
    if not lock.exists():
        return False
    try:
        with plain_lock(lock, LOOK_S, LOOK_S / 20):
            return False
    except Timeout:
        return True
    except (OSError, UsageError):  # another user's folder: only its owner writes there
        return False


def utc(time_s: float) -> datetime:
    """Return a time in seconds since 1970 as a calendar's time in UTC."""
    return datetime.fromtimestamp(time_s, UTC)
