"""Real processes that end in every way there is while the lamp burns: does it go off, and when?

    python -m tests.acceptance.lamp_off_however_it_ends [--trials 10] [--only SIGHUP "kill -9" …]

labrig, a relay board in another process, a terminal between them, the system's clock. Time counts
from what ends labrig to the moment at which the board opens its contact.
"""

import argparse
import os
import random
import select
import signal
import statistics
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from labrig.foundation.signals import STOP_SIGNALS, name_of
from tests.lit_bench import BoardProcess, LitBench, Stubborn, lit_bench

PATIENCE_S = 60.0
#: The system's own killer strikes in a group of processes with less memory than labrig asks for.
CGROUP = Path("/sys/fs/cgroup/memory/labrig-trial")
LITTLE_BYTES, HUNGRY_BYTES = 300_000_000, 1_000_000_000


@dataclass(frozen=True)
class Way:
    """A way to end.

    Attributes
    ----------
    run
        Lights the lamp and ends labrig; how long the lamp burnt on, and what else was wrong.
    within_s
        The lamp has to be off by then.
    board
        Makes the relay board.
    keys
        Of the bench.
    """

    run: Callable[[LitBench, random.Random], tuple[float, str]]
    within_s: float = 2.0
    board: Callable[[], BoardProcess] = BoardProcess
    keys: dict[str, Any] = field(default_factory=dict)


def signalled(
    signum: int, code: int, bench: LitBench, rng: random.Random, prepare: str = ""
) -> tuple[float, str]:
    """A signal from outside, at a moment that nobody chose."""
    process = bench.start()
    if prepare == "plug in again":
        bench.plug_in_again()
    elif prepare == "kill the guard":
        (guard,) = _children(process.pid)
        os.kill(guard, signal.SIGKILL)
        time.sleep(8.0)  # until there is another one, and it is ready
    time.sleep(rng.uniform(0.0, 1.5))
    began_s = time.monotonic()
    process.send_signal(signum)
    took_s = _off_after(bench, began_s)
    said = process.communicate(timeout=PATIENCE_S)[1]
    complaints = [line for line in said.splitlines() if not line.startswith("[")]
    well = process.returncode == code and len(complaints) == (code > 0)
    return took_s, "" if well else f"code {process.returncode}, {complaints}"


def closed_terminal(bench: LitBench, rng: random.Random) -> tuple[float, str]:
    """Its window is closed, or the connection drops."""
    pid, terminal = os.forkpty()
    if pid == 0:
        os.execve(sys.executable, bench.command, bench.environment)
    closing = threading.Event()

    def show() -> None:
        while not closing.is_set():
            if select.select([terminal], [], [], 0.01)[0]:
                os.read(terminal, 4096)
        os.close(terminal)

    shown = threading.Thread(target=show)
    shown.start()
    lit = bench.board.wait_for(True, PATIENCE_S)
    time.sleep(rng.uniform(0.0, 1.5))
    began_s = time.monotonic()
    closing.set()
    shown.join()
    took_s = _off_after(bench, began_s)
    code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
    well = lit is not None and code == 128 + signal.SIGHUP
    return took_s, "" if well else f"code {code}"


def ctrl_z(bench: LitBench, rng: random.Random) -> tuple[float, str]:
    """Stopped, then the unit is done again, then ended."""
    process = bench.start()
    time.sleep(rng.uniform(0.0, 1.5))
    began_s = time.monotonic()
    process.send_signal(signal.SIGTSTP)
    took_s = _off_after(bench, began_s)
    os.waitid(os.P_PID, process.pid, os.WSTOPPED | os.WNOWAIT)
    time.sleep(rng.uniform(0.0, 3.0))
    process.send_signal(signal.SIGCONT)
    lit = bench.board.wait_for(True, PATIENCE_S)
    process.terminate()
    off = bench.board.wait_for(False, PATIENCE_S)
    said = process.communicate(timeout=PATIENCE_S)[1]
    well = lit and off and process.returncode == 143 and "the unit hold is done again" in said
    return took_s, "" if well else f"code {process.returncode}, {said}"


def out_of_memory(bench: LitBench, rng: random.Random) -> tuple[float, str]:
    """The system's own killer; time counts from its strike."""
    CGROUP.mkdir(exist_ok=True)
    try:
        (CGROUP / "memory.limit_in_bytes").write_text(str(LITTLE_BYTES))
        process = bench.start()
        (CGROUP / "cgroup.procs").write_text(str(process.pid))
        process.wait(PATIENCE_S)
        took_s = _off_after(bench, time.monotonic())
        process.communicate()
        return took_s, "" if process.returncode == -9 else f"code {process.returncode}"
    finally:
        CGROUP.rmdir()


def _off_after(bench: LitBench, began_s: float) -> float:
    off_s = bench.board.wait_for(False, PATIENCE_S)
    return float("inf") if off_s is None else off_s - began_s


def _children(pid: int) -> list[int]:
    return [
        int(n) for n in Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="utf-8").split()
    ]


def _killed(**keys: Any) -> Callable[[LitBench, random.Random], tuple[float, str]]:
    return partial(signalled, signal.SIGKILL, -signal.SIGKILL, **keys)


def _stubborn(answers: str, for_s: float) -> Callable[[], BoardProcess]:
    return lambda: BoardProcess(stubborn=lambda board: Stubborn(board, for_s, answers))


_TERMINATED = partial(signalled, signal.SIGTERM, 143)
WAYS = {
    **{
        name_of(signum): Way(partial(signalled, signum, 128 + signum))
        for signum in STOP_SIGNALS
        if signum <= signal.SIGRTMIN
    },
    "closed terminal": Way(closed_terminal),
    "Ctrl-Z": Way(ctrl_z),
    "kill -9": Way(_killed()),
    "SIGSEGV": Way(partial(signalled, signal.SIGSEGV, -signal.SIGSEGV)),
    "out of memory": Way(out_of_memory, keys={"eats_bytes": HUNGRY_BYTES}),
    "SIGSTOP": Way(partial(signalled, signal.SIGSTOP, -signal.SIGKILL), within_s=35.0),
    "kill -9, its guard before it": Way(_killed(prepare="kill the guard")),
    "board 60 ms late, SIGTERM": Way(_TERMINATED, board=lambda: BoardProcess(late_s=0.06)),
    "board 60 ms late, kill -9": Way(_killed(), board=lambda: BoardProcess(late_s=0.06)),
    "board says ? for 2.5 s, SIGTERM": Way(_TERMINATED, 6.0, _stubborn("?", 2.5)),
    "board says ? for 2.5 s, kill -9": Way(_killed(), 6.0, _stubborn("?", 2.5)),
    "board reads on for 3 s, SIGTERM": Way(_TERMINATED, 7.0, _stubborn("on", 3.0)),
    "board reads on for 3 s, kill -9": Way(_killed(), 7.0, _stubborn("on", 3.0)),
    "board silent for 20 s, SIGTERM": Way(_TERMINATED, 25.0, _stubborn("", 20.0)),
    "board adds ! for 5 s, SIGTERM": Way(_TERMINATED, 9.0, _stubborn("!", 5.0)),
    "board renamed, kill -9": Way(
        _killed(prepare="plug in again"), keys={"driver": "listed_relay"}
    ),
    "board renamed, SIGTERM": Way(
        partial(signalled, signal.SIGTERM, 3, prepare="plug in again"),
        keys={"driver": "listed_relay"},
    ),
}


def main() -> None:
    """Print a line for each way."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=10)
    parser.add_argument("--only", nargs="+", choices=WAYS, default=list(WAYS))
    arguments = parser.parse_args()
    rng, wrong = random.Random(1), []
    print(f"{'ended by':34}{'trials':>7}{'off after / s':>15}{'at most':>9}{'wrong':>7}")
    for name in arguments.only:
        way = WAYS[name]
        times_s, told = [], []
        for _ in range(arguments.trials):
            with (
                tempfile.TemporaryDirectory() as folder,
                lit_bench(Path(folder), way.board(), **way.keys) as bench,
            ):
                took_s, said = way.run(bench, rng)
            times_s.append(took_s)
            if said or took_s > way.within_s:
                told.append(f"{name}: off after {took_s:.2f} s; {said}")
        print(
            f"{name:34}{len(times_s):7}{statistics.median(times_s):15.2f}{max(times_s):9.2f}"
            f"{len(told):7}",
            flush=True,
        )
        wrong += told
    print(f"{len(wrong)} of {len(arguments.only) * arguments.trials} went wrong", *wrong, sep="\n")
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
