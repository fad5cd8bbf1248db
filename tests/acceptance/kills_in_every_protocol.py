"""kill -9 anywhere in a run of every protocol, resumed until complete, against a run in peace.

    python -m tests.acceptance.kills_in_every_protocol [PROTOCOL ...] [--kills 3] [--seed 1]
        [--rounds 1] [--keep DIR]

Each protocol, shortened, runs once undisturbed; then again in processes that are killed: at some
size of the journal and a moment more, in the middle of writing a frame or a line, or while the
result is worked out. What is left is resumed at once, lamp, door and filters as they were and the
sample aglow, or the next morning. At the end: exit code, one line or none, every unit complete and
once, frames as recorded, a bench that is safe and put back, the same files of results. How far the
figures in them are from those of the undisturbed run, in σ of the difference, at most; and how far
those of another undisturbed run are, in other noise.
"""

import argparse
import random
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from hashlib import sha256
from itertools import pairwise
from pathlib import Path
from typing import Any, Self

from labrig.foundation.yaml_file import read_yaml, yaml_text
from labrig.record import read_run
from tests.acceptance.figures_of_results import figures, furthest_in_sigma
from tests.acceptance.labrig_process import Labrig
from tests.acceptance.short_protocols import SHORTER, Case, with_what_they_need

#: Of a sample that is found aglow: as after a full charge and some minutes in the dark.
AGLOW = 0.02
NIGHT_S = 8 * 3600.0
#: Outside, at a size of the journal; inside, in the middle of a write; while results are made.
KINDS = ("outside", "writing", "result")
#: Fractions of work beyond this may be over before anybody kills.
MOST = 0.9
#: At most so long after the journal has that size: a frame takes about as long.
LATER_S = 0.1
#: Folder of a result's figures.
FIGURES = "figures/"
#: More than noise does among some hundred figures, where σ are right; else, so many times as much
#: as it does.
FAR, FARTHER = 5.0, 1.5


@dataclass(frozen=True)
class Undisturbed:
    """The run that nobody killed, how long it took and how it left the bench."""

    folder: Path
    units: list[str]
    journal_bytes: int
    written_bytes: int
    recording_s: float
    processing_s: float
    bench: dict[str, Any]

    def furthest(self, result: Path) -> tuple[int, float, str]:
        """Return the number of figures in a result, the largest difference in σ, and its name."""
        return furthest_in_sigma(figures(self.folder / "result"), figures(result))

    @classmethod
    def of(cls, case: Case) -> Self:
        """Run it in peace."""
        began = time.monotonic()
        recording = Labrig(case.folder, [*_run(case, case.folder), "--no-process"])
        if recording.code():
            sys.exit(f"{case.protocol}: {recording.complaints}")
        recorded, bench = time.monotonic(), recording.bench
        (run,) = (case.folder / "runs").iterdir()
        processing = Labrig(case.folder, ["process", run])
        if processing.code():
            sys.exit(f"{case.protocol}: {processing.complaints}")
        frames = sum(path.stat().st_size for path in (run / "frames").iterdir())
        journal = (run / "journal.jsonl").stat().st_size
        return cls(
            run,
            list(read_run(run).completed()),
            journal,
            journal + frames,
            recorded - began,
            time.monotonic() - recorded,
            bench,
        )


@dataclass
class Tally:
    """All that befell one protocol."""

    kills: Counter[str] = field(default_factory=Counter)
    redone: int = 0
    compared: int = 0
    furthest: float = 0.0
    wrong: list[str] = field(default_factory=list)


@dataclass
class ExerciseContext:
    """One run, killed and resumed until it is complete; what is wrong goes into the tally."""

    case: Case
    peace: Undisturbed
    far: float
    folder: Path
    rng: random.Random
    tally: Tally
    kept: dict[str, str] = field(default_factory=dict)

    def run(self, kills: int) -> None:
        """Kill it so many times, then let it end."""
        self.folder.mkdir()
        fractions = [0.0, *sorted(self.rng.uniform(0.0, MOST) for _ in range(kills))]
        for number, (before, fraction) in enumerate(pairwise(fractions), start=1):
            # Before its result is worked out a run is complete: that is the last to befall it.
            kind = self.rng.choice(KINDS if number == kills else KINDS[:2])
            self._kill(kind, fraction - before)
            self._look_at_what_is_kept()
            if not self._complete and (run := self._recorded) is not None:
                leave_bench(run, morning=self.rng.random() < 0.5)
        was_complete = self._complete
        labrig = Labrig(self.folder, self._arguments())
        code = labrig.code()
        self._require(code == 0, f"exit code {code}")
        self._require(not labrig.complaints, f"{labrig.complaints}")
        self._look_at_what_is_kept()
        if code == 0:
            # A run that was complete had nothing to connect for.
            as_usual = was_complete or labrig.bench == self.peace.bench
            self._require(as_usual, f"the bench was left as {labrig.bench}")
            self._compare()

    def _kill(self, kind: str, fraction: float) -> None:
        """One process, killed when it has done about that fraction of the work."""
        run = self._recorded
        had = 0 if run is None else (run / "journal.jsonl").stat().st_size
        dies_at = int(fraction * self.peace.written_bytes) if kind == "writing" else None
        labrig = Labrig(self.folder, self._arguments(), dies_at)

        def journal_has_grown() -> bool:
            run, more = self._recorded, fraction * self.peace.journal_bytes
            return run is not None and (run / "journal.jsonl").stat().st_size >= had + more

        if kind == "outside" and labrig.runs_until(journal_has_grown):
            time.sleep(self.rng.uniform(0.0, LATER_S))
        elif kind == "result" and labrig.runs_until(lambda: self._complete):
            time.sleep(self.rng.uniform(0.0, MOST) * self.peace.processing_s)
        if kind != "writing":
            labrig.kill()
        code = labrig.code()
        self.tally.kills[kind] += code == -signal.SIGKILL
        self._require(code in (0, -signal.SIGKILL), f"exit code {code} before it was killed")
        self._require(not labrig.complaints, f"{labrig.complaints}")

    def _look_at_what_is_kept(self) -> None:
        now = self._completed
        self._require(self.kept.items() <= now.items(), "a complete unit was not kept")
        self.kept = now

    def _compare(self) -> None:
        """The complete run with the one in peace."""
        run, tally = self._recorded, self.tally
        assert run is not None
        for complaint in damage(run, self.peace):
            self._require(False, complaint)
        tally.redone += sum(not attempt.completed for attempt in read_run(run).attempts)
        tally.compared, furthest, which = self.peace.furthest(run / "result")
        tally.furthest = max(tally.furthest, furthest)
        self._require(furthest < self.far, f"{which} is {furthest:.1f} σ off")

    def _arguments(self) -> list[object]:
        run = self._recorded
        return _run(self.case, self.folder) if run is None else ["resume", run, "--yes", "--edited"]

    @property
    def _recorded(self) -> Path | None:
        """The run folder, if anything can have been recorded in it."""
        found = [path.parent for path in (self.folder / "runs").glob("*/journal.jsonl")]
        return found[0] if found else None

    @property
    def _completed(self) -> dict[str, str]:
        """Unit → uid of the attempt that counts."""
        if self._recorded is None:
            return {}
        return {unit: one.uid for unit, one in read_run(self._recorded).completed().items()}

    @property
    def _complete(self) -> bool:
        """Looked at while the run grows: parsing it every time would slow it down."""
        run = self._recorded
        journal = b"" if run is None else (run / "journal.jsonl").read_bytes()
        return journal.count(b'"exit_status": "success"') == len(self.peace.units)

    def _require(self, right: bool, what: str) -> None:
        if not right:
            self.tally.wrong.append(f"{self.folder}: {what}")


def _run(case: Case, folder: Path) -> list[object]:
    return ["run", case.protocol, "--rig", case.rig, "--runs", folder / "runs", "--yes"]


def leave_bench(run: Path, *, morning: bool) -> None:
    """The next process finds the room as the killed one left it, or as it is in the morning."""
    record = read_run(run)
    actions = [action for attempt in record.attempts for action in attempt.actions]
    last = {action.device: action.action for action in actions}
    rig = read_yaml(run / "rig.yaml")
    rig["simulation"]["initial"] = {
        "lamp": "off" if morning else last.get("lamp", "off"),
        "leds": [] if morning else _lit(rig, last),
        "door": "closed" if morning or last.get("door") != "open" else "open",
        "concentration": 0.0 if morning or "lamp" not in last else AGLOW,
        "manual_steps": [action.task for action in actions if action.task],
    }
    if morning and record.last_time:
        epoch = datetime.fromtimestamp(record.last_time + NIGHT_S, UTC)
        rig["simulation"]["epoch"] = epoch.isoformat()
    (run / "rig.yaml").write_text(yaml_text(rig))


def _lit(rig: dict[str, Any], last: Mapping[str, str]) -> list[int]:
    """Return the output of the LED that was lit last, as `simulation: leds:` counts them."""
    leds = rig["devices"].get("leds", {}).get("channels", {})
    name = last.get("leds", "off").removesuffix(" on")
    if name not in leds:
        return []
    unit = int(str(leds[name].get("address") or rig["devices"]["leds"]["address"])[-1])
    return [4 * (unit - 1) + leds[name]["output"]]


def damage(run: Path, peace: Undisturbed) -> Iterator[str]:
    """Return the faults of a complete run."""
    record = read_run(run)
    success = [attempt.unit for attempt in record.attempts if attempt.completed]
    if success != peace.units:
        yield f"completed {success}"
    if any(attempt.exit_status is None for attempt in record.attempts):
        yield "an attempt is still open"
    for attempt in record.attempts:
        for frame in attempt.frames:
            if not frame.path.is_file():
                yield f"{frame.path} is missing"
            elif sha256(frame.path.read_bytes()).hexdigest() != frame.sha256:
                yield f"{frame.path} is not what was recorded"
    theirs, ours = (_files(one / "result") for one in (peace.folder, run))
    # Of a law that the data of one run support and those of another do not, there is a figure.
    if off := {path for path in theirs ^ ours if FIGURES not in path}:
        yield f"other files of results: {sorted(off)}"
    if len({any(FIGURES in path for path in paths) for paths in (theirs, ours)}) > 1:
        yield "figures in one of the results only"


def _files(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def main() -> None:
    """Print a line for each protocol."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("protocols", nargs="*", metavar="PROTOCOL", default=list(SHORTER))
    parser.add_argument("--kills", type=int, default=3)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--rounds", type=int, default=1)
    parser.add_argument("--keep", type=Path)
    asked = parser.parse_args()
    print(
        f"{'protocol':19}{'units':>6}{'alone':>8}  {'killed in':32}{'redone':>7}{'figures':>9}"
        f"{'furthest':>10}{'by noise':>10}{'wrong':>7}"
    )
    wrong: list[str] = []
    done: dict[str, Path] = {}
    with tempfile.TemporaryDirectory() as scratch:
        place = asked.keep or Path(scratch)
        for name in with_what_they_need(asked.protocols):
            case = Case.write(place / name, name, done)
            peace = Undisturbed.of(case)
            done[name] = peace.folder
            if name not in asked.protocols:
                continue
            other = Undisturbed.of(case.another_day())
            by_noise = peace.furthest(other.folder / "result")[1]
            far, tally = max(FAR, FARTHER * by_noise), Tally()
            for number in range(asked.rounds):
                rng = random.Random(f"{asked.seed} {number} {name}")
                folder = case.folder / f"killed-{number}"
                ExerciseContext(case, peace, far, folder, rng, tally).run(asked.kills)
            kills = ", ".join(f"{kind} {tally.kills[kind]}" for kind in KINDS)
            print(
                f"{name:19}{len(peace.units):6}"
                f"{peace.recording_s + peace.processing_s:6.0f} s  {kills:32}{tally.redone:7}"
                f"{tally.compared:9}{tally.furthest:8.1f} σ{by_noise:8.1f} σ{len(tally.wrong):7}",
                flush=True,
            )
            wrong += tally.wrong
    print(*wrong, sep="\n")
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
