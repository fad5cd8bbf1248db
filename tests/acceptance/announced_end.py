"""Runs cut off at random moments and resumed: the announced end against the true one.

    python -m tests.acceptance.announced_end [PROTOCOL ...] [--cuts 200] [--seed 1]
        [--choices planned|made]

Each protocol, shortened, runs in the simulated room once. Its journal is cut at random moments of
lab time, the line in hand torn, as `kill -9` cuts it, and the run is resumed. At every unit, step
and wait of the resumed run the clock of the plan announces when the last unit ends, and when the
next step by hand is due; both are compared with what happened. A choice that depends on frames not
yet taken is planned with its longest outcome. With `--choices planned` choices have this outcome;
with `made` they follow the frames, so that the end comes earlier than announced, and never later.
"""

import argparse
import random
import shutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from labrig.acquire import ManualStep, PlanClock, RunObserver, runner
from labrig.bench import Recording, Watch, resume_run
from labrig.foundation.clock import Clock
from labrig.foundation.yaml_file import read_yaml, yaml_text
from labrig.record import FrameRecord, read_journal, read_run
from tests.acceptance.short_protocols import SHORTER, Case, with_what_they_need

CHAIN, CHAINED = "chain", ("fade", "saturation", "decay")
PROTOCOLS = (
    *("decay", "saturation", "blank", "isotropy", "camera_calibration", "fade", "luminance"),
    CHAIN,
)
#: Largest difference that is asked for.
LARGEST_S = 2.0
#: Times of a frame of the small sensor, and of other settings, as `labrig rig check` measures them.
CAMERA = {"frame_time": "300 ms", "change_time": "33 ms"}
T = TypeVar("T")


@dataclass
class Listener:
    """Observer that notes what the clock of the plan announces, and does steps by hand on time."""

    plan_clock: PlanClock
    clock: Clock
    ends_s: list[float] = field(default_factory=list)
    hands_s: list[float] = field(default_factory=list)
    late_hands_s: list[float] = field(default_factory=list)

    def unit(self, name: str, number: int, total: int) -> None:
        self._note()

    def frame(self, record: FrameRecord) -> None:
        self._note()

    def doing(self, what: str, until_s: float | None = None) -> None:
        self._note()

    def warn(self, text: str) -> None:
        """Take no note."""

    def ask(self, step: ManualStep, last: str | None, meanwhile: Callable[[], None]) -> str:
        self.late_hands_s += [self.clock.now() - due_s for due_s in self.hands_s]
        self.hands_s.clear()
        self.clock.sleep(step.takes_s)
        return ""

    def late_ends_s(self, run: Path) -> list[float]:
        """Return how much later than announced the last unit of a run ended, at each note."""
        stop_time = read_run(run).attempts[-1].stop_time
        assert stop_time is not None
        return [stop_time - self.clock.wall(0.0) - end_s for end_s in self.ends_s]

    def _note(self) -> None:
        now_s = self.clock.now()
        self.ends_s.append(now_s + self.plan_clock.left_s(now_s))
        if due := self.plan_clock.next_by_hand(now_s):
            self.hands_s.append(now_s + due.in_s)


def listening(listeners: list[Listener]) -> Watch:
    """Return a watch that appends its observers to a list."""

    @contextmanager
    def watch(plan_clock: PlanClock, clock: Clock) -> Iterator[RunObserver]:
        listeners.append(Listener(plan_clock, clock))
        yield listeners[-1]

    return watch


def cut(run: Path, copy: Path, rng: random.Random) -> Path:
    """Copy a run up to a random moment of its lab time."""
    journal = run / "journal.jsonl"
    lines = journal.read_bytes().splitlines(keepends=True)
    times = [float(doc.get("time", 0.0)) for _, doc in read_journal(journal).documents]
    moment = rng.uniform(times[0], times[-1])
    n_kept = max(n for n, time in enumerate(times, start=1) if time <= moment)
    kept = b"".join(lines[:n_kept])
    torn = lines[n_kept][: rng.randrange(len(lines[n_kept]))] if n_kept < len(lines) else b""
    shutil.copytree(run, copy, ignore=shutil.ignore_patterns("result*", "cache"))
    (copy / "journal.jsonl").write_bytes(kept + torn)
    for frame in (copy / "frames").iterdir():
        if frame.name.encode() not in kept:
            frame.unlink()
    return copy


def recorded(place: Path, name: str, done: dict[str, Path]) -> Path:
    """Record a short run of a protocol, and return its folder."""
    case = Case.write(place / name, "phosphor" if name == CHAIN else name, done)
    protocol, rig = read_yaml(case.protocol), read_yaml(case.rig)
    if name == CHAIN:
        protocol["parts"] = [{"protocol": each} | SHORTER[each] for each in CHAINED]
    rig["devices"]["camera"] |= CAMERA
    case.protocol.write_text(yaml_text(protocol), encoding="utf-8")
    case.rig.write_text(yaml_text(rig), encoding="utf-8")
    recording = Recording.prepare(case.protocol, case.rig, case.folder / "runs")
    return recording.record(listening([]))


def as_planned(self: Any, name: str, on_bench: Callable[[], T], when_planned: T) -> T:
    """Make a choice with its longest outcome, as a plan does."""
    return when_planned


def main() -> None:
    """Print a line for each protocol."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("protocols", nargs="*", metavar="PROTOCOL", default=list(PROTOCOLS))
    parser.add_argument("--cuts", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--choices", choices=("planned", "made"), default="planned")
    asked = parser.parse_args()
    if asked.choices == "planned":
        runner._Recorder.decide = as_planned  # type: ignore[method-assign]
    rng = random.Random(asked.seed)
    names = [name for name in asked.protocols if name != CHAIN]
    names = [*with_what_they_need(names), *(CHAIN for _ in range(CHAIN in asked.protocols))]
    print(
        f"choices as {asked.choices}; late by, in seconds, and how many by less than {LARGEST_S}:"
    )
    print(f"{'protocol':19}{'cuts':>5}  {'end, at resume':33}{'end, at any step':37}step by hand")
    sums: list[list[float]] = [[], [], []]
    with tempfile.TemporaryDirectory() as scratch:
        place, done = Path(scratch), dict[str, Path]()
        for name in names:
            done[name] = recorded(place, name, done)
            if name not in asked.protocols:
                continue
            late: list[list[float]] = [[], [], []]
            n_cuts = asked.cuts // len(asked.protocols)
            for number in range(n_cuts):
                run, listeners = cut(done[name], place / f"{name}-{number}", rng), list[Listener]()
                resume_run(run, listening(listeners))
                ends_s = listeners[0].late_ends_s(run)
                for kind, values in enumerate((ends_s[:1], ends_s, listeners[0].late_hands_s)):
                    late[kind] += values
                    sums[kind] += values
                shutil.rmtree(run)
            print(_row(name, n_cuts, late), flush=True)
    print(_row("all", asked.cuts // len(asked.protocols) * len(asked.protocols), sums))


def _row(name: str, n_cuts: int, late: Sequence[Sequence[float]]) -> str:
    cells = [
        f"{min(each):+.1f} to {max(each):+.1f}, {_near(each)} of {len(each)}" if each else "none"
        for each in late
    ]
    return f"{name:19}{n_cuts:5}  {cells[0]:33}{cells[1]:37}{cells[2]}"


def _near(late_s: Sequence[float]) -> int:
    return sum(abs(each_s) < LARGEST_S for each_s in late_s)


if __name__ == "__main__":
    main()
