"""Two labrigs, one emulated board, by every spelling of its port: who gets in, who sends a byte.

    python -m tests.acceptance.two_labrigs [--trials 60] [--seed 1]

In half of the trials the first labrig is held in the middle of its work while the second one comes;
in the others both start at once.
"""

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from labrig.acquire.roles.lamp import SWITCHINGS
from tests.acceptance.board_on_a_terminal import RIG, WatchedBoard
from tests.lit_bench import wait_for_guards
from tests.terminal import on_a_terminal

SPELLINGS = ("path", "link", "relative path", "two slashes", "other TMPDIR")
PATIENCE_S = 60.0


def start(spelling: str, address: str, folder: Path) -> subprocess.Popen[str]:
    """`labrig rig check` of a rig with that port alone, called so."""
    folder.mkdir()
    (folder / "by-id").symlink_to(address)
    called = {
        "link": "by-id",
        "relative path": os.path.relpath(address, folder),
        "two slashes": f"/{address}",
    }.get(spelling, address)
    (folder / "rig.yaml").write_text(RIG.format(address=called))
    environment = os.environ | {"PYTHONPATH": str(Path.cwd()), "TRIAL": str(folder)}
    if spelling == "other TMPDIR":
        environment["TMPDIR"] = str(folder)
    return subprocess.Popen(
        [sys.executable, "-m", "labrig", "rig", "check", "rig.yaml"],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def held(rng: random.Random, folder: Path, spelling: str) -> str:
    """The first is stopped in mid-work; the second must leave, unheard."""
    board = WatchedBoard()
    with on_a_terminal(board) as address:
        first = start(rng.choice(SPELLINGS), address, folder / "first")
        deadline_s = time.monotonic() + PATIENCE_S
        while not board.switched and time.monotonic() < deadline_s:
            time.sleep(0.001)
        first.send_signal(signal.SIGSTOP)
        time.sleep(0.1)
        before = board.heard_bytes, board.lamp_on
        code, complaint = _ended(start(spelling, address, folder / "second"))
        after = board.heard_bytes, board.lamp_on
        first.kill()
        first.communicate()
        wait_for_guards(folder)
        if code == 2 and before == after and "held by another labrig" in complaint:
            return ""
        return f"{spelling}: code {code}; {before} → {after}; {complaint!r}"


def at_once(rng: random.Random, folder: Path) -> str:
    """One gets in, or one after the other; only those that do switch the lamp."""
    board = WatchedBoard()
    with on_a_terminal(board) as address:
        both = [start(rng.choice(SPELLINGS), address, folder / str(number)) for number in range(2)]
        endings = sorted(_ended(one) for one in both)
        wait_for_guards(folder)
    codes = [code for code, _ in endings]
    lit = sum(on for _, on in board.switched)
    refused = codes == [0, 2] and "held by another labrig" in endings[1][1]
    if (refused or codes == [0, 0]) and lit == SWITCHINGS * codes.count(0):
        return ""
    return f"at once: {endings}, lit {lit} times"


def _ended(process: subprocess.Popen[str]) -> tuple[int, str]:
    _, complaint = process.communicate(timeout=PATIENCE_S)
    return process.returncode, complaint


def main() -> None:
    """Count those who got in where another one was, and show them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    rng = random.Random(asked.seed)
    tally: Counter[str] = Counter()
    wrong = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for number in range(asked.trials):
            within = folder / f"trial-{number}"
            within.mkdir()
            kind = "at once" if number % 2 else SPELLINGS[number // 2 % len(SPELLINGS)]
            said = at_once(rng, within) if number % 2 else held(rng, within, kind)
            tally[kind] += 1
            if said:
                wrong.append(f"trial {number}: {said}")
    print(", ".join(f"{kind}: {count}" for kind, count in tally.items()))
    print(f"{len(wrong)} of {asked.trials} went wrong", *wrong, sep="\n")


if __name__ == "__main__":
    main()
