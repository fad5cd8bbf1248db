"""Runs cut off at random moments and resumed: the announced end against the true one.

    python -m tests.acceptance.announced_end [PROTOCOL ...] [--cuts 200] [--seed 1]

Each protocol, shortened, runs in the simulated room once. Its journal is cut at random moments of
lab time, as `kill -9` cuts it, and the run is resumed. At every unit, step and wait of the resumed
run the clock of the plan announces when the run ends, and when the next step by hand is due. Both
are compared with what happened. A choice that depends on frames not yet taken is planned with its
longest outcome, so that the end may come earlier than announced; that it comes later is what would
lead a person into the dark room too early.
"""

import argparse
import random
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

from labrig.acquire import ManualStep, PlanClock, RunObserver
from labrig.acquire.runner import _Recorder
from labrig.bench import Recording, resume_run
from labrig.foundation.clock import Clock
from labrig.foundation.yaml_file import read_yaml, yaml_text
from labrig.record import FrameRecord, read_journal, read_run
from tests.acceptance.short_protocols import SHORTER, Case, with_what_they_need

CHAIN = "chain"
PROTOCOLS = (
    "decay",
    "saturation",
    "blank",
    "isotropy",
    "camera_calibration",
    "fade",
    "luminance",
    CHAIN,
)
T = TypeVar("T")
#: Largest difference that is asked for.
LARGEST_S = 2.0
FRAME_TIME = "300 ms"


@dataclass
class Listener:
    """Observer that notes what the clock of the plan announces."""

    plan_clock: PlanClock
    clock: Clock
    announced_ends_s: list[float] = field(default_factory=list)
    announced_hands_s: list[float] = field(default_factory=list)
    late_hands_s: list[float] = field(default_factory=list)
    ended_s: float = 0.0

    def unit(self, name: str, number: int, total: int) -> None:
        self._note()

    def frame(self, record: FrameRecord) -> None:
        self._note()

    def doing(self, what: str, until_s: float | None = None) -> None:
        self._note()

    def warn(self, text: str) -> None:
        """Take no note."""

    def ask(self, step: ManualStep, last: str | None, meanwhile: Callable[[], None]) -> str:
        now_s = self.clock.now()
        self.late_hands_s += [now_s - due_s for due_s in self.announced_hands_s]
        self.announced_hands_s.clear()
        self.clock.sleep(step.takes_s)
        return ""

    def _note(self) -> None:
        now_s = self.clock.now()
        self.announced_ends_s.append(now_s + self.plan_clock.left_s(now_s))
        if due := self.plan_clock.next_by_hand(now_s):
            self.announced_hands_s.append(now_s + due.in_s)

    @property
    def late_ends_s(self) -> list[float]:
        """How much later than announced the run ended, at each note."""
        return [self.ended_s - announced_s for announced_s in self.announced_ends_s]


def listening(kept: list[Listener]) -> Callable[..., object]:
    """An observer of a run that is kept in a list."""

    @contextmanager
    def watch(plan_clock: PlanClock, clock: Clock) -> Iterator[RunObserver]:
        listener = Listener(plan_clock, clock)
        kept.append(listener)
        yield listener

    return watch


def cut(run: Path, place: Path, rng: random.Random) -> Path:
    """Copy a run up to a random moment of its lab time, the line in hand torn."""
    lines = (run / "journal.jsonl").read_bytes().splitlines(keepends=True)
    times = [
        float(doc["time"])
        for _, doc in read_journal(run / "journal.jsonl").documents
        if "time" in doc
    ]
    moment = rng.uniform(times[0], times[-1])
    kept = sum(time <= moment for time in times)
    copy = place / run.name
    shutil.copytree(run, copy, ignore=shutil.ignore_patterns("result*", "cache"))
    torn = lines[kept][: rng.randrange(len(lines[kept]))] if kept < len(lines) else b""
    (copy / "journal.jsonl").write_bytes(b"".join(lines[:kept]) + torn)
    names = b"".join(lines[:kept])
    for frame in (copy / "frames").iterdir():
        if frame.name.encode() not in names:
            frame.unlink()
    return copy


def main() -> None:
    """Print a line for each protocol."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("protocols", nargs="*", metavar="PROTOCOL", default=list(PROTOCOLS))
    parser.add_argument("--cuts", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--choices", choices=("planned", "made"), default="planned")
    asked = parser.parse_args()
    if asked.choices == "planned":
        _Recorder.decide = _as_planned  # type: ignore[method-assign]
    rng = random.Random(asked.seed)
    print(
        f"{'protocol':20}{'cuts':>6}{'notes':>7}  {'end later than announced at resume':36}{'at any step'}"
    )
    with tempfile.TemporaryDirectory() as scratch:
        place, done = Path(scratch), {}
        named = [name for name in asked.protocols if name != CHAIN]
        for name in [*with_what_they_need(named), *([CHAIN] if CHAIN in asked.protocols else [])]:
            case = Case.write(place / name, "phosphor" if name == CHAIN else name, done)
            if name == CHAIN:
                _shorten(case.protocol)
            _declare(case.rig)
            recording = Recording.prepare(case.protocol, case.rig, case.folder / "runs")
            run = done[name] = recording.record(listening([]))
            if name not in asked.protocols:
                continue
            kept: list[Listener] = []
            for number in range(max(1, asked.cuts // len(asked.protocols))):
                copy = cut(run, place / f"{name}-{number}", rng)
                resume_run(copy, listening(kept))
                stop_time = read_run(copy).attempts[-1].stop_time
                assert stop_time is not None
                kept[-1].ended_s = stop_time - kept[-1].clock.wall(0.0)
                shutil.rmtree(copy)
            at_resume = [one.late_ends_s[0] for one in kept if one.late_ends_s]
            at_any = [late for one in kept for late in one.late_ends_s]
            hands = [late for one in kept for late in one.late_hands_s]
            print(
                f"{name:20}{len(kept):6}{len(at_any):7}  {_range(at_resume):36}{_range(at_any)}  hands {_range(hands)}",
                flush=True,
            )


def _as_planned(self: _Recorder, name: str, on_bench: Callable[[], T], when_planned: T) -> T:
    """A choice with its longest outcome, as a plan has it."""
    return when_planned


def _shorten(protocol: Path) -> None:
    """Make a phosphor of three parts."""
    content = read_yaml(protocol)
    parts = [{"protocol": name} | SHORTER[name] for name in ("fade", "saturation", "decay")]
    protocol.write_text(yaml_text(content | {"parts": parts}))


def _declare(rig: Path) -> None:
    """Declare the time that a frame of the small sensor takes, as `labrig rig check` measures it."""
    content = read_yaml(rig)
    content["devices"]["camera"]["frame_time"] = FRAME_TIME
    rig.write_text(yaml_text(content))


def _range(late_s: list[float]) -> str:
    if not late_s:
        return "none"
    near = sum(abs(late) < LARGEST_S for late in late_s)
    return f"{min(late_s):+.1f} … {max(late_s):+.1f} s, {near}/{len(late_s)} < {LARGEST_S:g} s"


if __name__ == "__main__":
    main()
