"""A decay of many hours of lab time: memory, open files and threads of the process that records it.

    python -m tests.acceptance.long_run [--hours 24] [--every 30]

Printed once for every twelfth of the time. Wanted: as many files and threads open at the end as
after the first twelfth, and memory that grows from there to the end by no more in an hour than the
journal, which is kept in memory, and its records, and a quarter of what one picture kept of each
frame would add. How much memory a process takes at all depends on the computer and is no verdict.
"""

import argparse
import os
import sys
import tempfile
import threading
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from time import monotonic
from typing import Any

from labrig.cli.exit_codes import guarded
from labrig.foundation import resources
from labrig.foundation.yaml_file import read_yaml, yaml_text
from labrig.record import AttemptWriter, FrameRecord

SHARES = 12
PAGE_MB = os.sysconf("SC_PAGE_SIZE") / 1e6 if hasattr(os, "sysconf") else 0.0
WIDTH, HEIGHT = 96, 64
PICTURE_MB = 2 * WIDTH * HEIGHT / 1e6
#: Memory of a byte of the journal and its records: 2.6 on a computer that returns nothing.
PER_JOURNAL_BYTE = 3.0
#: Growth that is allowed beside it, in pictures a frame: allocators take memory in steps, and a
#: picture that stays of each frame is four times as much.
PICTURES_PER_FRAME = 0.25


@dataclass(frozen=True)
class Reading:
    """Memory, files and threads of the process after some frames."""

    frames: int
    lab_h: float
    memory_mb: float
    files: int
    threads: int
    journal_mb: float

    def __str__(self) -> str:
        return (
            f"{self.lab_h:7.2f}{self.frames:8}{self.memory_mb:11.1f}{self.files:7}"
            f"{self.threads:9}{self.journal_mb:13.1f}"
        )


def watched(every_frames: int, readings: list[Reading]) -> Callable[..., FrameRecord]:
    """Return the writer of frames, which takes a reading after every so many."""
    write, written, began = AttemptWriter.frame, 0, 0.0

    def frame(writer: AttemptWriter, *arguments: Any, **keys: Any) -> FrameRecord:
        nonlocal written, began
        record = write(writer, *arguments, **keys)
        written, began = written + 1, began or record.end_time
        if written % every_frames == 0:
            pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
            journal = record.path.parent.parent / "journal.jsonl"
            readings.append(
                Reading(
                    written,
                    (record.end_time - began) / 3600,
                    pages * PAGE_MB,
                    len(list(Path("/proc/self/fd").iterdir())),
                    threading.active_count(),
                    journal.stat().st_size / 1e6,
                )
            )
            print(readings[-1], file=sys.__stdout__, flush=True)
        return record

    return frame


@dataclass(frozen=True)
class Growth:
    """Growth of the process from one reading to another."""

    first: Reading
    last: Reading

    @property
    def _hours(self) -> float:
        return self.last.lab_h - self.first.lab_h

    @property
    def mb_per_h(self) -> float:
        """Return the memory that is taken in an hour, in MB."""
        return (self.last.memory_mb - self.first.memory_mb) / self._hours

    @property
    def allowed_mb_per_h(self) -> float:
        """Return the memory that may be taken in an hour, in MB."""
        journal_mb = self.last.journal_mb - self.first.journal_mb
        pictures_mb = PICTURES_PER_FRAME * PICTURE_MB * (self.last.frames - self.first.frames)
        return (PER_JOURNAL_BYTE * journal_mb + pictures_mb) / self._hours

    @property
    def files(self) -> int:
        """Return the number of files that stay open."""
        return max(self.last.files - self.first.files, 0)

    @property
    def threads(self) -> int:
        """Return the number of threads that stay."""
        return max(self.last.threads - self.first.threads, 0)

    @property
    def wrong(self) -> bool:
        """Return whether anything grows that should not."""
        return self.mb_per_h > self.allowed_mb_per_h or bool(self.files or self.threads)

    def __str__(self) -> str:
        above = "more" if self.mb_per_h > self.allowed_mb_per_h else "less"
        return (
            f"memory grows by {self.mb_per_h:.2f} MB an hour\n"
            f"{above} than {self.allowed_mb_per_h:.1f} MB an hour, "
            f"{self.files} files and {self.threads} threads that stay"
        )


def main() -> None:
    """Print readings, and whether the last is as it should be."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=24.0)
    parser.add_argument("--every", type=float, default=30.0, help="seconds between frames")
    asked = parser.parse_args()
    readings: list[Reading] = []
    print("   lab/h  frames  memory/MB  files  threads  journal/MB")
    n_frames = int(asked.hours * 3600 / asked.every)
    began_s = monotonic()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        protocol, rig = folder / "protocol.yaml", folder / "rig.yaml"
        content = {
            "protocol": "decay",
            "sample": {"name": "test"},
            "charge": "30 s",
            "for": f"{asked.hours} h",
            "every": f"{asked.every} s",
            "exposure": "1/4 s",
        }
        protocol.write_text(yaml_text(content), encoding="utf-8")
        room = read_yaml(resources.find("config", "rig", "sim"))
        room["simulation"]["sensor"] = {"width": WIDTH, "height": HEIGHT}
        rig.write_text(yaml_text(room), encoding="utf-8")
        AttemptWriter.frame = watched(max(n_frames // SHARES, 1), readings)  # type: ignore[method-assign]
        said = StringIO()
        command = ["run", str(protocol), "--rig", str(rig), "--runs", str(folder / "runs")]
        with redirect_stdout(StringIO()), redirect_stderr(said):
            code = guarded([*command, "--no-process", "--yes"])
    growth = Growth(readings[0], readings[-1])
    print(f"{monotonic() - began_s:.0f} s, exit code {code}")
    print(growth)
    sys.exit(code != 0 or growth.wrong)


if __name__ == "__main__":
    main()
