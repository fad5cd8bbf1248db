"""Runs of protocols on the simulated bench, without a terminal; cut off and resumed."""

import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from typing import Any

from filelock import FileLock

from labrig.acquire import Plan, RunObserver
from labrig.analyse import AnalysisContext, Inputs, Overrides
from labrig.analyse.overrides import read_run_protocol
from labrig.bench import Recording, Watch, resume_run
from labrig.foundation import resources
from labrig.foundation.clock import Clock
from labrig.process.provenance import describe_run
from labrig.record import RunRecord, read_run
from labrig.report import Source
from tests.acquire.fakes import Watching
from tests.quick_yaml import read_quickly, write_quickly

#: Where the workers of one run of the tests keep what they recorded; set by `tests.conftest`.
SHARED: Path | None = None


@contextmanager
def quietly(plan: Plan, done: Sequence[str], clock: Clock) -> Iterator[RunObserver]:
    yield Watching()


def record(
    folder: Path,
    protocol: dict[str, Any],
    change: Callable[[dict[str, Any]], None] = lambda rig: None,
    watch: Watch = quietly,
) -> Path:
    """The folder of a run of `protocol` on the shipped rig for phosphors, as `change` leaves it."""
    rig = shipped_rig("sim-phosphor")
    rig["devices"]["lamp"]["warm_up"] = "10 min"
    rig["devices"]["camera"]["warm_up"] = "1 min"
    change(rig)
    return recorded(folder, protocol, rig, watch)


def shipped_rig(name: str, width: int = 96, height: int = 64) -> dict[str, Any]:
    """The content of a shipped rig file, its camera's sensor that small."""
    rig: dict[str, Any] = read_quickly((resources.folder("config") / f"{name}.yaml").read_text())
    room = rig["simulation"]
    # PyYAML takes these two for a date and a truth value, as labrig's loader does not.
    room["epoch"] = "2026-01-01T00:00:00Z"
    if "initial" in room:
        room["initial"] = {"lamp": "off"}
    room["sensor"] = {"width": width, "height": height}
    return rig


def recorded(
    folder: Path, protocol: dict[str, Any], rig: dict[str, Any], watch: Watch = quietly
) -> Path:
    """The folder of a run of `protocol` on a rig; both lie in `folder`, as what the rig names may.

    In one run of the tests what is the same, and names no other files, is recorded once and copied.
    """
    folder.mkdir(parents=True, exist_ok=True)
    is_alone = not any(path.is_file() for path in folder.iterdir())
    (folder / "rig.yaml").write_text(write_quickly(rig))
    (folder / "protocol.yaml").write_text(write_quickly(protocol))
    runs = folder / "runs"
    recording = Recording.prepare(folder / "protocol.yaml", folder / "rig.yaml", runs)
    if watch is not quietly or SHARED is None or not is_alone:
        return recording.record(watch)
    asked = (folder / "rig.yaml").read_bytes() + (folder / "protocol.yaml").read_bytes()
    place = SHARED / sha256(asked).hexdigest()
    with FileLock(place.with_suffix(".lock")):
        if not place.is_dir():
            made = recording.record(watch)
            shutil.copytree(made, place / made.name)
            return made
    (kept,) = place.iterdir()
    return Path(shutil.copytree(kept, runs / kept.name))


def cut_off_and_resumed(run: Path, unit: str) -> tuple[RunRecord, RunRecord]:
    """The run as if labrig had been killed within `unit`, and the same after it was resumed."""
    lines = (run / "journal.jsonl").read_text(encoding="utf-8").splitlines(keepends=True)
    opened = next(n for n, line in enumerate(lines) if f'"unit": "{unit}"' in line)
    (run / "journal.jsonl").write_text("".join(lines[: opened + 8]), encoding="utf-8")
    cut = read_run(run)
    kept = {frame.path for attempt in cut.attempts for frame in attempt.frames}
    for path in (run / "frames").iterdir():
        if path not in kept:
            path.unlink()
    resume_run(run, quietly)
    return cut, read_run(run)


def part_of(run: Path, inputs: Inputs | None = None) -> AnalysisContext:
    """A whole run as what an analysis is given; with the calibrations of its rig unless told."""
    overrides = Overrides()
    rig = overrides.bench(run)
    inputs = Inputs.of(rig) if inputs is None else inputs
    return AnalysisContext(read_run(run), read_run_protocol(run), rig, overrides, inputs)


def source_of(context: AnalysisContext) -> Source:
    """What a report needs to show the result of `part`."""
    about = describe_run(context.run, context.protocol, context.rig)
    return Source(context.run, context.protocol, context.rig, about)
