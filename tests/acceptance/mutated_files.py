"""Very many YAML, CSV and journal files that came to harm: refused in one quick line, or read.

    python -m tests.acceptance.mutated_files [--cases 10000] [--seed 1] [--keep DIR]

How files are harmed and what must hold is in `tests/mutated_files.py`. Every case is a command in a
process of its own; a case that went wrong is kept in DIR.
"""

import argparse
import random
import shutil
import sys
import tempfile
from collections import Counter, defaultdict
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path

import yaml

from labrig.cli.exit_codes import guarded
from labrig.foundation import resources
from tests.mutated_files import Outcome, try_one, victims

PROTOCOL = {
    "protocol": "decay",
    "sample": {"name": "test"},
    "charge": "30 s",
    "for": "30 s",
    "exposure": "1/4 s",
    "repeats": 2,
}


def recorded(place: Path) -> Path:
    """A short decay with its result."""
    protocol, rig = place / "protocol.yaml", place / "rig.yaml"
    protocol.write_text(yaml.safe_dump(PROTOCOL))
    text = (resources.folder("config") / "sim.yaml").read_text()
    rig.write_text(text.replace("1404", "96").replace("936", "64"))
    with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
        code = guarded(["run", str(protocol), "--rig", str(rig), "--runs", str(place / "runs")])
    if code:
        sys.exit(f"on a sound file: exit code {code}")
    (run,) = (place / "runs").iterdir()
    return run


def main() -> None:
    """Print a line for each kind of file, and what went wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=Path)
    asked = parser.parse_args()
    outcomes: dict[str, list[Outcome]] = defaultdict(list)
    wrong: list[str] = []
    with tempfile.TemporaryDirectory() as scratch:
        place = asked.keep or Path(scratch)
        place.mkdir(parents=True, exist_ok=True)
        by_kind = defaultdict(list)
        for victim in victims(recorded(place)):
            by_kind[victim.kind].append(victim)
        with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
            for first, *_ in by_kind.values():
                guarded(first.command(first.file))  # all is imported before the first case
        for number in range(asked.cases):
            rng = random.Random(f"{asked.seed} {number}")
            kind = list(by_kind)[number % len(by_kind)]
            victim, case = rng.choice(by_kind[kind]), place / f"case-{number}"
            outcome = try_one(victim, rng, case)
            outcomes[kind].append(outcome)
            if outcome.wrong:
                wrong.append(f"case {number}, {kind}, {victim.file.name}: {outcome.wrong}")
                print(wrong[-1], flush=True)
            else:
                shutil.rmtree(case)
    print(f"{'file':16}{'cases':>7}{'wrong':>7}{'longest refusal':>17}  exit codes")
    for kind, of_kind in outcomes.items():
        codes = sorted(Counter(one.code for one in of_kind).items())
        longest_s = max((one.took_s for one in of_kind if one.code), default=0.0)
        failures = sum(bool(one.wrong) for one in of_kind)
        told = ", ".join(f"{code}: {count}" for code, count in codes)
        print(f"{kind:16}{len(of_kind):7}{failures:7}{longest_s:15.1f} s  {told}")
    print(f"{len(wrong)} of {asked.cases} went wrong")
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
