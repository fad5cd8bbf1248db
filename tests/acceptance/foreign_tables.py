"""Tables as instruments write them, beside their truth: `-m tests.acceptance.foreign_tables`.

Made exports, then 200 ways to write one decay; with files as arguments, what is read of each.
"""

import sys
import tempfile
from collections import Counter
from pathlib import Path

from tests.foreign_tables import EXPORTS, Export, drawn, verdict

VARIANTS = 200
TRUTH = "30 rows, 0.4 ns"


def main(files: list[str]) -> int:
    """Print the table; the exit code is 1 if anything was read wrong."""
    counts: Counter[str] = Counter()
    print("file | read as | truth | verdict")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "table.txt"
        for export in EXPORTS:
            path.write_text(export.text, encoding="utf-8", newline="")
            how, said = verdict(path, export)
            as_it_should = how == ("refused" if export.refused else "right")
            counts[how if as_it_should else "wrong"] += 1
            print(f"{export.name} | {said} | {export.refused or TRUTH} | {how}")
        for seed in range(VARIANTS):
            path.write_bytes(drawn(seed))
            how, said = verdict(path, Export("", ""))
            counts[how] += 1
            print(f"variant {seed} | {said} | {TRUTH} | {how}")
    for file in files:
        print(f"{file} | {verdict(Path(file), Export('', ''))[1]} | |")
    print(", ".join(f"{count} {how}" for how, count in sorted(counts.items())))
    return int(counts["wrong"] > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
