"""Real processes, stopped by real signals at moments that nobody chose: exit code, line, time.

    python -m tests.acceptance.signals_at_any_moment [--trials 50]

Half of the trials count the time from the start of the process, half from a frame on, since a
start-up on a busy machine would eat most of the first kind.
"""

import argparse
import random
import signal
import subprocess
import sys
import tempfile
import time

SIGNALS = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGUSR1]
#: A process that ends well so soon after a signal had come to its end before.
AT_ITS_END_S = 0.5


def trial(rng: random.Random, runs: str) -> tuple[str, float]:
    """Start a run, stop it; what was wrong, or nothing, and how long the end took in seconds."""
    process = subprocess.Popen(
        [sys.executable, "-m", "labrig", "run", "decay", "--rig", "sim", "--runs", runs],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stderr is not None
    said = ""
    if rng.random() < 0.5:
        time.sleep(rng.uniform(0.4, 12.0))
    else:
        frame = rng.randint(1, 56)
        for line in process.stderr:
            said += line
            if f"frame {frame} of" in line:
                break
    signum, times = rng.choice(SIGNALS), rng.choice([1, 10])
    began_s = time.monotonic()
    for _ in range(times):
        process.send_signal(signum)
        time.sleep(rng.choice([0.0002, 0.002, 0.02]))
    out, rest = process.communicate(timeout=120)
    took_s = time.monotonic() - began_s
    complaints = [line for line in (said + rest).splitlines() if not line.startswith("[")]
    soon = time.monotonic() - began_s < times * 0.02 + AT_ITS_END_S
    ended_before = process.returncode == 0 and not complaints and soon
    stopped = process.returncode == 128 + signum and len(complaints) == 1
    if ended_before or stopped:
        return "", took_s
    wrong = f"{signum.name} x{times}: code {process.returncode}, {complaints}, {out[-200:]!r}"
    return wrong, took_s


def main() -> None:
    """Count the trials that went wrong and show them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=50)
    trials = parser.parse_args().trials
    rng = random.Random(1)
    with tempfile.TemporaryDirectory() as runs:
        ends = [trial(rng, runs) for _ in range(trials)]
    wrong = [said for said, _ in ends if said]
    longest_s = max(took_s for _, took_s in ends)
    print(f"{len(wrong)} of {trials} went wrong; the longest end took {longest_s:.1f} s")
    print(*wrong, sep="\n")


if __name__ == "__main__":
    main()
