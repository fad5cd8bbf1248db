"""Runs on the simulated bench with LEDs, quick and small."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from labrig import resources
from labrig.bench import Recording
from tests.analyse.recorded import quietly
from tests.quick_yaml import read_quickly, write_quickly

#: The shipped samples by the names of their patches.
SAMPLES = {
    "yellow": "yellow-textile",
    "orange": "orange-textile",
    "paper": "white-paper",
    "felt": "grey-felt",
}
QUICK: dict[str, Any] = {
    "protocol": "led_fluorescence",
    "patches": {
        "yellow": [0.1, 0.12, 0.3, 0.3],
        "orange": [0.6, 0.12, 0.3, 0.3],
        "paper": [0.1, 0.58, 0.3, 0.3],
        "felt": [0.6, 0.58, 0.3, 0.3],
    },
    "longest": "2 s",
    "exposures": 2,
}


def record(
    folder: Path,
    protocol: dict[str, Any],
    change: Callable[[dict[str, Any]], None] = lambda rig: None,
) -> Path:
    """The folder of a run of `protocol` on the shipped rig with LEDs, as `change` leaves it."""
    rig = read_quickly((resources.folder("config") / "sim-fluorescent.yaml").read_text())
    # PyYAML takes it for a date, as labrig's loader does not.
    rig["simulation"]["epoch"] = "2026-01-01T00:00:00Z"
    rig["simulation"]["sensor"] = {"width": 96, "height": 64}
    rig["devices"]["camera"].pop("warm_up")
    if not protocol.get("lamps") and protocol["protocol"] != "validate_illuminants":
        rig["devices"].pop("illuminants")
    change(rig)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "rig.yaml").write_text(write_quickly(rig))
    (folder / "protocol.yaml").write_text(write_quickly(protocol))
    return Recording.prepare(folder / "protocol.yaml", folder / "rig.yaml", folder / "runs").record(
        quietly
    )
