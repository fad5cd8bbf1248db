"""Plant small bugs one after the other, and count those that the tests beside the code notice.

    python -m tests.acceptance.planted_bugs             # every bug
    python -m tests.acceptance.planted_bugs glare-sigma # some of them

The bugs stand in `planted_bugs.toml`: a file, text that occurs in it once, the text with the bug,
and the test files beside. They are planted in a copy of the files that git tracks. The command ends
with 1 if fewer than 90 % are noticed, or if the text of a bug is not in its file: code that moved
takes its bug along.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import tomllib
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

ROOT = Path(__file__).parents[2]
BUGS = Path(__file__).with_suffix(".toml")
NOTICED_SHARE = 0.9
MAX_S = 600.0
#: Exit codes of pytest.
PASSED, FAILED = 0, 1


@dataclass(frozen=True)
class PlantedBug:
    """A change of one place that makes the code wrong."""

    name: str
    file: str
    right: str
    planted: str
    tests: tuple[str, ...]

    def in_code(self, code: str) -> str:
        """Return the code with the bug; ValueError if its place is missing or ambiguous."""
        if (n := code.count(self.right)) != 1:
            raise ValueError(f"{self.name}: its text occurs {n} times in {self.file}")
        return code.replace(self.right, self.planted)


class Verdict(Enum):
    """End of the tests beside a bug."""

    NOTICED = "noticed"
    SURVIVED = "SURVIVED"
    NOT_RUN = "NOT RUN"


def planted_bugs() -> list[PlantedBug]:
    """Return the bugs, each with a name of its own."""
    with BUGS.open("rb") as file:
        return [
            PlantedBug(name, row["file"], row["right"], row["planted"], tuple(row["tests"]))
            for name, row in tomllib.load(file).items()
        ]


def main() -> int:
    """Run the command; its exit code."""
    parser = argparse.ArgumentParser(prog="python -m tests.acceptance.planted_bugs")
    parser.add_argument("names", nargs="*")
    names = parser.parse_args().names
    bugs = [bug for bug in planted_bugs() if not names or bug.name in names]
    with tempfile.TemporaryDirectory() as folder:
        copy = _copied(Path(folder) / "labrig")
        verdicts = []
        for bug in bugs:
            verdict, last = _tried(bug, copy)
            verdicts.append(verdict)
            print(f"{bug.name:34} {verdict.value:9} {last}", flush=True)
    noticed = verdicts.count(Verdict.NOTICED)
    print(f"{noticed} of {len(bugs)} bugs are noticed by the tests beside them")
    return int(noticed < NOTICED_SHARE * len(bugs) or Verdict.NOT_RUN in verdicts)


def _copied(copy: Path) -> Path:
    """Return a copy of the tracked files, with the links of an editable installation."""
    listed = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True, encoding="utf-8"
    ).stdout
    for name in filter(None, listed.split("\0")):
        (copy / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, copy / name)
    for package in ("drivers", "protocols", "sim", "config"):
        (copy / "labrig" / package).symlink_to(f"../{package}", target_is_directory=True)
    (copy / ".editable").mkdir()
    (copy / ".editable" / "labrig").symlink_to("../labrig", target_is_directory=True)
    return copy


def _tried(bug: PlantedBug, copy: Path) -> tuple[Verdict, str]:
    """Return how the tests beside the bug ended, and the line that says where."""
    path = copy / bug.file
    right = path.read_text(encoding="utf-8")
    try:
        path.write_text(bug.in_code(right), encoding="utf-8")
        ended = subprocess.run(
            [
                sys.executable,
                "-m",
                "pytest",
                "-q",
                "-x",
                "-n0",
                "-p",
                "no:cacheprovider",
                *bug.tests,
            ],
            cwd=copy,
            env=os.environ | {"PYTHONPATH": f"{copy / '.editable'}{os.pathsep}{copy}"},
            capture_output=True,
            encoding="utf-8",
            timeout=MAX_S,
        )
    except (ValueError, FileNotFoundError, subprocess.TimeoutExpired) as error:
        return Verdict.NOT_RUN, str(error)
    finally:
        path.write_text(right, encoding="utf-8")
    lines = ended.stdout.splitlines()
    failed = [line for line in lines if line.startswith(("FAILED", "ERROR"))]
    last = (failed or lines or [""])[-1][:150]
    match ended.returncode:
        case code if code == FAILED:
            return Verdict.NOTICED, last
        case code if code == PASSED:
            return Verdict.SURVIVED, last
        case _:
            return Verdict.NOT_RUN, last


if __name__ == "__main__":
    sys.exit(main())
