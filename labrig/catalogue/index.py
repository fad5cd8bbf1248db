"""Index of the runs in a folder: the summary of each, as long as its files stay as they are.

Reading a run takes milliseconds, looking at the times and sizes of its files microseconds. The
index is derived from the runs and may be deleted; where it cannot be written, all runs are read.
"""

import json
import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, Self
from zlib import crc32

from labrig.catalogue.run_summary import RunSummary
from labrig.foundation.clock import SystemClock
from labrig.foundation.errors import DiskError, LabrigError
from labrig.foundation.input_file import MAX_TEXT_BYTES, read_bytes
from labrig.foundation.output_file import write_durably
from labrig.results import SUMMARY

FILE = ".runs-index"
PROTOCOL = "protocol.yaml"
#: Files on which every run's summary depends; the fits in its result are added to them.
FILES = (PROTOCOL, "made.txt", "journal.jsonl", "result", f"result/{SUMMARY}")
#: Modules whose code decides what a summary says.
_MODULES = (
    "catalogue/index.py",
    "catalogue/run_summary.py",
    "catalogue/summarising.py",
    "results/fitted_decay.py",
    "results/fitted_decay_file.py",
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
                    place: {
                        name: [each.value, each.sigma, each.unit]
                        for name, each in parameters.items()
                    }
                    for place, parameters in summary.parameters.items()
                },
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
        if content["parameters"]:
            content["parameters"] = _measured(content["parameters"])
        return RunSummary(folder=run, **content)


def read_summaries(runs: Path) -> list[RunSummary]:
    """Return the summary of every run in a folder, in the order in which the runs were made."""
    index, clock = _read_index(runs), SystemClock()
    entries: dict[str, _Entry] = {}
    lasting: dict[str, _Entry] = {}
    for name in (path.name for path in runs.iterdir()):
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


def _measured(parameters: Mapping[str, Mapping[str, Sequence[Any]]]) -> dict[str, Any]:
    from labrig.results import Measured

    return {
        place: {name: Measured(*each) for name, each in of_place.items()}
        for place, of_place in parameters.items()
    }


def _read_index(runs: Path) -> dict[str, _Entry]:
    """Return the entries of the index; none if there is no index, a damaged or an older one."""
    try:
        checksum, content = read_bytes(runs / FILE, MAX_TEXT_BYTES).split(b"\n", 1)
        if checksum != _checksum(content):
            return {}
        index = json.loads(content)
        return {name: _Entry(**entry) for name, entry in index.items()}
    except (LabrigError, ValueError, TypeError, AttributeError, RecursionError):
        return {}


def _write_index(runs: Path, entries: Mapping[str, _Entry]) -> None:
    """Write the index as a whole, so that two processes do not mix theirs; where that may be."""
    content = json.dumps({name: vars(entry) for name, entry in entries.items()}).encode()
    with suppress(DiskError):
        write_durably(runs / FILE, _checksum(content) + b"\n" + content)


def _checksum(content: bytes) -> bytes:
    """Return a checksum that also differs from one code of the summaries to the next."""
    return b"%08x" % crc32(content, _code_checksum())


@cache
def _code_checksum() -> int:
    """Return the checksum of the code that makes summaries and of the version of labrig."""
    package = Path(__file__).parents[1]
    checksum = crc32(version("labrig").encode())
    for module in _MODULES:
        checksum = crc32(read_bytes(package / module, MAX_TEXT_BYTES), checksum)
    return checksum
