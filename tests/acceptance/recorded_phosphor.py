"""A whole phosphor, recorded and processed, against the numbers that were kept of it.

    python -m tests.acceptance.recorded_phosphor [--keep] [--most 20]

Runs `labrig run phosphor --rig sim-phosphor --yes` and prints every number of its result that
differs, the furthest first. Ends with 1 if one differs by more than 1e-6 σ, or 1e-9 of it where it
has no σ. The simulated room gives the same frames for the same rig; where the room itself is
changed on purpose, the numbers are kept anew.
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

from tests.recordings.numbers import differences, keep_numbers

KEPT = Path(__file__).parent / "recorded_phosphor"


def main() -> int:
    """Run the command; its exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--keep", action="store_true", help="keep the numbers as they are now")
    parser.add_argument("--most", type=int, default=20, help="lines to print")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as runs:
        command = [sys.executable, "-m", "labrig", "run", "phosphor", "--rig", "sim-phosphor"]
        subprocess.run([*command, "--yes", "--runs", runs], check=True, stdout=subprocess.DEVNULL)
        (run,) = Path(runs).iterdir()
        if asked.keep:
            keep_numbers(run / "result", KEPT)
            return 0
        found = differences(KEPT, run / "result")
        matter = sum(one.matters for one in found)
        print(f"{len(found)} numbers differ, {matter} of them matter")
        for one in found[: asked.most]:
            print(f"    {one}")
        return int(matter > 0)


if __name__ == "__main__":
    sys.exit(main())
