"""Runs on the simulated bench with LEDs, quick and small."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from tests.analyse.recorded import recorded, shipped_rig

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
    rig = shipped_rig("sim-fluorescent")
    rig["devices"]["camera"].pop("warm_up")
    if not protocol.get("lamps") and protocol["protocol"] != "validate_illuminants":
        rig["devices"].pop("illuminants")
    change(rig)
    return recorded(folder, protocol, rig)
