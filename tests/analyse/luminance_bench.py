"""The simulated bench for luminances: runs of the protocol, and the room's own luminances."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from labrig import resources
from labrig.acquire import read_rig_file
from labrig.bench import open_bench
from labrig.protocols.luminance import LuminanceFrames
from labrig.record import PERSON, read_run
from labrig.recording import Recording
from tests.analyse.recorded import quietly
from tests.quick_yaml import read_quickly, write_quickly

FloatArray = NDArray[np.float64]

#: A protocol of some minutes, with a sample that is dim by then.
QUICK: dict[str, Any] = {
    "protocol": "luminance",
    "excitation": {"preset": "own", "time": "5 min"},
    "longest": "10 s",
}


def write_glow(folder: Path, brightness: float) -> Path:
    """Write a material that fades as the shipped power law, that much brighter."""
    content = read_quickly((resources.folder("config/materials") / "power-law.yaml").read_text())
    for state in content["states"]:
        state["reradiation"] = [brightness * value for value in state["reradiation"]]
    path = folder / "glow.yaml"
    path.write_text(write_quickly(content | {"name": "glow"}))
    return path


def write_rig(
    folder: Path,
    reading: dict[str, Any] | None = None,
    optics: dict[str, Any] | None = None,
    **simulation: Any,
) -> Path:
    """The shipped rig for luminances, changed as told."""
    content = read_quickly((resources.folder("config") / "sim-luminance.yaml").read_text())
    # PyYAML takes these two for a date and a truth value, as labrig's loader does not.
    content["simulation"] |= {"epoch": "2026-01-01T00:00:00Z", "initial": {"lamp": "off"}}
    content["simulation"] |= {"sensor": {"width": 64, "height": 48}} | simulation
    content["devices"]["lamp"]["warm_up"] = "10 min"
    content["devices"]["camera"].pop("warm_up")
    content["optics"] |= optics or {}
    content["optics"]["luminance"] |= reading or {}
    path = folder / "rig.yaml"
    path.write_text(write_quickly(content))
    return path


def record(folder: Path, protocol: dict[str, Any], **changed: Any) -> Path:
    """The folder of a run of that protocol on `write_rig`'s rig."""
    path = folder / "protocol.yaml"
    path.write_text(write_quickly({"sample": {"name": "test"}} | protocol))
    return Recording.prepare(path, write_rig(folder, **changed), folder / "runs").record(quietly)


def true_luminance(run: Path) -> Callable[[Sequence[float]], FloatArray]:
    """Luminances in mcd/m² at times after lamp off, by a room in which the same was done.

    Returns a function that gives an array (times, patches) for rising times.
    """
    record = read_run(run)
    actions = [action for attempt in record.completed().values() for action in attempt.actions]
    lamp_on = next(a for a in actions if a.device == "lamp" and a.action == "on").middle_time
    glow = record.frames(LuminanceFrames.GLOW)[0]
    off = max(
        a.middle_time
        for a in actions
        if a.device == "lamp" and a.action == "off" and a.middle_time < glow.start_time
    )
    uncovered = max(a.end_time for a in actions if a.device == PERSON and a.end_time < off)
    rig = read_rig_file(run / "rig.yaml")

    def at(times_s: Sequence[float]) -> FloatArray:
        with open_bench(rig, "rig") as bench:
            assert bench.room is not None
            room, clock = bench.room.room, bench.room.clock
            clock.sleep(lamp_on - clock.wall(clock.now()))
            room.tasks["grey card"]()
            room.switch_lamp(True)
            clock.sleep(uncovered - lamp_on)
            room.tasks["sample"]()
            clock.sleep(off - uncovered)
            room.switch_lamp(False)
            off_s = clock.now()
            clock.sleep(max(times_s) + 1.0)
            return np.array([room.true_luminance(off_s + time_s) for time_s in times_s])

    return at
