"""Runs of protocols on the simulated bench, without a terminal; cut off and resumed."""

import pickle
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any

from filelock import FileLock

from labrig.acquire import PlanClock, RunObserver, read_run_protocol
from labrig.analyse import AnalysisContext, Inputs, Overrides
from labrig.bench import Recording, Watch, resume_run
from labrig.foundation import resources
from labrig.foundation.clock import Clock
from labrig.process import Processed, process_and_report
from labrig.process.provenance import describe_run
from labrig.record import RunRecord, read_run
from labrig.report import Source
from tests.acquire.fakes import Watching
from tests.quick_yaml import read_quickly, write_quickly

#: Where the workers of one run of the tests keep what they recorded; set by `tests.conftest`.
SHARED: Path | None = None


@contextmanager
def quietly(plan_clock: PlanClock, clock: Clock) -> Iterator[RunObserver]:
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

    In one run of the tests what is the same, with the same files beside it, is recorded once and
    copied. A copy's rig file names copies of these files.
    """
    folder.mkdir(parents=True, exist_ok=True)
    is_first = not (folder / "runs").exists()
    if watch is not quietly or SHARED is None or not is_first:
        return _recorded(folder, protocol, rig, watch)
    beside = [path for path in sorted(folder.rglob("*")) if path.is_file()]
    asked = (write_quickly(rig) + write_quickly(protocol)).replace(str(folder), "").encode()
    files = [str(path.relative_to(folder)).encode() + path.read_bytes() for path in beside]
    place = SHARED / sha256(b"\0".join([asked, *files])).hexdigest()
    with FileLock(place.with_suffix(".lock")):
        if not (place / "runs").is_dir():
            shutil.copytree(folder, place, dirs_exist_ok=True)
            try:
                moved = [_moved(each, str(folder), str(place)) for each in (protocol, rig)]
                _recorded(place, moved[0], moved[1], watch)
            except BaseException:
                # What a run that failed has left belongs to its test alone.
                shutil.copytree(place, folder, dirs_exist_ok=True)
                shutil.rmtree(place)
                raise
    (kept,) = (place / "runs").iterdir()
    for name, content in (("rig", rig), ("protocol", protocol)):
        (folder / f"{name}.yaml").write_text(write_quickly(content))
    return Path(shutil.copytree(kept, folder / "runs" / kept.name))


def _recorded(folder: Path, protocol: dict[str, Any], rig: dict[str, Any], watch: Watch) -> Path:
    for name, content in (("rig", rig), ("protocol", protocol)):
        (folder / f"{name}.yaml").write_text(write_quickly(content))
    runs = folder / "runs"
    return Recording.prepare(folder / "protocol.yaml", folder / "rig.yaml", runs).record(watch)


def _moved(value: Any, old: str, new: str) -> Any:
    """`value` with the folder `old` called `new` in all texts."""
    if isinstance(value, str):
        return value.replace(old, new)
    if isinstance(value, dict):
        return {key: _moved(each, old, new) for key, each in value.items()}
    return [_moved(each, old, new) for each in value] if isinstance(value, list | tuple) else value


def processed_once(run: Path) -> Processed:
    """As `process_and_report(run)`; in one run of the tests the copies of a run are processed once.

    Calibrations are not kept beside it.
    """
    if SHARED is None:
        return process_and_report(run)
    own = [path for path in run.iterdir() if path.name != "cache"]
    files = sorted(path for top in own for path in (top, *top.rglob("*")) if path.is_file())
    contents = [str(path.relative_to(run)).encode() + path.read_bytes() for path in files]
    digest = sha256(b"\0".join(contents)).hexdigest()
    place = SHARED / f"{digest}-processed"
    with FileLock(place.with_suffix(".lock")):
        if not place.is_dir():
            done = process_and_report(run)
            shutil.copytree(run / "result", place / "result")
            (place / "done").write_bytes(pickle.dumps(done))
            return done
    shutil.copytree(place / "result", run / "result")
    earlier: Processed = pickle.loads((place / "done").read_bytes())
    return replace(earlier, report=run / "result" / "report.html")


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
