"""The PC sleeps at any moment of a run: said, the unit done again, the lamp off.

    python -m tests.acceptance.suspended [--trials 12] [--seed 1]

labrig is a process of its own with its real clock, on an emulated board behind a pseudo-terminal.
To sleep, it is stopped, and a shim before libc's clock_gettime (LD_PRELOAD, needs a C compiler)
moves CLOCK_BOOTTIME and CLOCK_REALTIME on, as the kernel does when it wakes up.
"""

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path

from labrig.acquire import (
    LAMP_OFF,
    LAMP_ON,
    ProtocolModel,
    Session,
    Unit,
    plan,
    read_rig_file,
)
from labrig.bench import open_bench
from labrig.bench.execution import execute
from labrig.cli.progress import progress
from labrig.record import RunFolder, read_run
from tests.acceptance.board_on_a_terminal import RIG, WatchedBoard
from tests.terminal import on_a_terminal

SHIM = r"""
#define _GNU_SOURCE
#include <stdlib.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

/* Slept so far: a second for each byte of a file. */
int clock_gettime(clockid_t clock, struct timespec *time)
{
    struct stat slept;
    long failed = syscall(SYS_clock_gettime, clock, time);
    if (!failed && (clock == CLOCK_BOOTTIME || clock == CLOCK_REALTIME)
        && stat(getenv("SLEPT"), &slept) == 0)
        time->tv_sec += slept.st_size;
    return failed;
}
"""
UNITS, CHARGE_S = 3, 3.0
#: Nobody is asleep for so short a time, and in the simulated kernel for whole seconds only.
NAPS_S = (1, 10, 3600, 8 * 3600)
STOPPED_S = 0.2
PATIENCE_S = 120.0


@dataclass(frozen=True)
class Charge:
    """Lamp on, a wait, lamp off."""

    name: str

    def run(self, session: Session) -> None:
        session.perform(LAMP_ON)
        session.wait(CHARGE_S, "charging")
        session.perform(LAMP_OFF)


class Charges(ProtocolModel):
    """Some charges."""

    def units(self) -> Sequence[Unit]:
        return [Charge(f"charge-{number}") for number in range(1, UNITS + 1)]


def trial(rng: random.Random, folder: Path, shim: Path) -> tuple[str, bool]:
    """Return the fault, and whether the PC slept while the lamp was on."""
    board, slept = WatchedBoard(), folder / "slept"
    slept.touch()
    with on_a_terminal(board) as address:
        (folder / "rig.yaml").write_text(RIG.format(address=address))
        process = subprocess.Popen(
            [sys.executable, "-m", "tests.acceptance.suspended", "--in", str(folder)],
            env=os.environ | {"LD_PRELOAD": str(shim), "SLEPT": str(slept)},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        while not board.switched and process.poll() is None:
            time.sleep(0.001)
        time.sleep(rng.uniform(0.0, UNITS * CHARGE_S))
        process.send_signal(signal.SIGSTOP)
        asleep_s, was_lit = time.monotonic(), board.lamp_on
        time.sleep(STOPPED_S)
        os.truncate(slept, rng.choice(NAPS_S))
        process.send_signal(signal.SIGCONT)
        _, said = process.communicate(timeout=PATIENCE_S)
    return "; ".join(_wrong(board, process.returncode, said, folder, asleep_s, was_lit)), was_lit


def _wrong(
    board: WatchedBoard, code: int, said: str, folder: Path, asleep_s: float, was_lit: bool
) -> list[str]:
    if code:
        return [f"code {code}: {said[-300:]}"]
    (run,) = (folder / "runs").iterdir()
    attempts = read_run(run).attempts
    redone = [attempt for attempt in attempts if not attempt.completed]
    charges = [(on, off) for (on, lit), (off, _) in pairwise(board.switched) if lit]
    slept_through = [on < asleep_s < off for on, off in charges]
    wrong = {
        "the lamp is on": board.lamp_on,
        "not all units are complete": sum(one.completed for one in attempts) != UNITS,
        "the unit was not done again": was_lit and len(charges) != UNITS + 1,
        "the unit that was slept through counts": was_lit and not (redone and any(slept_through)),
        "not in the journal": was_lit and not any("slept for" in one.reason for one in redone),
        "not said": was_lit and "this PC slept for" not in said,
        "said more than once": said.count("this PC slept for") > 1,
    }
    return [what for what, is_so in wrong.items() if is_so]


def _compiled(folder: Path) -> Path:
    source, shim = folder / "shim.c", folder / "shim.so"
    source.write_text(SHIM)
    subprocess.run(["cc", "-shared", "-fPIC", "-o", shim, source], check=True)
    return shim


def _child(folder: Path) -> None:
    """The run, as `labrig run` does it."""
    path = folder / "rig.yaml"
    rig, protocol = read_rig_file(path), Charges(protocol="charges")
    with (
        open_bench(rig, str(path)) as bench,
        RunFolder.create(folder / "runs", "charges", bench.clock.wall(), {}, 1) as run,
    ):
        execute(run, protocol, bench, plan(protocol, rig, str(path)), partial(progress))


def main() -> None:
    """Count the trials that went wrong and show them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=12)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--in", dest="folder", type=Path, help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.folder:
        _child(asked.folder)
        return
    rng = random.Random(asked.seed)
    wrong, lit = [], 0
    with tempfile.TemporaryDirectory() as name:
        shim = _compiled(Path(name))
        for number in range(asked.trials):
            folder = Path(name) / f"trial-{number}"
            folder.mkdir()
            said, was_lit = trial(rng, folder, shim)
            lit += was_lit
            if said:
                wrong.append(f"trial {number}: {said}")
    print(f"{lit} of {asked.trials} naps with the lamp on")
    print(f"{len(wrong)} of {asked.trials} went wrong", *wrong, sep="\n")


if __name__ == "__main__":
    main()
