"""A decay of many hours of lab time: memory, open files and threads of the process that records it.

    python -m tests.acceptance.long_run [--hours 24] [--every 30]

Printed once for every twelfth of the time. Wanted: as many files and threads open at the end as
after the first twelfth, and memory that grows by no more than the journal, which is kept in memory,
and its records.
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
#: Memory of the records of a byte of the journal, and of what a process takes at its leisure.
PER_JOURNAL_BYTE, SLACK_MB = 3.0, 8.0


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
        room["simulation"]["sensor"] = {"width": 96, "height": 64}
        rig.write_text(yaml_text(room), encoding="utf-8")
        AttemptWriter.frame = watched(max(n_frames // SHARES, 1), readings)  # type: ignore[method-assign]
        said = StringIO()
        command = ["run", str(protocol), "--rig", str(rig), "--runs", str(folder / "runs")]
        with redirect_stdout(StringIO()), redirect_stderr(said):
            code = guarded([*command, "--no-process", "--yes"])
    first, last = readings[0], readings[-1]
    allowed_mb = PER_JOURNAL_BYTE * (last.journal_mb - first.journal_mb) + SLACK_MB
    wrong = {
        f"exit code {code}": code != 0,
        "files stay open": last.files > first.files,
        "threads stay": last.threads > first.threads,
        f"memory grows by more than {allowed_mb:.1f} MB": last.memory_mb - first.memory_mb
        > allowed_mb,
    }
    print(f"{monotonic() - began_s:.0f} s")
    grew = [what for what, is_so in wrong.items() if is_so]
    print("; ".join(grew) or "nothing grows but what the journal holds")
    sys.exit(any(wrong.values()))


if __name__ == "__main__":
    main()
