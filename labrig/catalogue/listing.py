"""The runs in a folder: listed through a filter, or one found by its name."""

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import date, datetime
from fnmatch import fnmatchcase
from pathlib import Path

from labrig.catalogue.index import PROTOCOL, is_run, read_summaries
from labrig.catalogue.run_summary import STATUSES, RunSummary
from labrig.foundation.errors import UsageError
from labrig.record import require_plain_folder, time_made


@dataclass(frozen=True)
class RunFilter:
    """Filter of runs.

    Attributes
    ----------
    sample, protocol
        Patterns of the names, such as `blue*`, without regard to case.
    since, until
        First and last day in UTC, both included.
    status
        Status of the run; None for any.
    """

    sample: str = "*"
    protocol: str = "*"
    since: date = date.min
    until: date = date.max
    status: str | None = None

    def __post_init__(self) -> None:
        if self.status is not None and self.status not in STATUSES:
            from labrig.foundation.yaml_file import did_you_mean

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
        Filter by sample, protocol, day and status.

    Returns
    -------
    list of RunSummary
        Summaries of these runs in the order in which they were made.

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
    return [run for run in read_summaries(runs) if run_filter.admits(run)]


def find_run(run: Path, runs: Path) -> Path:
    """Find the folder of a run.

    Parameters
    ----------
    run
        Path of a run folder; name of a folder in `runs`, or the beginning of one; or `last` for the
        run that was made last.
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
    DataError
        If something in the run folder leads elsewhere, such as a link.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.catalogue import find_run
    >>> find_run(Path("last"), Path("runs")).name
    'decay'
    """
    folder = _find_folder(run, runs)
    require_plain_folder(folder)
    return folder


def _find_folder(run: Path, runs: Path) -> Path:
    if (run / PROTOCOL).is_file():
        return run
    if str(run) == "last":
        matches = sorted(_run_folders(runs, ""), key=_order)[-1:]
    elif str(run) == run.name and (runs / run / PROTOCOL).is_file():
        return runs / run
    else:
        matches = list(_run_folders(runs, str(run)))
    if len(matches) == 1:
        return matches[0]
    problem = f"{len(matches)} runs begin so" if matches else "there is no such run"
    raise UsageError(
        f"{run}: expected a run folder, the beginning of one's name or 'last'; {problem}, see: "
        f"labrig runs --runs {runs}"
    )


def _run_folders(runs: Path, beginning: str) -> Iterator[Path]:
    """Yield the run folders whose names begin so."""
    if runs.is_dir():
        for path in runs.iterdir():
            if path.name.startswith(beginning) and is_run(path):
                yield path


def _order(run: Path) -> tuple[datetime, str]:
    return time_made(run), run.name
