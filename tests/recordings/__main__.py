"""Hold the numbers that this labrig makes of the recorded runs against those that were kept.

    python -m tests.recordings                 every number that differs, the furthest first
    python -m tests.recordings decay chain     of some recordings
    python -m tests.recordings --keep          keep the numbers as they are now
    python -m tests.recordings --record        record the runs anew, too

Ends with 1 if a number differs by more than 1e-6 σ, or 1e-6 of it where it has no σ. A commit that
changes numbers on purpose says so, prints the differences in its message and keeps them anew.
"""

import argparse
import sys
import tempfile
from pathlib import Path

from .runs import RUNS

MAX_LINES = 20


def main() -> int:
    """Run the command; its exit code."""
    parser = argparse.ArgumentParser(prog="python -m tests.recordings")
    parser.add_argument("names", nargs="*", default=[run.name for run in RUNS])
    parser.add_argument("--keep", action="store_true", help="keep the numbers as they are now")
    parser.add_argument("--record", action="store_true", help="record the runs anew, and keep them")
    asked = parser.parse_args()
    changed = False
    for run in (run for run in RUNS if run.name in asked.names):
        with tempfile.TemporaryDirectory() as folder:
            if asked.record and run.has_frames:
                run.keep(run.record(Path(folder) / "bench"))
            result = run.processed(Path(folder) / "runs")
            found = run.differences(result)
            matter = [one for one in found if one.matters]
            print(f"{run.name}: {len(found)} numbers differ, {len(matter)} of them matter")
            for one in found[:MAX_LINES]:
                print(f"    {one}")
            changed = changed or bool(matter)
            if asked.keep or asked.record:
                run.keep_numbers(result)
    return int(changed and not (asked.keep or asked.record))


if __name__ == "__main__":
    sys.exit(main())
