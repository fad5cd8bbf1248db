"""The runs of a folder: an index of their summaries, a list through a filter, one by its name.

Reading a run takes milliseconds, looking at the times and sizes of its files microseconds. The
index is derived from the runs and may be deleted; where it cannot be written, all runs are read.
One that another user wrote, or another version of labrig, is none: its numbers are not looked at.
"""

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import date, datetime
from difflib import get_close_matches
from fnmatch import fnmatchcase
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self
from zlib import crc32

from labrig.catalogue.run_summary import STATUSES, RunSummary
from labrig.foundation.activity import counted
from labrig.foundation.clock import SystemClock
from labrig.foundation.errors import DiskError, LabrigError, UsageError
from labrig.foundation.file_kind import RUN, require_kind, run_around
from labrig.foundation.input_file import MAX_TEXT_BYTES, read_bytes
from labrig.foundation.output_file import write_durably
from labrig.record import own_digest, require_plain_folder, time_made
from labrig.results import SUMMARY

if TYPE_CHECKING:
    from labrig.results import Measured

FILE = ".runs-index"
PROTOCOL = "protocol.yaml"
#: Files on which every run's summary depends; the fits in its result are added to them.
FILES = (
    *(PROTOCOL, "made.txt", "journal.jsonl"),
    *("result", f"result/{SUMMARY}", "result/result.json"),
)
#: Modules whose code decides what a summary says.
_MODULES = (
    "catalogue/index.py",
    "catalogue/run_summary.py",
    "catalogue/summarising.py",
    "results/fitted_decay.py",
    "results/fitted_decay_file.py",
    "results/headline_values.py",
    "results/measured.py",
    "results/summary.py",
)
#: Age from which another change of a file shows in its time: file systems count by up to 2 s.
SETTLED_S = 3.0

#: Time of change in ns, number and size of a file; None if there is no file.
Stamp = list[int] | None


@dataclass(frozen=True)
class _Entry:
    """Summary of a run as plain values, and the stamps that its files had before it was made."""

    stamps: Mapping[str, Stamp]
    content: Mapping[str, Any]

    @classmethod
    def made_from(cls, run: Path) -> Self:
        from labrig.catalogue.summarising import summarise
        from labrig.results import fits_by_folder

        fits = fits_by_folder(run / "result").values()
        stamps = {file: _stamp(f"{run}/{file}") for file in FILES}
        stamps |= {path.relative_to(run).as_posix(): _stamp(str(path)) for path in fits}
        summary = summarise(run)
        return cls(
            stamps,
            {
                "sample": summary.sample,
                "protocol": summary.protocol,
                "made": summary.made.isoformat(),
                "began": None if summary.began is None else summary.began.isoformat(),
                "status": summary.status,
                "done": summary.done,
                "units": summary.units,
                "frames": summary.frames,
                "parameters": {
                    place: _plain(parameters) for place, parameters in summary.parameters.items()
                },
                "values": _plain(summary.values),
                "headline": summary.headline,
            },
        )

    def holds(self, run: str) -> bool:
        """Whether the files of the run are those of which the summary was made."""
        return all(_stamp(f"{run}/{file}") == stamp for file, stamp in self.stamps.items())

    def lasts(self, now_s: float) -> bool:
        """Whether every later change would show: in the stamps, or by an installed protocol."""
        newest_ns = max(stamp[0] for stamp in self.stamps.values() if stamp is not None)
        return newest_ns < (now_s - SETTLED_S) * 1e9 and self.content["units"] is not None

    def summary(self, run: Path) -> RunSummary:
        content = dict(self.content)
        began = content["began"]
        content["made"] = datetime.fromisoformat(content["made"])
        content["began"] = None if began is None else datetime.fromisoformat(began)
        content["parameters"] = {
            place: _measured(parameters) for place, parameters in content["parameters"].items()
        }
        content["values"] = _measured(content["values"])
        return RunSummary(folder=run, **content)


def read_summaries(runs: Path) -> list[RunSummary]:
    """Return the summary of every run in a folder, in the order in which the runs were made."""
    index, clock = _read_index(runs), SystemClock()
    entries: dict[str, _Entry] = {}
    lasting: dict[str, _Entry] = {}
    for name in counted([path.name for path in runs.iterdir()], "reading runs"):
        if name in index and index[name].holds(f"{runs}/{name}"):
            entries[name] = lasting[name] = index[name]
        elif is_run(runs / name):
            now_s = clock.wall()
            with suppress(FileNotFoundError):  # it is being deleted
                entries[name] = entry = _Entry.made_from(runs / name)
                if entry.lasts(now_s):
                    lasting[name] = entry
    if lasting != index:
        _write_index(runs, lasting)
    summaries = [entry.summary(runs / name).at_present() for name, entry in entries.items()]
    return sorted(summaries, key=lambda run: (run.made, run.folder.name))


def indexed_summary(run: Path) -> RunSummary:
    """Return the summary of a run, from the index of its folder where that holds.

    Parameters
    ----------
    run
        Run folder.

    Returns
    -------
    RunSummary
        Summary of the run; it is made anew where the index has none, or an older one.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.catalogue import indexed_summary
    >>> indexed_summary(Path("runs/decay")).status
    'processed'
    """
    entry = _read_index(run.parent).get(run.name)
    if entry is None or not entry.holds(str(run)):
        from labrig.catalogue.summarising import summarise

        return summarise(run)
    return entry.summary(run).at_present()


def is_run(folder: Path) -> bool:
    """Return whether a folder is that of a run; one that another user keeps private is not."""
    try:
        return (folder / PROTOCOL).is_file()
    except PermissionError:
        return False


def _stamp(path: str) -> Stamp:
    try:
        status = os.stat(path)  # noqa: PTH116 - of thousands of runs, and a Path takes longer
    except OSError:
        return None
    return [status.st_mtime_ns, status.st_ino, status.st_size]


def _plain(quantities: "Mapping[str, Measured]") -> dict[str, tuple[float, float, str]]:
    return {name: (each.value, each.sigma, each.unit) for name, each in quantities.items()}


def _measured(quantities: Mapping[str, Sequence[Any]]) -> "dict[str, Measured]":
    if not quantities:
        return {}
    from labrig.results import Measured  # not for a list of runs without results

    return {name: Measured(*each) for name, each in quantities.items()}


def _read_index(runs: Path) -> dict[str, _Entry]:
    """Return the entries of the index; none if there is none of this user and this labrig."""
    try:
        digest, content = read_bytes(runs / FILE, MAX_TEXT_BYTES).split(b"\n", 1)
        if digest != _digest(content):
            return {}
        index = json.loads(content)
        return {name: _Entry(**entry) for name, entry in index.items()}
    except (LabrigError, ValueError, TypeError, AttributeError, RecursionError):
        return {}


def _write_index(runs: Path, entries: Mapping[str, _Entry]) -> None:
    """Write the index as a whole, so that two processes do not mix theirs; where that may be."""
    content = json.dumps({name: vars(entry) for name, entry in entries.items()}).encode()
    with suppress(DiskError):
        write_durably(runs / FILE, _digest(content) + b"\n" + content)


def _digest(content: bytes) -> bytes:
    """Return a digest that also differs from one code of the summaries to the next."""
    return own_digest(b"%08x" % _code_checksum() + content).encode()


@cache
def _code_checksum() -> int:
    """Return the checksum of the code that makes summaries and of the version of labrig."""
    package = Path(__file__).parents[1]
    checksum = crc32(version("labrig").encode())
    for module in _MODULES:
        checksum = crc32(read_bytes(package / module, MAX_TEXT_BYTES), checksum)
    return checksum


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
        """True if the filter admits `run`; a run without attempts passes no limits on the day."""
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
    if is_run(runs):
        raise UsageError(
            f"{runs}: expected a folder with run folders, got a run folder; give --runs "
            f"{runs.parent}, or show this run: labrig runs show {runs}"
        )
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
    if not matches:
        require_kind(run, RUN)
    if not matches and run.exists() and (around := run_around(run)) is not None:
        raise UsageError(f"{run}: this is a part of a run; the run is {around}")
    problem = f"{len(matches)} runs begin so" if matches else "there is no such run"
    names = [path.name for path in _run_folders(runs, "")]
    close = get_close_matches(str(run), names, n=1)
    suggestion = f"; did you mean '{close[0]}'?" if close and not matches else ""
    raise UsageError(
        f"{run}: expected a run folder, the beginning of one's name or 'last'; {problem}, see: "
        f"labrig runs --runs {runs}{suggestion}"
    )


def _run_folders(runs: Path, beginning: str) -> Iterator[Path]:
    """Yield the run folders whose names begin so."""
    if runs.is_dir():
        for path in runs.iterdir():
            if path.name.startswith(beginning) and is_run(path):
                yield path


def _order(run: Path) -> tuple[datetime, str]:
    return time_made(run), run.name
