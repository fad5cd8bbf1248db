"""Faults of every kind at moments that nobody chose, and people who stop the run on top of it.

    python -m tests.acceptance.faults_at_any_moment [--trials 300] [--seed 1]

Each trial is a process of its own: `labrig run` on a simulated bench with one fault or two, perhaps
hit by SIGINT, SIGTERM or SIGKILL. What it leaves is resumed, at last without the faults.
"""

import argparse
import contextlib
import io
import json
import os
import random
import signal
import sys
import tempfile
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from typing import Any

import event_model
import yaml

from labrig.bench import Bench, Recording, open_bench, recording
from labrig.cli import app as _preloaded  # noqa: F401
from labrig.cli.exit_codes import guarded
from labrig.cli.progress import progress
from labrig.foundation import resources
from labrig.foundation.clock import VirtualClock
from labrig.record import read_run
from labrig.record.journal import read_journal

#: How a run may end with each fault, apart from well.
CODES: dict[str, set[int]] = {
    "none": set(),
    "lamp_dead": {3},
    "relay_dead": {3},
    "relay_welded": {3},
    "relays_unplugged": {3},
    "relays_silent": {3},
    "relays_echo_lost": {3},
    "camera_unplugged": {3},
    "camera_busy": {3},
    "camera_full": {3},
    "light_left_on": {3, 4},
    "disk_full": {5},
    "disk_slow": set(),
    "clock_ahead": set(),
    "clock_back": set(),
    "pc_asleep": set(),
}
STOPS = {signal.SIGINT: 130, signal.SIGTERM: 143, signal.SIGKILL: -signal.SIGKILL}
#: While these last, the lamp cannot be switched off; a person is told to.
OUT_OF_REACH = {"relays_unplugged", "relays_silent", "relays_echo_lost"}

PROTOCOLS: tuple[dict[str, Any], ...] = (
    {"exposure": "1/4 s", "repeats": 2},
    {"exposure": "auto", "daylight": True},
    {"exposure": "1/4 s", "dark": "background", "background": [0.0, 0.0, 1.0, 0.08]},
)
COMMON = {"protocol": "decay", "sample": {"name": "test"}, "charge": "30 s", "for": "20 s"}


@dataclass(frozen=True)
class Stop:
    """A signal, when the rig's clock is asked for the `call`-th time."""

    signum: signal.Signals
    call: int


@dataclass(frozen=True)
class Ending:
    """End of a process; `calls` counts its questions to the rig's clock."""

    code: int
    complaints: list[str]
    lamp_on: bool
    calls: int


@dataclass
class Tally:
    """All trials with one fault."""

    trials: int = 0
    codes: Counter[int] = field(default_factory=Counter)
    resumes: int = 0
    redone: int = 0
    wrong: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Scene:
    """A protocol on the bench: its files, how long it takes, how often its clock is asked."""

    protocol: Path
    rig: dict[str, Any]
    units: tuple[str, ...]
    moments_s: tuple[float, ...]
    calls: int


def campaign(trials: int, seed: int) -> dict[str, Tally]:
    """So many trials; the same seed makes the same ones."""
    tallies: dict[str, Tally] = defaultdict(Tally)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        scenes = [_scene(folder / str(number), keys) for number, keys in enumerate(PROTOCOLS)]
        for number in range(trials):
            rng = random.Random(f"{seed} {number}")
            fault = list(CODES)[number % len(CODES)]
            _try(rng, fault, rng.choice(scenes), folder / f"trial-{number}", tallies[fault])
    return tallies


def main() -> None:
    """Print a table: what happened, by fault."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    tallies = campaign(arguments.trials, arguments.seed)
    print(f"{'fault':18}{'trials':>7}{'resumes':>9}{'redone':>8}{'wrong':>7}  exit codes")
    for fault, tally in tallies.items():
        codes = ", ".join(f"{code}: {count}" for code, count in sorted(tally.codes.items()))
        print(
            f"{fault:18}{tally.trials:7}{tally.resumes:9}{tally.redone:8}{len(tally.wrong):7}  "
            f"{codes}"
        )
    wrong = [f"{fault}: {said}" for fault, tally in tallies.items() for said in tally.wrong]
    print(f"{len(wrong)} of {arguments.trials} went wrong", *wrong, sep="\n")
    sys.exit(bool(wrong))


def _try(rng: random.Random, fault: str, scene: Scene, folder: Path, tally: Tally) -> None:
    """One run with a fault, resumed until it is complete; what is wrong goes into `tally`."""
    folder.mkdir()
    faults = [fault, *rng.sample([other for other in CODES if other != fault], rng.randint(0, 1))]
    items = [_fault(rng, name, scene) for name in faults if name != "none"]
    stop = _stop(rng, scene)
    rig = scene.rig | {"simulation": scene.rig["simulation"] | {"faults": items}}
    (folder / "rig.yaml").write_text(yaml.safe_dump(rig))
    tally.trials += 1
    told = f"{folder.name} {scene.protocol.parent.name} {items} {stop}"

    def require(right: bool, what: str) -> None:
        if not right:
            tally.wrong.append(f"{told}: {what}")

    ending = _child(
        ["run", scene.protocol, "--rig", folder / "rig.yaml", "--runs", folder / "runs"],
        folder,
        stop,
    )
    tally.codes[ending.code] += 1
    _judge(ending, faults, stop, require)
    runs = list((folder / "runs").glob("*")) if (folder / "runs").exists() else []
    if not runs:
        return  # nothing was recorded, nothing is to be resumed
    (run,) = runs
    for left in (items, []):
        kept = _completed(run)
        if list(kept) == list(scene.units):
            break
        simulation = rig["simulation"] | {
            "faults": left,
            "initial": {"lamp": "on" if ending.lamp_on else "off"},
        }
        (run / "rig.yaml").write_text(yaml.safe_dump(rig | {"simulation": simulation}))
        ending = _child(["resume", run, "--edited"], folder)
        tally.resumes += 1
        _judge(ending, faults if left else [], None, require)
        require(kept.items() <= _completed(run).items(), "a complete unit was not kept")
    require(list(_completed(run)) == list(scene.units), f"not complete: {ending.complaints}")
    tally.redone += len(read_run(run).attempts) - len(_completed(run))
    for complaint in _damage(run):
        require(False, complaint)


def _judge(ending: Ending, faults: list[str], stop: Stop | None, require: Any) -> None:
    """Exit code, one line, lamp off."""
    allowed = {0}.union(*(CODES[fault] for fault in faults))
    if stop is not None:
        allowed.add(STOPS[stop.signum])
    require(ending.code in allowed, f"exit code {ending.code}: {ending.complaints}")
    if ending.code < 0:
        return
    require(len(ending.complaints) == (ending.code != 0), f"said {ending.complaints}")
    said = " ".join(ending.complaints)
    require("Traceback" not in said and "fault in labrig" not in said, said)
    if not ending.lamp_on:
        return
    told = ("switch off by hand", "pull its plug", "cannot open the serial port")
    manual_steps = any(text in said for text in told)
    # That a relay is welded is only seen once a unit has been photographed to its end.
    cut_short = ending.code in (130, 143) or (ending.code != 0 and len(faults) > 1)
    unseen = "relay_welded" in faults and cut_short
    out_of_reach = (
        not {*OUT_OF_REACH, "relay_welded"}.isdisjoint(faults) and ending.code == 3 and manual_steps
    )
    require(unseen or out_of_reach, f"the lamp is on; code {ending.code}, {said}")


def _completed(run: Path) -> dict[str, str]:
    """Unit → uid of the attempt that counts."""
    if not (run / "journal.jsonl").exists():
        return {}
    return {unit: attempt.uid for unit, attempt in read_run(run).completed().items()}


def _damage(run: Path) -> Iterator[str]:
    """Return the faults of the journal and of the frames that it acknowledges."""
    documents = read_journal(run / "journal.jsonl").documents
    uids = [doc["uid"] for _, doc in documents]
    if len(set(uids)) < len(uids):
        yield "a uid stands twice in the journal"
    for name, doc in documents:
        event_model.schema_validators[event_model.DocumentNames[name]].validate(doc)
    for attempt in read_run(run).attempts:
        for frame in attempt.frames:
            if not frame.path.exists():
                yield f"{frame.path} is missing"
            elif sha256(frame.path.read_bytes()).hexdigest() != frame.sha256:
                yield f"{frame.path} is not what was recorded"


def _fault(rng: random.Random, fault: str, scene: Scene) -> dict[str, Any]:
    """The fault near some step of the plan, or anywhere; for a while, or for good."""
    near_s = rng.choice(scene.moments_s) + rng.uniform(-1.0, 3.0)
    anywhere_s = rng.uniform(0.0, scene.moments_s[-1])
    when = {"at": f"{max(rng.choice([near_s, anywhere_s]), 0.0):.4f} s"}
    if fault in ("camera_unplugged", "disk_full") and rng.random() < 0.5:
        when = {"after_bytes": rng.randint(1000, 600_000)}  # type: ignore[dict-item]
    if rng.random() < 0.75:
        when["for"] = f"{10 ** rng.uniform(-1.3, 2.3):.4f} s"
    return {fault: when}


def _stop(rng: random.Random, scene: Scene) -> Stop | None:
    signum = rng.choice([None, None, *STOPS])
    return None if signum is None else Stop(signum, rng.randint(1, scene.calls))


def _scene(folder: Path, keys: dict[str, Any]) -> Scene:
    folder.mkdir()
    protocol = folder / "protocol.yaml"
    protocol.write_text(yaml.safe_dump(COMMON | keys))
    rig = yaml.safe_load((resources.folder("config") / "sim.yaml").read_text())
    rig["devices"]["lamp"]["warm_up"] = "20 s"
    rig["devices"]["camera"]["warm_up"] = "10 s"
    rig["simulation"] |= {
        "sensor": {"width": 96, "height": 64},
        "epoch": "2026-01-01T00:00:00Z",
        "initial": {"lamp": "off"},
    }
    path = folder / "rig.yaml"
    path.write_text(yaml.safe_dump(rig))
    recording = Recording.prepare(protocol, path, folder / "runs")
    with contextlib.redirect_stderr(io.StringIO()):
        recording.record(progress)  # all is imported now: a forked process begins at once
    calls = _child(["run", protocol, "--rig", path, "--runs", folder / "runs"], folder).calls
    plan = recording.plan
    return Scene(protocol, rig, plan.units, tuple(step.at_s for step in plan.steps), calls)


def _child(arguments: list[object], folder: Path, stop: Stop | None = None) -> Ending:
    """`labrig ARGUMENTS` in a process of its own."""
    said, report = folder / "stderr.txt", folder / "report.json"
    report.unlink(missing_ok=True)
    pid = os.fork()
    if pid == 0:
        with said.open("wb") as err, Path(os.devnull).open("wb") as out:
            os.dup2(err.fileno(), 2)
            os.dup2(out.fileno(), 1)
            code = 70
            try:
                code = _run([*map(str, arguments), "--no-process"], report, stop)
            finally:
                os._exit(code)
    _, status = os.waitpid(pid, 0)
    lines = said.read_text().splitlines()
    return Ending(
        os.waitstatus_to_exitcode(status),
        [line for line in lines if not line.startswith(("[", "note: "))],
        **json.loads(report.read_text()),
    )


def _run(arguments: list[str], report: Path, stop: Stop | None) -> int:
    """Run the command in the child, watched by a remembered room and a counting clock."""
    stands: list[Bench] = []
    now, calls = VirtualClock.now, 0

    def tell() -> None:
        rooms = [stand.room.room for stand in stands if stand.room is not None]
        lamp_on = any(room.lamp_on for room in rooms)
        report.write_text(json.dumps({"lamp_on": lamp_on, "calls": calls}), encoding="utf-8")

    def counted(clock: VirtualClock) -> float:
        nonlocal calls
        if stands and clock is stands[0].clock:
            calls += 1
            if stop is not None and calls == stop.call:
                tell()
                os.kill(os.getpid(), stop.signum)
        return now(clock)

    @contextlib.contextmanager
    def remembered(*arguments: Any, **keys: Any) -> Iterator[Bench]:
        with open_bench(*arguments, **keys) as stand:
            stands.append(stand)
            yield stand

    recording.open_bench = remembered  # type: ignore[attr-defined]
    VirtualClock.now = counted  # type: ignore[method-assign, assignment]
    code = guarded(arguments)
    tell()
    return code


if __name__ == "__main__":
    main()
