"""Time from the last frame of a run to its result, and what reducing ahead costs the shots.

    python -m tests.acceptance.reduced_ahead [--pace 3] [--rounds 1] [--kills 6] [--seed 1]

The shipped decay, recorded in the simulated room by a camera of 21 megapixels, is recorded anew
from its frames, one each `--pace` seconds by the clock of this PC, with a process that reduces
ahead and without. Printed are the time from the last line of the journal to the result, and at
99 % of the frames how late one begins and how long it takes to be kept. Then the process that
reduces ahead is killed by SIGKILL at a random moment, with small frames. Wanted: the same result
each time, byte for byte. Needs Linux, 5 GB of disk and 10 minutes.
"""

import argparse
import os
import random
import shutil
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from labrig.foundation.output_file import write_durably
from labrig.process import process_run, reduced_ahead
from labrig.record import RunSize
from labrig.reduce import WORTHWHILE_BYTES
from tests.analyse.recorded import recorded, shipped_rig
from tests.lit_bench import started_with
from tests.quick_yaml import read_quickly
from tests.replayed import Replay

RESULT = "result/result.json"
LARGE = RunSize(1, WORTHWHILE_BYTES, 0)
DECAY = read_quickly(Path("protocols/decay/decay.yaml").read_text(encoding="utf-8"))


def replayed(run: Path, folder: Path, pace_s: float, *, ahead: bool) -> tuple[Path, list[float]]:
    """Record a run anew; return its folder and, in ms, how late frames began and were kept."""
    due_s = time.monotonic()
    times_ms: list[float] = []

    def write(path: Path, content: bytes) -> None:
        nonlocal due_s
        due_s += pace_s
        time.sleep(max(due_s - time.monotonic(), 0.0))
        began_s = time.monotonic()
        write_durably(path, content)
        times_ms.extend((1000 * (began_s - due_s), 1000 * (time.monotonic() - began_s)))

    replay = Replay(run, folder / run.name, write)
    with reduced_ahead(wanted=ahead) as begun:
        begun(replay.folder, LARGE)
        replay.go_on()
    return replay.folder, times_ms


@contextmanager
def killed(folder: Path, after_s: float) -> Iterator[None]:
    """Kill the process that reduces the frames of runs in a folder ahead, some time from now."""

    def kill() -> None:
        for process in started_with(b"labrig.process.ahead_process", bytes(folder)):
            os.kill(int(process.name), signal.SIGKILL)

    timer = threading.Timer(after_s, kill)
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        timer.join()


def main() -> None:
    """Print the times, and how many results differ."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pace", type=float, default=3.0)
    parser.add_argument("--rounds", type=int, default=1)
    parser.add_argument("--kills", type=int, default=6)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    differing = 0
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        run = recorded(folder / "large", DECAY, shipped_rig("sim", 5616, 3744))
        frames = sorted((run / "frames").iterdir())
        size_mb = sum(path.stat().st_size for path in frames) / 1e6
        print(f"{len(frames)} frames of {size_mb / len(frames):.0f} MB, one each {options.pace} s")
        results = []
        for number in range(options.rounds):
            for ahead in (False, True):
                again, times_ms = replayed(
                    run, folder / f"{number}-{ahead}", options.pace, ahead=ahead
                )
                began_s = time.monotonic()
                process_run(again)
                taken_s = time.monotonic() - began_s
                results.append((again / RESULT).read_bytes())
                shutil.rmtree(again)
                late_ms, kept_ms = np.quantile(np.reshape(times_ms, (-1, 2)), 0.99, axis=0)
                print(
                    f"reduced ahead: {'yes' if ahead else 'no':3}  result after {taken_s:.1f} s; "
                    f"at 99 %: {late_ms:.1f} ms late, kept in {kept_ms:.0f} ms"
                )
        differing += sum(result != results[0] for result in results)
        shutil.rmtree(folder / "large")

        small = recorded(folder / "small", DECAY, shipped_rig("sim", 702, 468))
        process_run(small)
        draw = random.Random(options.seed)
        for number in range(options.kills):
            place = folder / f"kill-{number}"
            with killed(place, draw.uniform(0.0, 20.0)):
                again, _ = replayed(small, place, 0.35, ahead=True)
            process_run(again)
            differing += (again / RESULT).read_bytes() != (small / RESULT).read_bytes()
            shutil.rmtree(place)
    print(f"{options.kills} kills; results that differ: {differing}")
    sys.exit(bool(differing))


if __name__ == "__main__":
    main()
