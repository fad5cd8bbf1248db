"""The simulated bench for luminances: runs of the protocol, and the room's own luminances."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from labrig.acquire import RigFile, read_rig_file
from labrig.bench import open_bench
from labrig.foundation import resources
from labrig.foundation.arrays import FloatArray
from labrig.protocols.luminance.protocol import LuminanceFrames
from labrig.record import PERSON, read_run
from tests.analyse.recorded import recorded, shipped_rig
from tests.quick_yaml import read_quickly, write_quickly

#: A protocol of some minutes, with a sample that is dim by then.
QUICK: dict[str, Any] = {
    "protocol": "luminance",
    "excitation": {"preset": "own", "time": "5 min"},
    "longest": "10 s",
}


def write_glow(
    folder: Path,
    brightness: float,
    band_nm: tuple[float, float] = (520.0, 75.0),
    one_trap: bool = False,
) -> Path:
    """Write a material that glows in a band of that middle and width, and is so much brighter.

    It fades as the shipped power law does, or has one state, for traps of another law.
    """
    content = read_quickly((resources.folder("config/materials") / "power-law.yaml").read_text())
    middle_nm, fwhm_nm = band_nm
    nm = np.arange(380.0, 721.0, 5.0)
    value = np.exp(-4 * np.log(2) * ((nm - middle_nm) / fwhm_nm) ** 2)
    edges = np.array(content["bands_nm"])
    power = np.diff(np.interp(edges, nm, np.cumsum(value)))
    if one_trap:
        excited = [0.02, 0.015, 0.002, 0.0, 0.0, 0.0, 0.0, 0.0]
        states: list[dict[str, Any]] = [
            {"k_r_per_s": 0.01, "k_e_per_s": excited, "reradiation": [1.0]}
        ]
    else:
        states = content["states"]
    for state in states:
        total = brightness * float(np.sum(state["reradiation"]))
        state["reradiation"] = (total * power / power.sum()).tolist()
    spectrum = {"wavelength_nm": nm.tolist(), "value": value.tolist()}
    path = folder / "glow.yaml"
    keys = {"name": "glow", "states": states, "spectrum": spectrum}
    path.write_text(write_quickly(content | keys))
    return path


def write_rig(
    folder: Path,
    reading: dict[str, Any] | None = None,
    optics: dict[str, Any] | None = None,
    **simulation: Any,
) -> Path:
    """The shipped rig for luminances, changed as told."""
    path = folder / "rig.yaml"
    path.write_text(write_quickly(bench(reading, optics, **simulation)))
    return path


def bench(
    reading: dict[str, Any] | None = None,
    optics: dict[str, Any] | None = None,
    **simulation: Any,
) -> dict[str, Any]:
    """The content of that rig file."""
    content = shipped_rig("sim-luminance", 64, 48)
    content["simulation"] |= simulation
    content["devices"]["lamp"]["warm_up"] = "10 min"
    content["devices"]["camera"].pop("warm_up")
    content["optics"] |= optics or {}
    content["optics"]["luminance"] |= reading or {}
    return content


def record(folder: Path, protocol: dict[str, Any], **changed: Any) -> Path:
    """The folder of a run of that protocol on `write_rig`'s rig."""
    return recorded(folder, {"sample": {"name": "test"}} | protocol, bench(**changed))


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
    opened = wall_s(rig)

    def at(times_s: Sequence[float]) -> FloatArray:
        begin_s, warm_s, lit_s = lamp_on - opened, uncovered - lamp_on, off - uncovered
        return luminance_after(rig, times_s, begin_s, warm_s, lit_s)

    return at


def wall_s(rig: RigFile) -> float:
    """Time at which the clock of the room begins, in seconds since 1970."""
    with open_bench(rig, "rig") as bench:
        return bench.clock.wall(0.0)


def luminance_after(
    rig: RigFile, times_s: Sequence[float], begin_s: float, warm_s: float, lit_s: float
) -> FloatArray:
    """True luminances (times, patches) after the lamp burnt over the card, then on the sample."""
    with open_bench(rig, "rig") as bench:
        assert bench.room is not None
        room, clock = bench.room.room, bench.room.clock
        clock.sleep(begin_s)
        room.tasks["grey card"]()
        room.switch_lamp(True)
        clock.sleep(warm_s)
        room.tasks["sample"]()
        clock.sleep(lit_s)
        room.switch_lamp(False)
        off_s = clock.now()
        clock.sleep(max(times_s) + 1.0)
        return np.array([room.true_luminance(off_s + time_s) for time_s in times_s])
