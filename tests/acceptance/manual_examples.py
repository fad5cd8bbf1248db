"""Outputs that the manual shows of a decay on the simulated bench, and of processing it again.

python -m tests.acceptance.manual_examples
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

COMMANDS = (
    ("run", "decay", "--rig", "sim"),
    ("process", "last", "--roi", "sample=500,300,300,200", "--exclude", "20"),
)


def main() -> None:
    """Print the commands and what they print."""
    environment = {**os.environ, "COLUMNS": "80", "PYTHONUTF8": "1"}
    with tempfile.TemporaryDirectory() as folder:
        for arguments in COMMANDS:
            print("$ labrig", *arguments, flush=True)
            done = subprocess.run(
                [sys.executable, "-m", "labrig", *arguments], cwd=Path(folder), env=environment,
                stdout=subprocess.PIPE, text=True, encoding="utf-8", check=True,
            )  # fmt: skip
            print(done.stdout)


if __name__ == "__main__":
    main()
