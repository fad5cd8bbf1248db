"""Summaries of the runs in a folder."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import UTC, date, datetime
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Literal, get_args

from filelock import FileLock, Timeout

from labrig.acquire import read_protocol
from labrig.errors import DataError, DiskError, LabrigError, UsageError
from labrig.record import read_run
from labrig.results import FittedDecay, read_fitted_decays
from labrig.yaml_file import did_you_mean, read_yaml

#: `running`: a process writes to the run; `unfinished`: units are missing; `recorded`: all units
#: are complete, without a result; `processed`: with a result; `damaged`: the journal is unreadable.
RunStatus = Literal["running", "unfinished", "recorded", "processed", "damaged"]
STATUSES: tuple[RunStatus, ...] = get_args(RunStatus)


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
    began
        Begin of the first attempt in UTC; None if there is none.
    state
        State of the run.
    done
        Number of completed units.
    units
        Number of all units; None if the protocol is not installed.
    frames
        Number of frames of completed units.
    results
        Fitted decays by patch; by "" if there is one patch only.
    """

    folder: Path
    sample: str
    protocol: str
    began: datetime | None
    status: RunStatus
    done: int
    units: int | None
    frames: int
    results: Mapping[str, FittedDecay]


@dataclass(frozen=True)
class RunFilter:
    """Filter of runs.

    Attributes
    ----------
    sample, protocol
        Patterns of the names, such as `blue*`, without regard to case.
    since, until
        First and last day in UTC, both included.
    state
        State of the run; None for any state.
    """

    sample: str = "*"
    protocol: str = "*"
    since: date = date.min
    until: date = date.max
    status: str | None = None

    def __post_init__(self) -> None:
        if self.status is not None and self.status not in STATUSES:
            raise UsageError(f"--status {self.status}: {did_you_mean(self.status, STATUSES)}")

    def admits(self, run: RunSummary) -> bool:
        """Whether the filter admits `run`; a run without attempts passes no limits on the day."""
        day = None if run.began is None else run.began.date()
        unbounded = (self.since, self.until) == (date.min, date.max)
        return (
            fnmatchcase(run.sample.casefold(), self.sample.casefold())
            and fnmatchcase(run.protocol.casefold(), self.protocol.casefold())
            and (unbounded if day is None else self.since <= day <= self.until)
            and self.status in (None, run.status)
        )


def list_runs(runs: Path, run_filter: RunFilter) -> list[RunSummary]:
    """List the runs in a folder that a filter admits.

    Parameters
    ----------
    runs
        Folder with run folders.
    run_filter
        Filter by sample, protocol, day and state.

    Returns
    -------
    list of RunSummary
        Summaries of these runs, oldest first.

    Raises
    ------
    UsageError
        If there is no such folder.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.catalogue import RunFilter, list_runs
    >>> runs = list_runs(Path("runs"), RunFilter(protocol="decay"))
    >>> [(run.folder.name, run.status) for run in runs]
    [('decay', 'processed')]
    """
    if not runs.is_dir():
        raise UsageError(f"{runs}: no such folder; give the one with the run folders as --runs")
    summaries = [summarise(path) for path in _run_folders(runs)]
    return [run for run in summaries if run_filter.admits(run)]


def find_run(run: Path, runs: Path) -> Path:
    """Find the folder of a run.

    Parameters
    ----------
    run
        Path of a run folder, name of a folder in `runs` or the beginning of one, or `last`.
    runs
        Folder with run folders.

    Returns
    -------
    Path
        The run folder.

    Raises
    ------
    UsageError
        If there is no such run, or if several names begin alike.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.catalogue import find_run
    >>> find_run(Path("last"), Path("runs")).name
    'decay'
    """
    if (run / "protocol.yaml").is_file():
        return run
    folders = list(_run_folders(runs)) if runs.is_dir() else []
    if str(run) == "last" and folders:
        return folders[-1]
    matches = [path for path in folders if path.name == str(run)] or [
        path for path in folders if path.name.startswith(str(run))
    ]
    if len(matches) == 1:
        return matches[0]
    problem = f"{len(matches)} runs begin so" if matches else "there is no such run"
    raise UsageError(
        f"{run}: expected a run folder, the beginning of one's name or 'last'; {problem}, see: "
        f"labrig runs --runs {runs}"
    )


def summarise(folder: Path) -> RunSummary:
    """Summarise the run in a folder.

    Parameters
    ----------
    folder
        Run folder; its files may be incomplete or damaged.

    Returns
    -------
    RunSummary
        Sample, protocol, state, number of frames and fitted decays.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.catalogue import summarise
    >>> summary = summarise(Path("runs/decay"))
    >>> summary.sample, summary.status, summary.frames
    ('sample', 'processed', 37)
    """
    sample, protocol, units = _protocol_summary(folder)
    try:
        record, results = read_run(folder), read_fitted_decays(folder / "result")
    except (DataError, DiskError):
        has_journal = (folder / "journal.jsonl").exists()
        status: RunStatus = "damaged" if has_journal else "unfinished"
        return RunSummary(folder, sample, protocol, None, status, 0, units, 0, {})
    completed = record.completed()
    return RunSummary(
        folder=folder,
        sample=sample,
        protocol=protocol,
        began=(
            datetime.fromtimestamp(record.attempts[0].start["time"], UTC)
            if record.attempts
            else None
        ),
        status=status_of(folder, units is not None and len(completed) == units),
        done=len(completed),
        units=units,
        frames=sum(len(attempt.frames) for attempt in completed.values()),
        results=results,
    )


def _run_folders(runs: Path) -> Iterator[Path]:
    return (path.parent for path in sorted(runs.glob("*/protocol.yaml")))


def _protocol_summary(folder: Path) -> tuple[str, str, int | None]:
    """Return sample, protocol and number of units from the protocol file of a run."""
    try:
        content = read_yaml(folder / "protocol.yaml")
    except UsageError:
        return "?", "?", None
    sample = content.get("sample")
    name = sample.get("name", "?") if isinstance(sample, dict) else "?"
    try:
        units = len(read_protocol(folder / "protocol.yaml").units())
    except LabrigError:
        units = None
    return str(name), str(content.get("protocol", "?")), units


def status_of(folder: Path, is_complete: bool) -> RunStatus:
    """Return the state of a run.

    Parameters
    ----------
    folder
        Run folder.
    is_complete
        Whether all units of the run are complete.

    Returns
    -------
    RunState
        One of `running`, `unfinished`, `recorded` and `processed`.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.catalogue import status_of
    >>> status_of(Path("runs/decay"), is_complete=True)
    'processed'
    """
    if _is_being_written(folder):
        return "running"
    if not is_complete:
        return "unfinished"
    return "processed" if (folder / "result").is_dir() else "recorded"


def _is_being_written(folder: Path) -> bool:
    """Whether a process has the run open for writing."""
    lock = folder / ".lock"
    if not lock.exists():
        return False
    try:
        with FileLock(lock, timeout=0):
            return False
    except Timeout:
        return True
    except OSError:  # another user's folder: only its owner writes there
        return False
